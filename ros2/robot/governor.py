"""The next velocity of the robot, many times a tick: zero in any case of doubt.

A robot whose pose stands still under commands drives blind: its odometry may hang, or its wheels may be blocked, and
the two look the same. The mind tries other directions, as after any bump. When nothing moves the pose for `BLIND_M` and
`BLIND_S`, and for as long as weak motors take to turn the body round, the robot stands until its pose moves, or an
operator who has looked at it releases it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import assert_never

from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Limits, Pose, Twist, Velocity, halted, is_halt
from ros2.robot.fence import Fence, Other
from ros2.wire import messages
from ros2.wire.frames import apart

ENOUGH_M, ENOUGH_RAD = 0.3, 1.0
"""Commanded motion after which a robot is judged: well beyond the errors of its pose."""

ENOUGH_S = 0.5
"""For how long, s."""

MOVES_SHARE = 0.25
"""A robot moves if it has come this share of its commanded way, in any direction: weak motors coast for a while."""

BLIND_M, BLIND_S = 1.0, 1.0
"""Largest commanded way and time without any motion, m and s."""

MOVED_M, MOVED_RAD = 0.2, 0.3
"""Motion of the pose that shows that a standing robot moves again: well beyond its noise."""


def velocity_of(command: Command, heading: float) -> messages.Twist:
    """Return the velocity that a command stands for, in the body's frame.

    A holonomic body's command is in the map's frame, so its heading there (rad) counts. The body keeps it,
    wherever the command faces.

    For example, a car at 2 m/s with a curvature of 0.1 /m turns at 0.2 rad/s.
    """
    match command:
        case Velocity(vx, vy):
            cos, sin = math.cos(heading), math.sin(heading)
            return messages.Twist(cos * vx + sin * vy, cos * vy - sin * vx, 0.0)
        case Twist(speed, turn_rate):
            return messages.Twist(speed, 0.0, turn_rate)
        case Drive(speed, curvature):
            return messages.Twist(speed, 0.0, speed * curvature)
        case _:
            assert_never(command)


class Response:
    """Judges one robot (`ros2.robot.driver.Objection`).

    `radius` (m) is that of the body, which is the way that a turn by 1 rad counts for. `slow_s` is the time that its
    motors take from its top speed to a stand.
    """

    def __init__(self, radius: float, slow_s: float) -> None:
        self.why = ""
        self._radius = radius
        self._blind_for_s = BLIND_S + 2.0 * MOVES_SHARE * slow_s  # a body that turns round is slow for so long
        self._begin: Pose | None = None
        self._meant: Pose | None = None
        self._turn = 0.0
        self._lasted_s = 0.0
        self._blind_m = 0.0
        self._blind_s = 0.0

    def told(self, command: Command, pose: Pose | None, time_s: float) -> None:
        """Take in the command of the last `time_s`, and the robot's pose now; None if that is unknown."""
        if pose is None or self._begin is None or self._meant is None:
            self._start_trial(pose)
            return
        if self.why:
            moved_m, turned = apart(self._begin, pose)
            if moved_m >= MOVED_M or turned >= MOVED_RAD:
                self.release()
            return
        # Where the robot would be if it did as it was told.
        self._meant = advance(self._meant, command, time_s)
        self._turn += velocity_of(command, pose.heading).turn_rate * time_s
        self._lasted_s += time_s
        way, _ = apart(self._begin, self._meant)
        if self._lasted_s < ENOUGH_S or (way < ENOUGH_M and abs(self._turn) < ENOUGH_RAD):
            return
        # Any motion clears all that was blind before: the robot responds.
        if self._has_moved(self._begin, way, pose):
            self._blind_m = self._blind_s = 0.0
        else:
            self._blind_m += way + self._radius * abs(self._turn)
            self._blind_s += self._lasted_s
        if self._blind_m >= BLIND_M and self._blind_s >= self._blind_for_s:
            self.why = (
                f"its pose stays where it is, though it was told to go {self._blind_m:.1f} m: its odometry hangs, "
                "or its wheels are blocked (look at it; then fogwatch control ... release, or move it)"
            )
        self._start_trial(pose)

    def release(self) -> None:
        """Judge the robot anew: an operator has looked at it, or it moves."""
        self.why = ""
        self._blind_m = self._blind_s = 0.0
        self._start_trial(None)

    def _start_trial(self, pose: Pose | None) -> None:
        self._begin = self._meant = pose
        self._turn = self._lasted_s = 0.0

    def _has_moved(self, begin: Pose, way: float, pose: Pose) -> bool:
        moved_m, turned = apart(begin, pose)
        return (way >= ENOUGH_M and moved_m >= MOVES_SHARE * way) or (
            abs(self._turn) >= ENOUGH_RAD and turned >= MOVES_SHARE * ENOUGH_RAD
        )


