"""Reading the folder of a run, whether the run has ended or not."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.files.untrusted import JOURNAL, open_untrusted
from patrol.starting.warmup import warm

if TYPE_CHECKING:
    from fogwatch.run_folder.runfolder import RunFolder
    from monitor.replay.run import Run


def found_again(folder: RunFolder, handle: int, say: Callable[[str], None]) -> RunFolder:
    """Find the run's folder, which may have been moved; the same object unless it was.

    `handle` is the folder's descriptor, open since the run began; this closes it.
    """
    try:
        if folder.path.exists():
            return folder
        try:
            moved = Path(f"/proc/self/fd/{handle}").readlink()
        except OSError:  # a system without proc(5)
            moved = folder.path
        if not moved.is_dir():
            say(f"{folder.path}: the run's folder was moved away or deleted, with all that it held")
            return folder
        say(f"{folder.path}: the run's folder was moved to {moved}; the summary is written there")
        moved_folder = replace(folder, path=moved)
        moved_folder.access.unlink(missing_ok=True)
        return moved_folder
    finally:
        os.close(handle)


FRESH_S = 30.0
"""Age of a journal's last write below which its run is taken to go on, where its drive has no locks."""


def read_folder(folder: Path, key: Path | None, say: Callable[[str], None]) -> tuple[Run, bool]:
    """Read a run's folder, after compiling the kernels that this needs.

    Return the run, and whether it is still going on. Without the file `key`, the tags of messages stay unchecked: the
    file that the run's scenario names is not opened, since the run may be a stranger's. `say` takes a line when
    compiling takes time.
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
