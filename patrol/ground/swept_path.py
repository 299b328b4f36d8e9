"""The path of a body that obeys a command, and whether that path is free: wrappers of the swept-motion kernels.

The world moves bodies by these functions and a mind predicts with them, so both agree to the last bit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, assert_never

import numpy as np
from numpy.typing import NDArray

from patrol.kernels import swept_path as kernels
from patrol.pose import Command, Drive, Pose, Twist, Velocity, wrap

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain

__all__ = ["advance", "path_is_free"]


def advance(pose: Pose, command: Command, step: float) -> Pose:
    """Return the pose after one step, of `step` s, with nothing in the way.

    For example, ``advance(Pose(0.0, 0.0, 0.0), Twist(1.0, 0.0), 0.5)`` is ``Pose(0.5, 0.0, 0.0)``.

    A holonomic robot faces where it is told to, else the direction in which it moves; it keeps its heading when it
    stands. A car and a differential drive follow an exact arc; the latter may also turn on the spot.
    """
    match command:
        case Velocity(vx, vy, facing):
            # The bearing of no movement would be 0 and turn the robot.
            ahead = pose.heading if vx == 0.0 and vy == 0.0 else math.atan2(vy, vx)
            return Pose(pose.x + vx * step, pose.y + vy * step, ahead if facing is None else wrap(facing))
        case Drive(speed, curvature):
            return _arc_end(pose, speed * step, speed * step * curvature)
        case Twist(speed, turn_rate):
            return _arc_end(pose, speed * step, turn_rate * step)
        case _:
            assert_never(command)


def line_is_free(terrain: Terrain, start: tuple[float, float], end: tuple[float, float], radius: float) -> bool:
    """Return True if a body can move along a straight line; touching a wall is free."""
    return free_fraction(terrain, Pose(*start, 0.0), Pose(*end, 0.0), radius) >= 1.0


def path_is_free(terrain: Terrain, pose: Pose, command: Command, step: float, radius: float) -> bool:
    """Return True if a body, a disc, can obey a command for `step` s; touching a wall is free."""
    match command:
        case Velocity():
            return free_fraction(terrain, pose, advance(pose, command, step), radius) >= 1.0
        case Drive(speed, curvature):
            return _arc_is_free(terrain, pose, speed * step, speed * step * curvature, radius)
        case Twist(speed, turn_rate):
            # A round body that turns on the spot sweeps no ground but its own.
            return speed == 0.0 or _arc_is_free(terrain, pose, speed * step, turn_rate * step, radius)
        case _:
            assert_never(command)


def chords(command: Command, step: float) -> int:
    """Count the chords that represent the path of one step in `lay_path`."""
    match command:
        case Velocity():
            return 1
        case Drive(speed, curvature):
            return int(kernels.chord_count(speed * step, speed * step * curvature, math.inf))
        case Twist(speed, turn_rate):
            return int(kernels.chord_count(speed * step, turn_rate * step, math.inf))
        case _:
            assert_never(command)


def lay_path(path: NDArray[np.float64], pose: Pose, command: Command, step: float) -> None:
    """Fill `path` with where a body would be at equal steps of time, with chords for arcs.

    `path` is float64 (m + 1, 2), x and y in m from the beginning of the step to its end.
    """
    match command:
        case Velocity():
            end = advance(pose, command, step)
            share = np.linspace(0.0, 1.0, len(path))[:, None]
            path[:] = (pose.x, pose.y) + share * (end.x - pose.x, end.y - pose.y)
            # Exactly, for the world moves the body there and the interpolation rounds.
            path[-1] = (end.x, end.y)
        case Drive(speed, curvature):
            kernels.arc_points(path, pose.x, pose.y, pose.heading, speed * step, speed * step * curvature)
        case Twist(speed, turn_rate):
            kernels.arc_points(path, pose.x, pose.y, pose.heading, speed * step, turn_rate * step)
        case _:
            assert_never(command)


def free_fraction(terrain: Terrain, pose: Pose, target: Pose, radius: float) -> float:
    """Return the largest fraction, in [0, 1], of a straight line along which a body, a disc, stays free.

    For example, 0.75 for a disc of 0.5 m that would move from x = 1 to 3 m, to a wall at 3 m.
    """
    x, y = terrain.origin
    line = (pose.x, pose.y, target.x, target.y)
    return float(kernels.free_fraction_line(terrain.blocked, terrain.point, x, y, *line, radius))


def _arc_end(pose: Pose, distance: float, turn: float) -> Pose:
    return Pose(*kernels.arc_end(pose.x, pose.y, pose.heading, distance, turn))


def _arc_is_free(terrain: Terrain, pose: Pose, distance: float, turn: float, radius: float) -> bool:
    x, y = terrain.origin
    arguments = (terrain.blocked, terrain.point, x, y, pose.x, pose.y, pose.heading)
    return bool(kernels.free_arc(*arguments, distance, turn, radius))
