"""The files of a run's folder, checked before any kernel is compiled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.untrusted import RECORDING as RECORDING_FILE
from patrol.files.untrusted import leads_out, open_untrusted
from patrol.journal import Journal, read_journal

JOURNAL = "journal"
SCENARIO = "scenario.yaml"
SUMMARY = "summary.json"
RECORDING = "recording.mcap"
REPORT = "report.html"

MOST_REPLAYS = 2
"""Runs that a page shows side by side."""

_MCAP = b"\x89MCAP0\r\n"


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
        try:
            with open_untrusted(folder, RECORDING_FILE) as file:
                recording = file.read(len(_MCAP)) == _MCAP
        except OSError as error:
            raise BadInput(f"{folder}: cannot be read ({error.strerror}); name the run's folder") from None
        kind = "is a recording; inspect it with `fogwatch record --check`, or" if recording else "is a file;"
        raise BadInput(f"{folder}: {kind} name the run's folder")
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
