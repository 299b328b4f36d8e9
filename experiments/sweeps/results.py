"""The results of a sweep's runs: one JSON line each, written to disk as soon as a run is done.

`results.jsonl` only grows. A process or machine that dies leaves at most one incomplete line at its end, which is cut
off when the file is opened again, and that run is repeated. Damage anywhere else is an error and never repaired
silently.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, field
from io import BufferedReader, FileIO
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict
from pydantic.dataclasses import dataclass

from patrol.errors import BadInput, printable
from patrol.files.untrusted import RESULTS, check_regular
from patrol.files.whole_file import writing

FILE = "results.jsonl"
LONGEST_LINE = 1 << 20
"""Bytes of one line at most."""

OK: Literal["ok"] = "ok"
FAILED: Literal["failed"] = "failed"


@dataclass(frozen=True, slots=True, config=ConfigDict(strict=True, extra="forbid", allow_inf_nan=False))
class RunResult:
    """The result of one run."""

    key: str  # the run's in the plan
    case: str  # its name, for people; another case may mean the same run
    seed: int
    outcome: Literal["ok", "failed"]
    error: str | None  # why it failed, in one line; None if it did not
    metrics: Mapping[str, int | float | None]  # the summary's numbers, which do not depend on the machine
    trace_hash: str | None  # None if there is none
    wall_s: float
    software: str  # version of fogwatch that made it
    # what its case sets in the base scenario, by dotted field; empty in results of older versions
    settings: Mapping[str, object] = field(default_factory=dict)
    processor_s: float | None = None  # None in results of older versions

    @property
    def computing_s(self) -> float:
        """The processor time, s; where it was not measured, the wall time."""
        return self.wall_s if self.processor_s is None else self.processor_s

    @property
    def ok(self) -> bool:
        """True if the run is valid."""
        return self.outcome == OK


class Results:
    """The results of a sweep, on disk and in memory; opened with `open_results`.

    `by_key` has the results by the keys of their runs. `repaired` is True if the end of the file was repaired.
    """

    def __init__(self, path: Path, file: FileIO) -> None:
        """Read nothing yet; `file` is open for reading and appending, without a buffer."""
        self.path = path
        self.by_key: dict[str, RunResult] = {}
        self.repaired = False
        self._file = file

    def read(self) -> None:
        """Read the file and repair its end; of several results of a run, the last counts."""
        self._file.seek(0)
        reader = BufferedReader(self._file)
        number = end = 0
        while read := reader.readline(LONGEST_LINE):
            number += 1
            if not read.endswith(b"\n") and len(read) < LONGEST_LINE:
                reader.detach()
                self._repair_line(read, end)
                return
            end += len(read)
            line = read.removesuffix(b"\n")
            result = _parse_line(line)
            if result is None:
                raise BadInput(
                    f"{self.path} line {number}: is damaged ({_line_excerpt(line)}); "
                    "delete that line, and its run will be repeated, or choose another folder"
                )
            self.by_key[result.key] = result
        reader.detach()

    def add(self, result: RunResult) -> None:
        """Append a result; it is on disk when this returns."""
        self._write_data(_result_line(result))
        self.by_key[result.key] = result

    def _repair_line(self, rest: bytes, end: int) -> None:
        """Repair a last line without an end: keep it if it is complete, otherwise cut it off."""
        self.repaired = True
        result = _parse_line(rest)
        if result is None:
            os.ftruncate(self._file.fileno(), end)
            return
        self.by_key[result.key] = result
        self._write_data(b"\n")

    def _write_data(self, data: bytes) -> None:
        with writing(self.path, "free some space, then start again"):
            while data:
                data = data[self._file.write(data) :]
            os.fsync(self._file.fileno())


@contextmanager
def open_results(folder: Path) -> Iterator[Results]:
    """Open the results in a folder, which is made if it is missing, for this process alone."""
    path = folder / FILE
    with writing(path, "choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW
        if path.is_symlink():  # it would be made, or its last line cut off, wherever the link leads
            raise BadInput(f"{path}: is a link; put the file itself there, or choose another --out")
        file = FileIO(os.open(path, flags, 0o666), "r+b")
    with file:
        try:
            check_regular(file.fileno(), path, RESULTS)
        except OSError as error:
            raise BadInput(f"{path}: cannot be read ({error.strerror}); choose another --out") from None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(f"{folder}: another sweep is writing here; wait for it or choose another --out") from None
        results = Results(path, file)
        results.read()
        yield results


def _result_line(result: RunResult) -> bytes:
    return json.dumps(asdict(result), allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _parse_line(line: bytes) -> RunResult | None:
    """Return the result in a line, or None if the line holds none."""
    try:
        return RunResult(**json.loads(line.decode()))
    except (ValueError, TypeError, RecursionError):
        return None


def _line_excerpt(line: bytes) -> str:
    text = line.decode(errors="replace")
    text = printable(text[:41])
    return f"it reads {text[:40]}{'...' if len(text) > 40 else ''}" if text else "it is empty"
