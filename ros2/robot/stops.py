"""The stops of the robot, by a topic and others, the files that note them, and the check that it stands.

Each source of a stop must release it before the robot drives again, also after a restart: its process can be killed
while it is held, and started again. So there is a file for each stop that holds. Only that it is there counts: one that
was damaged, or cannot be read, still holds the robot.
"""

from __future__ import annotations

import errno
import math
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from threading import Condition, Thread

from patrol.errors import BadInput
from ros2.robot.localisation import LONGEST_S, Fix
from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.messages import Bool

MOVES = 0.05
"""A robot moves whose speed and turn rate add up to more than this, in m/s and rad/s: odometry is noisy."""

STANDS_S = LONGEST_S + 0.1
"""For how long odometry must say that a robot stands, s: its messages may be so old, and from before the stop."""

LIMIT_S = 3.0
"""Time for a robot to come to rest before its operator is told that it has not, s."""

LOOK_S = 1.0
"""Longest wait of a later request, s: long enough to see a robot stand that has come to rest since."""

_JUST = "it has not come to rest yet"


class DriverFailed(Exception):
    """The thread that drives has failed, so the robot was stopped for good."""


def moves(fix: Fix) -> bool:
    """Return True if a robot moves, as its odometry says."""
    return speed_of(fix) > MOVES


def speed_of(fix: Fix) -> float:
    """Return the sum of a robot's speed, m/s, and its turn rate, rad/s.

    For example, 0.5 for a robot that drives at 0.3 m/s and turns by 0.2 rad/s.
    """
    return math.hypot(fix.twist.vx, fix.twist.vy) + abs(fix.twist.turn_rate)


class Standing:
    """Follows a robot that was told to stand; one thread looks, others wait.

    `factor` is the seconds of the robot's time in one of ours.
    """

    def __init__(self, factor: float) -> None:
        self._stands_s = STANDS_S / factor
        self._changed = Condition()
        self._told_s = time.monotonic()
        self._still_s: float | None = None
        self._doubt = _JUST

    def told(self) -> None:
        """The robot is told to stand from now on; earlier odometry does not count."""
        with self._changed:
            self._told_s = time.monotonic()
            self._still_s, self._doubt = None, _JUST

    def look(self, fix: Fix | None, unconfirmed: str, moment_s: float) -> None:
        """Take in the state of a robot that was told to stand, at a moment of `time.monotonic`.

        `fix` is None if its pose is unknown. `unconfirmed` is the part of the stop that is not confirmed, empty if
        there is none.
        """
        with self._changed:
            if fix is None:
                self._still_s, self._doubt = None, "its odometry does not come"
            elif moves(fix):
                self._still_s, self._doubt = None, f"its odometry says {speed_of(fix):.2f} m/s"
            elif self._still_s is None:
                # It stands only from here on; one message of rest may come between two of motion.
                self._still_s, self._doubt = moment_s, _JUST
            elif moment_s - self._still_s >= self._stands_s:
                self._doubt = unconfirmed
            self._changed.notify_all()

    def doubt(self) -> str:
        """Wait until the robot is sure to stand, but not for ever; return why it is not sure, empty if it is."""
        with self._changed:
            left_s = self._told_s + LIMIT_S - time.monotonic()
            self._changed.wait_for(lambda: not self._doubt, max(LOOK_S, left_s))
            return self._doubt


_FOLDER = "fogwatch"


