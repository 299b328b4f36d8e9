"""The odometry of a robot, as far as it can be believed: of one sender, in its order, and without jumps.

Odometry moves as a body does. A pose that is farther from the last ones than speed and time allow means that the robot
was restarted and counts from another place, that it was carried, or that another node sends. Then the robot's pose is
unknown until its odometry has been steady for `SETTLED_S` and a localisation has placed it on the map anew.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros2.wire.frames import apart

if TYPE_CHECKING:
    from patrol.pose import Pose
    from ros2.robot.localisation import LocalisationSettings
    from ros2.wire.messages import Odometry, Twist

SETTLED_S = 1.0
"""For how long odometry must be steady, or of one sender, before it counts again, s."""

JUMP_M, JUMP_RAD = 0.5, 1.0
"""Largest change of odometry that is no jump, m and rad: the noise of its poses, and the lateness of a message."""

USUAL_S = 0.1
"""Time between two messages of which none between them is missing, s."""

MOST_RAD = 3.0
"""A turn that is larger is a jump, however fast the robot can turn: of nearly half a turn the sense is unknown."""

BACK_S = 0.1
"""Least step back of arrivals that means that a clock was set back, s."""

REMEMBERED = 256
"""Messages that are remembered."""

_DRIVEN_S = 0.5
"""The longest time between two messages over which a velocity counts as driven, s."""
_MOST_SENDERS = 16
"""Senders that are kept; two are one too many already."""


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """A message of odometry."""

    stamp_s: float
    arrived_s: float
    pose: Pose  # in the odometry's frame
    twist: Twist  # in the body's own frame
    driven_m: float  # way until then, by its velocities: the noise of poses would add up


class Odometer:
    """Takes in odometry; all times are the robot's, in s.

    `readings` holds what is believed, the newest last, without what came before a silence. `frame` is that of its
    poses, empty before the first; `jumped_m` is the length of the last jump.
    """

    def __init__(self, settings: LocalisationSettings) -> None:
        self.readings: deque[OdometryReading] = deque(maxlen=REMEMBERED)
        self.frame = ""
        self.jumped_m = 0.0
        self._settings = settings
        self._senders: dict[bytes, float] = {}
        self._astray: OdometryReading | None = None
        self._astray_since_s = 0.0
        self._strayed_s = -math.inf

    @property
    def newest(self) -> OdometryReading | None:
        """The newest message, as far as it is believed."""
        return self.readings[-1] if self.readings else None

    def take(self, message: Odometry, arrived_s: float, sender: bytes = b"") -> bool:
        """Take in a message, and return True if odometry counts from another place from now on.

        Corrections of its frame are void then. A message older than the last is left out while that is fresh.
        `sender` stands for the node that sent it, empty where that is not known.
        """
        self._note_sender(sender, arrived_s)
        last = self.newest
        reading = self._read_message(message, arrived_s, last)
        if last is None or message.frame != self.frame:
            self.frame = message.frame
            self._begin_anew(reading)
            return False
        latest = self._astray or last
        renewed = not -BACK_S <= arrived_s - latest.arrived_s <= self._settings.fresh_s
        if not renewed and reading.stamp_s <= latest.stamp_s:
            return False
        if self._can_follow(last, reading) and self._keeps_its_speed(reading):
            self._astray = None
            if renewed:  # stamps from before mean nothing any more
                self.readings.clear()
            self.readings.append(reading)
            return False
        self.jumped_m, _ = apart(last.pose, reading.pose)
        if not renewed and not self._has_settled(reading):
            return False
        self._begin_anew(reading)
        return True

    def doubt(self, now_s: float) -> str:
        """Return why the odometry cannot be believed now, in one line; empty if it can."""
        lately = sum(abs(now_s - at_s) <= SETTLED_S for at_s in self._senders.values())
        if lately > 1:
            return f"odometry comes from {lately} senders; end all but one, or give --topic odom=TOPIC"
        if abs(now_s - self._strayed_s) <= SETTLED_S:
            return f"odometry has jumped by {self.jumped_m:.1f} m"
        return ""

    def _read_message(self, message: Odometry, arrived_s: float, last: OdometryReading | None) -> OdometryReading:
        delay_s = self._settings.delay_s
        stamp_s = message.stamp_ns / 1e9 if delay_s is None else arrived_s - delay_s
        driven_m = 0.0
        if last is not None:
            lapsed_s = min(max(0.0, arrived_s - last.arrived_s), _DRIVEN_S)
            driven_m = last.driven_m + _measure_speed(message.twist) * lapsed_s
        return OdometryReading(stamp_s, arrived_s, message.pose, message.twist, driven_m)

    def _note_sender(self, sender: bytes, arrived_s: float) -> None:
        self._senders.pop(sender, None)
        self._senders[sender] = arrived_s
        if len(self._senders) > _MOST_SENDERS:
            del self._senders[next(iter(self._senders))]

    def _begin_anew(self, reading: OdometryReading) -> None:
        self._astray, self._strayed_s = None, -math.inf
        self.readings.clear()
        self.readings.append(reading)

    def _has_settled(self, reading: OdometryReading) -> bool:
        """Return True if poses after a jump have been steady for long enough to count from now on."""
        if self._astray is None or not self._can_follow(self._astray, reading):
            self._astray_since_s = reading.arrived_s
        self._astray, self._strayed_s = reading, reading.arrived_s
        return reading.arrived_s - self._astray_since_s >= SETTLED_S

    def _keeps_its_speed(self, reading: OdometryReading) -> bool:
        """Return True if many small jumps make no large one."""
        second = [earlier for earlier in self.readings if 0.0 <= reading.arrived_s - earlier.arrived_s <= SETTLED_S]
        return not second or self._can_follow(second[0], reading)

    def _can_follow(self, before: OdometryReading, after: OdometryReading) -> bool:
        """Return True if a body that was at the one can be at the other."""
        lapsed_s = max(after.stamp_s - before.stamp_s, after.arrived_s - before.arrived_s, 0.0)
        time_s = min(lapsed_s, SETTLED_S) + self._settings.fresh_s  # messages that waited arrive together
        speed = max(self._settings.speed, min(_measure_speed(before.twist), _measure_speed(after.twist)))
        reported = min(abs(before.twist.turn_rate), abs(after.twist.turn_rate)) * time_s
        unseen = self._settings.turn_rate * max(0.0, min(lapsed_s, SETTLED_S) - USUAL_S)
        moved, turned = apart(before.pose, after.pose)
        long_ago = after.arrived_s - before.arrived_s > self._settings.fresh_s  # it may have turned all round
        return moved <= JUMP_M + speed * time_s and (
            long_ago or turned <= min(JUMP_RAD + max(reported, unseen), MOST_RAD)
        )


def _measure_speed(twist: Twist) -> float:
    return math.hypot(twist.vx, twist.vy)
