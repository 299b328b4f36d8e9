"""Stops that outlive the process that was told of them: a file for each one that holds.

A process can be killed while a robot is held, and started again by whatever looks after it. The robot must not drive
then. That a file is there is all that counts: one that was damaged, or cannot be read, still holds the robot.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from patrol.errors import BadInput

_FOLDER = "fogwatch"


def state_folder(given: Path | None, environment: Mapping[str, str]) -> Path:
    """Return the folder for what must outlive this user's processes.

    It is `given` unless that is None, else the first one of systemd's ``StateDirectory=``, else the user's own.
    """
    if given is not None:
        return given
    if first := environment.get("STATE_DIRECTORY", "").partition(":")[0]:
        return Path(first)
    own = Path(environment.get("XDG_STATE_HOME", ""))
    if own.is_absolute():  # else it does not count, by its own rules
        return own / _FOLDER
    with suppress(RuntimeError):
        return Path.home() / ".local" / "state" / _FOLDER
    raise BadInput("--state: this user has no home where stops could be noted; give a folder")


class StopFiles:
    """The files that note the stops of one robot; their folder is made if there is none."""

    def __init__(self, folder: Path, robot: str) -> None:
        self._folder = folder
        self._robot = robot
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._sync()
            if not os.access(folder, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            raise BadInput(
                f"--state {folder}: stops cannot be noted there ({error.strerror}); give a folder that this user may "
                "write to"
            ) from None

    def holds(self, stopper: str) -> bool:
        """Return True if a stop of `stopper` holds."""
        return os.path.lexists(self._path(stopper))

    def note(self, stopper: str, who: str) -> str:
        """Note that a stop holds, on the disk when this returns; return why that failed, empty if it did not.

        `who` is what people call the stop's source.
        """
        line = f"{self._robot}: stopped by {who}\n"
        try:
            if not self.holds(stopper):
                file = os.open(self._path(stopper), os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
                try:
                    os.write(file, line.encode())
                    os.fsync(file)
                finally:
                    os.close(file)
            self._sync()
        except OSError as error:
            return f"{self._path(stopper)}: {error.strerror}"
        return ""

    def forget(self, stopper: str) -> str:
        """Note that a stop holds no longer; return why that failed, empty if it did not."""
        try:
            self._path(stopper).unlink(missing_ok=True)
            self._sync()
        except OSError as error:
            return f"{self._path(stopper)}: {error.strerror}"
        return ""

    def _path(self, stopper: str) -> Path:
        return self._folder / f"{self._robot}.stopped-by-{stopper}"

    def _sync(self) -> None:
        """A file's name is on the disk only with its folder."""
        folder = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
