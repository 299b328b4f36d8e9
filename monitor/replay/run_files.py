"""The files of a run's folder, checked before any kernel is compiled, and its summary.json."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from pydantic import ValidationError

from patrol.errors import BadInput, quoted
from patrol.files.untrusted import SUMMARY as SUMMARY_FILE
from patrol.files.untrusted import leads_out, read_untrusted, refuse_half_characters
from patrol.journal import Journal, read_journal
from patrol.summary.model import Summary

JOURNAL = "journal"
SCENARIO = "scenario.yaml"
SUMMARY = "summary.json"
RECORDING = "recording.mcap"
REPORT = "report.html"

MOST_REPLAYS = 2
"""Runs that a page shows side by side."""


def check_out(out: Path, example: str) -> None:
    """Check that a file can be written, before the work that produces it.

    `example` is a file name to suggest if `out` is a folder.
    """
    if out.is_dir() or not out.name:
        raise BadInput(f"{out}: is a folder; name a file, such as {out / example}")
    if not out.parent.is_dir():
        raise BadInput(f"{out}: cannot be written (no such folder: {out.parent}); choose another file")


def check_runs(folders: Sequence[Path]) -> None:
    """Check the runs that a page is to show."""
    if len(folders) > MOST_REPLAYS:
        raise BadInput(
            f"replay: {len(folders)} runs were named; name one, or two to see them side by side (fogwatch compare "
            "takes more)"
        )
    for folder in folders:
        journal_in(folder)


def journal_in(folder: Path) -> Journal:
    """Open the journal of a run, without reading its ticks yet."""
    if folder.is_file():
        raise BadInput(f"{folder}: is a file; name the run's folder")
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; name the folder of a run, such as runs/yards-20260101-120000")
    for name, why in ((JOURNAL, "its run has not started"), (SCENARIO, "its run is incomplete")):
        if not (folder / name).is_file():
            raise BadInput(
                f"{folder}: holds no file {name}, so it is not the folder of a run, or {why}; name the folder of a run"
            )
    for name in (JOURNAL, SCENARIO, SUMMARY):
        if leads_out(folder, folder / name):
            raise BadInput(f"{folder / name}: is a link that leads out of the run's folder; put the file itself there")
    return read_journal(folder / JOURNAL)


DEEPEST = 50
"""Mappings and lists within each other; a summary has six."""
TOO_DEEP = "is nested too deeply for a summary; remove or restore it"


def read_summary(path: Path) -> Summary | None:
    """Read summary.json; return None where it is missing or, because the run was killed, incomplete."""
    try:
        document = json.loads(read_untrusted(path, SUMMARY_FILE), parse_int=_read_integer, parse_constant=_no_number)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); remove or restore it") from None
    except RecursionError:
        raise BadInput(f"{path}: {TOO_DEEP}") from None
    except ValueError:
        return None
    if not isinstance(document, dict):
        raise BadInput(f"{path}: holds {quoted(document)}, which is no summary; remove or restore it")
    for field, value, depth in _walk_values(document):
        if depth > DEEPEST:
            raise BadInput(f"{path}: {TOO_DEEP}")
        if isinstance(value, float) and not math.isfinite(value):
            raise BadInput(f"{path}: {field} is too large for a number; remove or restore the file")
    refuse_half_characters(document, str(path))
    try:
        return Summary.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        wrong = f"{field} = {quoted(first['input'])}: {first['msg'][:1].lower()}{first['msg'][1:]}"
        raise BadInput(f"{path}: {wrong}; remove or restore the file") from None


def _walk_values(document: object) -> Iterator[tuple[str, object, int]]:
    """Yield all values of a JSON document, each with its dotted field and its depth; nothing below `DEEPEST`.

    For example, {"a": {"b": [1, 2]}} gives ("a.b.1", 2, 3) and ("a.b.0", 1, 3).
    """
    # Not by recursion: a stranger's file may be nested deeper than Python's stack.
    waiting = [("", document, 0)]
    while waiting:
        field, node, depth = waiting.pop()
        if isinstance(node, dict) and depth <= DEEPEST:
            waiting += [(f"{field}.{name}" if field else name, value, depth + 1) for name, value in node.items()]
        elif isinstance(node, list) and depth <= DEEPEST:
            waiting += [(f"{field}.{index}", value, depth + 1) for index, value in enumerate(node)]
        else:
            yield field, node, depth


def _read_integer(digits: str) -> int | float:
    """An integer; infinity for one that is too large for a float, which the search for such values then refuses."""
    number = float(digits)
    return int(digits) if math.isfinite(number) else number


def _no_number(constant: str) -> float:
    raise BadInput(f"summary.json: holds {constant} instead of a number; remove or restore it")
