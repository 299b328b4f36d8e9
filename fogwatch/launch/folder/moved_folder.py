"""Finds a run's folder again that was moved while the processes wrote into it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fogwatch.launch.folder.runfolder import RunFolder


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
