"""A process's log, on the standard error: lines for people or, on request, a JSON object in each line for programs.

Lines for people begin with the name of the process, and are what they were before there was a choice. A JSON line has
``time`` (UTC), ``level``, ``process``, ``pid`` and ``message``; some have more. Everything that Python writes goes the
same way then: warnings, messages of libraries, and the traceback of a crash, which is one line.

A log that cannot be written is no reason to end: its reader has gone.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import traceback
from collections.abc import Callable, MutableMapping
from contextlib import suppress
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

LEVELS = ("debug", "info", "warning", "error")
"""Log levels, from all lines to the fewest."""

LONGEST = 8192
"""Characters of the longest message or traceback in a JSON line; of longer ones the beginning and the end remain."""

_LOGGER = logging.getLogger("fogwatch")


class Format(StrEnum):
    """Formats of a log."""

    TEXT = "text"
    JSON = "json"


class Log(logging.LoggerAdapter[logging.Logger]):
    """The log of one process, or of one part of it.

    Facts that a line is given by name are more fields of a JSON line, and lines for people leave them out.
    """

    def __init__(self, owner: str, prefix: str | None = None) -> None:
        """Begin a log; lines for people start with `prefix`, by default the process's name and a colon."""
        self.owner = owner
        super().__init__(_LOGGER, {"process_name": owner, "prefix": f"{owner}: " if prefix is None else prefix})

    def process(self, msg: Any, kwargs: MutableMapping[str, Any]) -> tuple[Any, MutableMapping[str, Any]]:
        """Put the facts into the record."""
        error = kwargs.pop("exc_info", None)
        return msg, {"exc_info": error, "extra": {**(self.extra or {}), "facts": kwargs}}

    def failure(self, error: BaseException) -> None:
        """Report an exception with its traceback."""
        self.error(described(error), exc_info=error)

    def announce(self, line: str) -> None:
        """Tell the starter of this process, on the standard output and at any level, that what it waits for is done."""
        record = _LOGGER.makeRecord(_LOGGER.name, logging.INFO, "", 0, "%s", (line,), None, extra=self.extra)
        print(_HANDLER.shape(record), flush=True)


def described(error: BaseException) -> str:
    """Describe an exception by its type and message."""
    return "".join(traceback.format_exception_only(error)).strip()


class _Handler(logging.Handler):
    """Writes lines to what is the standard error at the time, whole and at once."""

    def __init__(self, shape: Callable[[logging.LogRecord], str]) -> None:
        super().__init__()
        self.shape = shape

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record."""
        stream = sys.stderr
        with suppress(OSError, ValueError, AttributeError):  # its reader has gone, or there is none
            stream.write(f"{self.shape(record)}\n")
            stream.flush()


def _as_text(record: logging.LogRecord) -> str:
    if record.exc_info:
        return "".join(traceback.format_exception(record.exc_info[1])).rstrip("\n")
    return f"{getattr(record, 'prefix', '')}{record.getMessage()}"


class _AsJson:
    """Writes records as JSON objects; ASCII only, so that no character of a message acts on a terminal."""

    def __init__(self, process: str) -> None:
        self.process = process
        """Whose records are those that name no process: a library's, and crashes."""

    def __call__(self, record: logging.LogRecord) -> str:
        """Return a record, of our own logger or of a library's, as one line."""
        when = datetime.fromtimestamp(record.created, UTC)
        fields: dict[str, Any] = {
            "time": when.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": _level_of(record.levelno),
            "process": getattr(record, "process_name", self.process),
            "pid": os.getpid(),
            "message": _shorten_text(record.getMessage()),
        }
        if record.name != _LOGGER.name:
            fields["library"] = record.name
        if record.exc_info and record.exc_info[1] is not None:
            fields["traceback"] = _shorten_text("".join(traceback.format_exception(record.exc_info[1])))
        facts = {name: fact for name, fact in getattr(record, "facts", {}).items() if name not in fields}
        return json.dumps(fields | facts, default=str)


def begin_log(process: str, form: Format, level: str) -> Log:
    """Choose how this process writes its log, from now on."""
    _LOGGER.setLevel(level.upper())
    if form is Format.TEXT:
        _HANDLER.shape = _as_text
        return Log(process)
    _HANDLER.shape = shape = _AsJson(process)
    root = logging.getLogger()
    root.handlers[:] = [_Handler(shape)]  # libraries, from the root's own level on: warnings and errors
    logging.captureWarnings(True)

    def in_thread(hook: threading.ExceptHookArgs) -> None:
        if hook.exc_value is not None and not isinstance(hook.exc_value, SystemExit):
            crashed(hook.exc_value)

    sys.excepthook = lambda _kind, error, _trace: crashed(error)
    threading.excepthook = in_thread
    return Log(process)


def is_json() -> bool:
    """Return True if the log is one JSON object in each line; then libraries must not write lines of their own."""
    return isinstance(_HANDLER.shape, _AsJson)


def crashed(error: BaseException) -> None:
    """Report a mistake of ours, which ends the process or one of its threads."""
    shape = _HANDLER.shape
    Log(shape.process if isinstance(shape, _AsJson) else "").failure(error)


def _level_of(number: int) -> str:
    """Return the name of the highest of `LEVELS` that a level reaches, or else of the lowest.

    For example, 25 is "info", 50 "error" and 5 "debug".
    """
    return logging.getLevelName(min(max(number // 10 * 10, logging.DEBUG), logging.ERROR)).lower()


def _shorten_text(text: str) -> str:
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2
    return f"{text[:half]} [... {len(text) - 2 * half} characters ...] {text[-half:]}"


_HANDLER = _Handler(_as_text)
_LOGGER.propagate = False
_LOGGER.setLevel(logging.INFO)
_LOGGER.handlers[:] = [_HANDLER]
