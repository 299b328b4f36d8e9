"""Opening the folder of a run for the commands that look at it, whether the run has ended or not."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fogwatch.cli.ending import note
from fogwatch.cli.options import argument, option
from patrol.errors import BadInput
from patrol.files.untrusted import JOURNAL, open_untrusted
from runtime.starting.warmup import warm

if TYPE_CHECKING:
    from monitor.replay.run import Run

FRESH_S = 30.0
"""Age of a journal's last write below which its run is taken to go on, where its drive has no locks."""

RunFolder = Annotated[Path, argument("RUN", "Folder of a run.")]
_KEY = "Key of the run's fleet, to check the tags of its messages (default: unchecked)."
Key = Annotated[Path | None, option("FILE", _KEY, "--key")]
"""The file that a run's scenario names is not opened: the run may be a stranger's."""


def open_folder(folder: Path, key: Path | None = None, say: Callable[[str], None] = note) -> tuple[Run, bool]:
    """Open a run's folder, after compiling the kernels that this needs.

    Return the run, and whether it is still going on. Without the file `key`, the tags of messages stay unchecked. `say`
    takes a line when compiling takes time.
    """
    from monitor.replay.run_files import journal_in

    journal = journal_in(folder).path
    warm(("patrol", "monitor", "experiments"), say)
    from monitor.replay.run import open_run

    was_going_on = _is_being_written(journal)
    run = open_run(folder, key)
    if run.ended is None:
        if _is_being_written(journal):
            return run, True
        if was_going_on:  # it has ended since
            run = open_run(folder, key)
    return run, False


def print_state(run: Run, going: bool) -> None:
    """Print on the standard error what a run's folder lacks, and where its summary disagrees with its journal."""
    from monitor.report.analysis import disagreement, state_of

    for why in (state_of(run, going)[1], disagreement(run)):
        if why:
            note(f"{run.folder}: {why}")


def _is_being_written(journal: Path) -> bool:
    """Return True while the writer of a journal lives, on this machine or, where its drive has locks, on another."""
    try:
        with open_untrusted(journal, JOURNAL) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
            except OSError:
                return time.time() - os.fstat(file.fileno()).st_mtime < FRESH_S
    except OSError as error:
        raise BadInput(f"{journal}: cannot be read ({error.strerror})") from None
    return False
