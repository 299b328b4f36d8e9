"""From a goal to a command, for both kinds of robots.

A mind predicts one step of its own motion against the walls it knows, with the same swept-motion code that the world
moves bodies by; it never bumps into a wall knowingly.
"""

from __future__ import annotations

import math

from patrol.ground.swept_path import advance, free_fraction, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose, Velocity, wrap
from patrol.scenario import RobotSpec

PARKING_TURNS = (0.0, 0.5, -0.5, 1.0, -1.0)
PARKING_SPEEDS = (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.125, -0.125)
"""Shares of the tightest turn and of the full speed that a parking car tries."""

WORTH_IT = 0.05
"""A parking car that can come nearer to its place by no more than this in a step stays where it is, m."""

TOUCH = 1e-6
"""Left between a body and the wall it stops at, m."""


class HolonomicSteering:
    """A robot that moves in any direction at once."""

    def __init__(self, spec: RobotSpec, terrain: Terrain, step: float) -> None:
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self.stride = spec.speed * step

    def towards(self, pose: Pose, target: tuple[float, float]) -> tuple[Velocity, float]:
        """Straight towards ``target`` (m) as far as the body is free; the command, and the way it makes in m."""
        across, up = target[0] - pose.x, target[1] - pose.y
        distance = math.hypot(across, up)
        if distance == 0.0:
            return Velocity(0.0, 0.0), 0.0
        way = min(self.stride, distance)
        across, up = across / distance, up / distance
        end = Pose(pose.x + way * across, pose.y + way * up, pose.heading)
        share = free_fraction(self._terrain, pose, end, self._spec.radius)
        if share < 1.0:
            way = max(0.0, way * share - TOUCH)
        return Velocity(way * across / self._step, way * up / self._step), way

    def along(self, pose: Pose, wanted: Velocity) -> Velocity:
        """As much of a step at this velocity as the body is free for."""
        end = (pose.x + wanted.vx * self._step, pose.y + wanted.vy * self._step)
        return self.towards(pose, end)[0]

    def heading(self, pose: Pose, bearing: float) -> tuple[Velocity, float]:
        """A full step in direction ``bearing`` (rad), as far as the body is free."""
        target = (pose.x + self.stride * math.cos(bearing), pose.y + self.stride * math.sin(bearing))
        return self.towards(pose, target)


class CarSteering:
    """A robot that drives arcs of at least its turning radius.

    It turns its wheels and drives forward so that it is oriented as it should be as soon as possible (paper,
    "nonholonomic robots").
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, step: float) -> None:
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self.stride = spec.speed * step

    def towards(self, pose: Pose, target: tuple[float, float]) -> Drive:
        """Forward at full speed, turning towards ``target`` (m) as tightly as needed and possible."""
        bearing = math.atan2(target[1] - pose.y, target[0] - pose.x)
        return self.turning(pose, bearing, self._spec.speed)

    def turning(self, pose: Pose, heading: float, speed: float) -> Drive:
        """Drive at ``speed`` (m/s, negative: reverse), turning so that the robot comes to face ``heading`` (rad)."""
        tightest = 1.0 / self._spec.turning_radius
        curvature = wrap(heading - pose.heading) / (speed * self._step)
        return Drive(speed, max(-tightest, min(tightest, curvature)))

    def park(self, pose: Pose, place: tuple[float, float]) -> Drive:
        """The step, forward or back, that ends nearest to ``place`` (m); none where no step brings the car nearer."""
        best, least = Drive(0.0, 0.0), math.dist((pose.x, pose.y), place) - WORTH_IT
        for speed in PARKING_SPEEDS:
            for turn in PARKING_TURNS:
                drive = Drive(speed * self._spec.speed, turn / self._spec.turning_radius)
                end = advance(pose, drive, self._step)
                left = math.dist((end.x, end.y), place)
                if left < least and self.is_free(pose, drive):
                    best, least = drive, left
        return best

    def is_free(self, pose: Pose, drive: Drive) -> bool:
        """Whether the next step of ``drive`` touches no wall."""
        return path_is_free(self._terrain, pose, drive, self._step, self._spec.radius)
