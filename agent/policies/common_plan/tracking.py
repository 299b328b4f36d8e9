"""Keeping to the plan: a robot obeys the plan's command, corrected by how far it is off the planned pose."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.pose import Drive, Pose, Twist, Velocity

if TYPE_CHECKING:
    from patrol.pose import Command
    from patrol.scenario import RobotSpec

ALONG, ACROSS, ASKEW = 0.5, 0.4, 0.8
"""Shares of an error that one step makes up for: along the way; beside it, as a turn in rad for each stride that the
body is off, at top speed; and of the heading."""

EXACT = 1e-9
"""An error below this is rounding, m or rad: the body does as planned."""

SLOWEST = 0.05
"""Least share of the top speed at which a car steers: slower, curvatures mean little."""


def keep_to(pose: Pose, planned: Pose, command: Command, spec: RobotSpec, step: float) -> Command:
    """Return what a body does to follow a planned one that obeys a command.

    It may be beyond the body's limits. For example, a holonomic body that is 0.1 m behind a planned one, which drives
    at 0.5 m/s in steps of 0.5 s, drives at 0.7 m/s.
    """
    across, up = pose.x - planned.x, pose.y - planned.y
    if isinstance(command, Velocity):
        return Velocity(command.vx - across / step, command.vy - up / step, command.facing)
    cos, sin = math.cos(planned.heading), math.sin(planned.heading)
    along, left = across * cos + up * sin, up * cos - across * sin
    askew = math.remainder(pose.heading - planned.heading, math.tau)
    if max(abs(along), abs(left), abs(askew)) < EXACT:
        return command
    stride = spec.speed * step
    speed = command.speed - (ALONG * along / step if command.speed != 0.0 else 0.0)
    speed = min(max(speed, -spec.speed), spec.speed)
    rate = command.turn_rate if isinstance(command, Twist) else command.speed * command.curvature
    turn = rate * step - ACROSS * left / stride * (command.speed * step / stride) - ASKEW * askew
    if isinstance(command, Twist):
        return Twist(speed, turn / step)
    if abs(speed) < SLOWEST * spec.speed:
        return command
    return Drive(speed, turn / (speed * step))