OFF_GROUND = (
    "it is off the map's ground: in a wall, in a keep-out area or beyond the map; move it, or correct its localisation"
)
TOO_NEAR = "a wall or a robot is too near"


def nearer(command: Command, wanted: Command, most: float, radius: float) -> Command:
    """Return the command nearest to a wanted one that a body reaches whose speed changes by a limited amount.

    `command` is what the body obeys now. A speed may change by at most `most` m/s. The wheels of a differential drive
    are `radius` (m) left and right of its centre, so turning counts with it.

    For example, from 0 to 1 m/s with at most 0.3 m/s of change it is a command of 0.3 m/s.
    """
    match command, wanted:
        case Velocity(vx, vy), Velocity(to_x, to_y):
            change = math.hypot(to_x - vx, to_y - vy)
            share = 1.0 if change <= most else most / change
            return wanted if share == 1.0 else Velocity(vx + (to_x - vx) * share, vy + (to_y - vy) * share)
        case Twist(speed, turn_rate), Twist(to_speed, to_turn_rate):
            return Twist(_step_toward(speed, to_speed, most), _step_toward(turn_rate, to_turn_rate, most / radius))
        case Drive(speed, _), Drive(to_speed, curvature):
            return Drive(_step_toward(speed, to_speed, most), curvature)
        case _:
            raise TypeError(f"{command} and {wanted} are of different models")


def _step_toward(value: float, wanted: float, most: float) -> float:
    return min(max(wanted, value - most), value + most)


class Governor:
    """Obeys a mind's commands within limits, and only as long as it is safe.

    `command` is what the robot was told last. `why` is the reason why that was not what the mind wants, empty if it
    was; `fenced` is True if the fence slowed the robot down.
    """

    def __init__(self, model: str, limits: Limits, acceleration: float, hold_s: float, fence: Fence) -> None:
        """Begin with a halt; speeds change by at most `acceleration` (m/s²), and a command is obeyed for `hold_s`."""
        self._limits = limits
        self._acceleration = acceleration
        self._hold_s = hold_s
        self._fence = fence
        self._halt = halted(model)
        self._wanted = self._halt
        self._until_s = 0.0
        self.command: Command = self._halt
        self.why = ""
        self.fenced = False

    def want(self, command: Command, now_s: float) -> None:
        """Take in a new command of the mind, which is obeyed for a while."""
        self._wanted = command.limited(self._limits)
        self._until_s = now_s + self._hold_s

    def step(
        self, pose: Pose | None, now_s: float, since_s: float, stopped: str, others: Sequence[Other] = ()
    ) -> Command:
        """Return the velocity to send now.

        The robot stands while its pose is None, which means unknown, or while `stopped` gives a reason.
        """
        self.why = stopped or ("nobody knows where it is" if pose is None else "")
        self.fenced = False
        if self.why or pose is None:
            self.command = self._halt
            return self.command
        # A mind that hangs sends nothing, and its last command must not go on for ever.
        wanted = self._wanted if now_s < self._until_s else self._halt
        eased = nearer(self.command, wanted, self._acceleration * since_s, self._limits.radius)
        # The fence comes last: it may brake harder than the limit of acceleration.
        self.command = self._fence.allowed(pose, eased.limited(self._limits), others)
        self.fenced = self.command.speed_mps < eased.speed_mps
        if not self._fence.on_ground(pose):
            self.why = OFF_GROUND
        elif self.fenced:
            self.why = TOO_NEAR
        elif is_halt(wanted) and now_s >= self._until_s:
            self.why = "no command has come"
        return self.command
