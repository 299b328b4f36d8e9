"""Our commands as velocities of ROS: in the body's frame, x forward and y to the left (REP 103)."""

from __future__ import annotations

import math
from typing import assert_never

from patrol.pose import Command, Drive, Twist, Velocity
from ros2.wire import messages


def velocity_of(command: Command, heading: float) -> messages.Twist:
    """Return the velocity that a command stands for, in the body's frame.

    A holonomic body's command is in the map's frame, so its heading there (rad) counts; the body keeps it.
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


def steering_of(command: Drive, wheelbase: float) -> tuple[float, float]:
    """Return the speed (m/s) and the steering angle (rad) of a car that obeys a command.

    `wheelbase` is the distance from the rear axle to the front axle, m.
    """
    return command.speed, math.atan(wheelbase * command.curvature)


def scaled(command: Command, share: float) -> Command:
    """Return the command for the same path at a share of its speed, 0 to 1."""
    match command:
        case Velocity(vx, vy):
            return Velocity(vx * share, vy * share)
        case Twist(speed, turn_rate):
            return Twist(speed * share, turn_rate * share)
        case Drive(speed, curvature):
            return Drive(speed * share, curvature)
        case _:
            assert_never(command)


def nearer(command: Command, wanted: Command, most: float, radius: float) -> Command:
    """Return the command nearest to a wanted one that a body reaches whose speed changes by a limited amount.

    `command` is what the body obeys now. A speed may change by at most `most` m/s. The wheels of a differential drive
    are `radius` (m) left and right of its centre, so turning counts with it.
    """
    match command, wanted:
        case Velocity(vx, vy), Velocity(to_x, to_y):
            change = math.hypot(to_x - vx, to_y - vy)
            share = 1.0 if change <= most else most / change
            return wanted if share == 1.0 else Velocity(vx + (to_x - vx) * share, vy + (to_y - vy) * share)
        case Twist(speed, turn_rate), Twist(to_speed, to_turn_rate):
            return Twist(_toward(speed, to_speed, most), _toward(turn_rate, to_turn_rate, most / radius))
        case Drive(speed, _), Drive(to_speed, curvature):
            return Drive(_toward(speed, to_speed, most), curvature)
        case _:
            raise TypeError(f"{command} and {wanted} are of different models")


def _toward(value: float, wanted: float, most: float) -> float:
    return min(max(wanted, value - most), value + most)
