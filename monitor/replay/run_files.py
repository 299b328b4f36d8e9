"""The files of a run's folder, and whether a folder has them: known before anything is compiled."""

from __future__ import annotations

from pathlib import Path

from patrol.errors import BadInput
from patrol.journal import Journal, read_journal

JOURNAL = "journal"
SCENARIO = "scenario.yaml"
SUMMARY = "summary.json"
RECORDING = "recording.mcap"
REPORT = "report.html"

_MCAP = b"\x89MCAP0\r\n"


def check_out(out: Path, example: str) -> None:
    """BadInput for what cannot be written as a file, told before all the work. example: a file's name for a folder."""
    if out.is_dir() or not out.name:
        raise BadInput(f"{out}: is a folder; name a file, such as {out / example}")
    if not out.parent.is_dir():
        raise BadInput(f"{out}: cannot be written (there is no folder {out.parent}); choose another file")


def journal_in(folder: Path) -> Journal:
    """The journal of the run in a folder; BadInput for what cannot be one."""
    if folder.is_file():
        with folder.open("rb") as file:
            recording = file.read(len(_MCAP)) == _MCAP
        kind = "is a recording; look at it with `fogwatch recording`, and" if recording else "is a file;"
        raise BadInput(f"{folder}: {kind} name the run's folder here")
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; name a run's, such as runs/yards-20260101-120000")
    for name, what in ((JOURNAL, "no run's, or one whose ticks have not begun"), (SCENARIO, "no run's, or not whole")):
        if not (folder / name).is_file():
            raise BadInput(f"{folder}: holds no file {name}, so it is {what}; name a run's folder")
    return read_journal(folder / JOURNAL)
