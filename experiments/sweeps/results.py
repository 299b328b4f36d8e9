"""The results of a sweep's runs: one JSON line each, on disk before the next is begun to be believed.

`results.jsonl` only grows. A process or machine that dies leaves at most one torn line at its end, which is cut off
when the file is opened again, and that run is repeated. Damage anywhere else is an error and never mended silently.
"""

from __future__ import annotations

import fcntl
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from io import FileIO
from pathlib import Path
from typing import Any

from patrol.errors import BadInput

FILE = "results.jsonl"
OK = "ok"
FAILED = "failed"


@dataclass(frozen=True, slots=True)
class RunResult:
    """What one run came to.

    key: as the plan has it. case, seed: for people; another case may mean the same run. outcome: ok or failed; error:
    why it failed, in one line. metrics: the summary's numbers, the same whatever machine ran it. wall_s: how long it
    took, s. software: the version that ran it.
    """

    key: str
    case: str
    seed: int
    outcome: str
    error: str | None
    metrics: Mapping[str, float | None]
    trace_hash: str | None
    wall_s: float
    software: str

    @property
    def ok(self) -> bool:
        """Whether there are numbers to believe."""
        return self.outcome == OK


class Results:
    """A sweep's results, those on disk and those that are added; open it with `open_results`."""

    def __init__(self, path: Path, file: FileIO) -> None:
        self.path = path
        self.by_key: dict[str, RunResult] = {}
        self.repaired = False
        self._file = file

    def read(self) -> None:
        """Read what is on disk and mend the end of the file; the last result of a key counts."""
        self._file.seek(0)
        data = self._file.read()
        whole, _, rest = data.rpartition(b"\n")
        lines = whole.split(b"\n") if whole else []
        for number, line in enumerate(lines, start=1):
            result = _parse(line)
            if result is None:
                raise BadInput(
                    f"{self.path} line {number}: is damaged ({_excerpt(line)}); "
                    "delete that line, and its run will be repeated, or choose another folder"
                )
            self.by_key[result.key] = result
        if rest:
            self._mend(rest, len(data) - len(rest))

    def add(self, result: RunResult) -> None:
        """Append a result; it is on disk when this returns. BadInput when the disk does not take it."""
        self._write(_line(result))
        self.by_key[result.key] = result

    def _mend(self, rest: bytes, end: int) -> None:
        """Deal with a last line that does not end: keep it if it is whole, otherwise cut it off."""
        self.repaired = True
        result = _parse(rest)
        if result is None:
            os.ftruncate(self._file.fileno(), end)
            return
        self.by_key[result.key] = result
        self._write(b"\n")

    def _write(self, data: bytes) -> None:
        try:
            while data:
                data = data[self._file.write(data) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            raise BadInput(f"{self.path}: cannot be written ({error.strerror}); make room, then start again") from None


@contextmanager
def open_results(folder: Path) -> Iterator[Results]:
    """The results in a folder, which is made when missing, for this process alone.

    BadInput for a folder that cannot be used, a damaged file, and a folder in which another sweep is at work.
    """
    path = folder / FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("a+b", buffering=0)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); choose another --out") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInput(f"{folder}: another sweep is writing here; wait for it or choose another --out") from None
        results = Results(path, file)
        results.read()
        yield results


def _line(result: RunResult) -> bytes:
    return json.dumps(asdict(result), allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _parse(line: bytes) -> RunResult | None:
    """The result in a line, or None for anything else."""
    try:
        says: dict[str, Any] = json.loads(line.decode())
        result = RunResult(**says)
    except (ValueError, TypeError, RecursionError):
        return None
    whole = (
        isinstance(result.key, str)
        and isinstance(result.case, str)
        and type(result.seed) is int
        and result.outcome in (OK, FAILED)
        and (result.error is None or isinstance(result.error, str))
        and isinstance(result.metrics, dict)
        and all(isinstance(name, str) and _is_number(value) for name, value in result.metrics.items())
        and (result.trace_hash is None or isinstance(result.trace_hash, str))
        and result.wall_s is not None
        and _is_number(result.wall_s)
        and isinstance(result.software, str)
    )
    return result if whole else None


def _is_number(value: object) -> bool:
    if value is None:
        return True
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _excerpt(line: bytes) -> str:
    text = line.decode(errors="replace")
    text = "".join(char if char.isprintable() else "?" for char in text)
    return f"it reads {text[:40]}{'...' if len(text) > 40 else ''}" if text else "it is empty"