def state_folder(given: Path | None, environment: Mapping[str, str]) -> Path:
    """Return the folder for state that must outlive this user's processes.

    It is `given` unless that is None, else the first one of systemd's ``StateDirectory=``, else the user's own.
    """
    if given is not None:
        return given
    if first := environment.get("STATE_DIRECTORY", "").partition(":")[0]:
        return Path(first)
    base = Path(environment.get("XDG_STATE_HOME", ""))
    if base.is_absolute():  # the XDG rules say to ignore a relative one
        return base / _FOLDER
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
            self._sync_folder()
            if not os.access(folder, os.W_OK | os.X_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            raise BadInput(
                f"--state {folder}: stops cannot be noted there ({error.strerror}); give a folder that this user may "
                "write to"
            ) from None

    def holds(self, stopper: str) -> bool:
        """Return True if a stop of `stopper` holds."""
        return os.path.lexists(self._stop_path(stopper))

    def note(self, stopper: str, source: str) -> str:
        """Note that a stop holds, on the disk when this returns; return why that failed, empty if it did not.

        `source` is what people call the stopper.
        """
        line = f"{self._robot}: stopped by {source}\n"
        try:
            # A file that is there already may be damaged, but holds all the same.
            if not self.holds(stopper):
                file = os.open(self._stop_path(stopper), os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
                try:
                    os.write(file, line.encode())
                    # A stop must survive a power cut right after it was confirmed.
                    os.fsync(file)
                finally:
                    os.close(file)
            self._sync_folder()
        except OSError as error:
            return f"{self._stop_path(stopper)}: {error.strerror}"
        return ""

    def forget(self, stopper: str) -> str:
        """Note that a stop holds no longer; return why that failed, empty if it did not."""
        try:
            self._stop_path(stopper).unlink(missing_ok=True)
            self._sync_folder()
        except OSError as error:
            return f"{self._stop_path(stopper)}: {error.strerror}"
        return ""

    def _stop_path(self, stopper: str) -> Path:
        return self._folder / f"{self._robot}.stopped-by-{stopper}"

    def _sync_folder(self) -> None:
        """A file's name is on the disk only with its folder."""
        folder = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


SAVE_S = 1.0
"""Longest time to write a stop to disk before its source is told that it is not written, s."""


class Stopper(StrEnum):
    """The sources of stops."""

    OPERATOR = "operator"
    TOPIC = "topic"


class Stops:
    """The stops that hold; called from any thread.

    A stop holds at once. A thread notes it, so that no slow disk keeps a robot driving; `unsaved` waits for that.
    Without `files` the stops end with this process. `error` is the reason why the files do not say which stops hold,
    empty if they do, or will in a moment.
    """

    def __init__(self, topic: str, files: StopFiles | None = None) -> None:
        self._texts = {
            Stopper.OPERATOR: ("an operator", "fogwatch control ... release"),
            Stopper.TOPIC: (f"the topic {topic}", "publish false there to release it"),
        }
        self._files = files
        self._changed = Condition()
        self._held = [] if files is None else [stopper for stopper in Stopper if files.holds(stopper)]
        self._noted = set(self._held)
        self.error = ""
        if files is not None:
            Thread(target=self._note_stops, args=(files,), name="stops", daemon=True).start()

    def __bool__(self) -> bool:
        return bool(self._held)

    def __contains__(self, stopper: Stopper) -> bool:
        return stopper in self._held

    @property
    def why(self) -> str:
        """The stops of the robot and how to release them; empty if there are none."""
        with self._changed:
            stoppers = [self._texts[stopper] for stopper in self._held]
        return "; ".join(f"stopped by {source} ({release})" for source, release in stoppers)

    def name(self, stopper: Stopper) -> str:
        """Name a source of stops, for people."""
        return self._texts[stopper][0]

    def hold(self, stopper: Stopper) -> bool:
        """Stop the robot for one source; return True if that is new."""
        with self._changed:
            new = stopper not in self._held
            if new:
                self._held.append(stopper)
            self.error = ""
            self._changed.notify_all()
            return new

    def release(self, stopper: Stopper) -> bool:
        """Release the stops of one source, while others' stops still hold; return True if that is new."""
        with self._changed:
            new = stopper in self._held
            if new:
                self._held.remove(stopper)
            self.error = ""
            self._changed.notify_all()
            return new

    def unsaved(self, limit_s: float = SAVE_S) -> str:
        """Wait until the stops that hold now are noted; return why they are not, in a few words, empty if they are."""
        with self._changed:
            if self._files is None:
                return ""
            self._changed.wait_for(lambda: bool(self.error) or self._is_noted(), limit_s)
            return "" if self._is_noted() else self.error or "the disk is slow"

    def _is_noted(self) -> bool:
        return self._noted == set(self._held)

    def _note_stops(self, files: StopFiles) -> None:
        """Keep the files in step with the stops that hold; after an error, once something changes."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: not self.error and not self._is_noted())
                # One at a time: meanwhile stops may come and go.
                wrong = next(iter(set(self._held) ^ self._noted))
                holds = wrong in self._held
            error = files.note(wrong, self._texts[wrong][0]) if holds else files.forget(wrong)
            with self._changed:
                self.error = error
                if not error:
                    (self._noted.add if holds else self._noted.discard)(wrong)
                self._changed.notify_all()


OLDER = "a false on it was sent before the stop, by its sender's clock, and releases nothing; publish it again"
TIMELESS = "a false on it does not say when it was sent, and releases nothing"


@dataclass(frozen=True, slots=True)
class _Stop:
    sent_ns: int
    sender: bytes = b""
    sequence: int | None = None


class StopTopic(RosMailbox[Bool]):
    """Takes in the topic as its messages come, so that a flood pushes nothing out.

    Several nodes may publish there, and a late subscriber gets the last message of each, in any order. So a true always
    stops, and a false releases only what was sent before it. What one sender says is ordered by its own count;
    otherwise the senders' clocks decide, and in doubt the robot stays where it is.

    If `held`, the topic has stopped the robot before this process began; what was sent before then releases nothing.
    `clock` returns the time, ns since the epoch.
    """

    def __init__(self, held: bool, clock: Callable[[], int]) -> None:
        super().__init__()
        self._clock = clock
        self._stop = _Stop(clock()) if held else None
        self._stopped = False
        self._ignored = ""

    def put(self, received: Received[Bool]) -> None:
        """Take in a message; called from any thread."""
        with self._changed:
            if received.message.data:
                # A clock that is ahead must not make a stop that nothing releases.
                now_ns = self._clock()
                sent_ns = now_ns if received.sent_ns is None else min(received.sent_ns, now_ns)
                if self._stop is None or sent_ns >= self._stop.sent_ns:
                    self._stop = _Stop(sent_ns, received.sender, received.sequence)
                self._stopped, self._ignored = True, ""
            elif self._stop is not None:
                self._ignored = self._release_objection(self._stop, received)
                # Our own clock may have been put back since; then the next false releases.
                stop = replace(self._stop, sent_ns=min(self._stop.sent_ns, self._clock()))
                self._stop = stop if self._ignored else None
        super().put(received)

    def refuse(self, reason: str, line: str) -> None:
        """Take a message that cannot be used for a stop; called from any thread."""
        with self._changed:
            self._stop = _Stop(self._clock())
            self._stopped, self._ignored = True, ""
        super().refuse(reason, line)

    def heed(self) -> tuple[bool, bool, str]:
        """Take the requests that have come since the last call.

        Returns whether the topic stopped the robot in the meantime, whether it holds it now, and why a false has not
        released it, empty if none was ignored.
        """
        with self._changed:
            state = self._stopped, self._stop is not None, self._ignored
            self._stopped, self._ignored = False, ""
            return state

    def _release_objection(self, stop: _Stop, received: Received[Bool]) -> str:
        """Return why a false does not release the robot; empty if it does."""
        if received.sequence is not None and stop.sequence is not None and received.sender == stop.sender:
            return "" if received.sequence > stop.sequence else OLDER
        if received.sent_ns is None:
            return TIMELESS
        return "" if received.sent_ns > stop.sent_ns else OLDER
