"""Reading the folder of a run, whether the run has ended or not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.process.starting.warmup import warm

if TYPE_CHECKING:
    from monitor.replay.run import Run


def read_folder(folder: Path, key: Path | None, say: Callable[[str], None]) -> tuple[Run, bool]:
    """Read a run's folder, after compiling the kernels that this needs.

    Args:
        folder: The run's folder.
        key: The file of the fleet's key; None to leave the tags of messages unchecked. The file that the run's
            scenario names is not opened: the run may be a stranger's.
        say: Takes a line when compiling takes time.

    Returns:
        The run, and whether it is still going on.

    Raises:
        BadInput: The folder does not hold a run.
    """
    from monitor.replay.run_files import journal_in

    journal_in(folder)
    warm(("patrol", "monitor"), say)
    from monitor.replay.run import open_run
    from patrol.journal.file import is_being_written

    run = open_run(folder, key)
    return run, run.ended is None and is_being_written(run.journal.path)
