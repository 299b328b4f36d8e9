"""The check that a robot that was told to stand does, as far as its odometry shows."""

from __future__ import annotations

import math
import time
from threading import Condition

from ros2.robot.localisation import LONGEST_S, Fix

MOVES = 0.05
"""A robot moves whose speed and turn rate add up to more than this, in m/s and rad/s: odometry is noisy."""

STANDS_S = LONGEST_S + 0.1
"""For how long odometry must say that a robot stands, s: what it says may be so old, and from before the stop."""

LIMIT_S = 3.0
"""Time for a robot to come to rest before its operator is told that it has not, s."""

LOOK_S = 1.0
"""Longest wait of a later request, s: long enough to see a robot stand that has come to rest since."""

_JUST = "it has not come to rest yet"


def moves(fix: Fix) -> bool:
    """Return True if a robot moves, as its odometry says."""
    return speed_of(fix) > MOVES


def speed_of(fix: Fix) -> float:
    """Return the sum of a robot's speed, m/s, and its turn rate, rad/s."""
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
        """The robot is told to stand from now on; what was seen before does not count."""
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
