"""Reading the folder of a run, whether the run has ended or not."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.files.untrusted import leads_out
from patrol.process.starting.warmup import warm

if TYPE_CHECKING:
    from monitor.replay.run import Run

STILL_S = 30.0
"""A journal without an end that has grown within this wall time may still be growing, even where no world answers: a
run in one process has none that could."""


def read_folder(folder: Path, key: Path | None, say: Callable[[str], None]) -> tuple[Run, bool]:
    """Read a run's folder, after compiling the kernels that this needs.

    Args:
        folder: The run's folder.
        key: The file of the fleet's key; None to leave the tags of messages unchecked. The file that the run's
            scenario names is not opened: the run may be a stranger's.
        say: Takes a line when compiling takes time.

    Returns:
        The run, and whether it may still be going on.

    Raises:
        BadInput: The folder does not hold a run.
    """
    from monitor.replay.run_files import journal_in

    journal_in(folder)
    warm(("patrol", "monitor"), say)
    from monitor.replay.run import open_run

    run = open_run(folder, key)
    return run, run.ended is None and _may_go_on(run)


def _may_go_on(run: Run) -> bool:
    """Return whether a run without an end may be going on: its journal grew lately, or its world answers."""
    if time.time() - run.journal.path.stat().st_mtime < STILL_S:
        return True
    from patrol.net.security.access import FILE

    if not (run.folder / FILE).is_file() or leads_out(run.folder, run.folder / FILE):
        return False
    from monitor.live.attach import is_running

    return is_running(run.folder)
