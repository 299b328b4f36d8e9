"""Straight steps towards a goal, and where a step may end.

A mind predicts one step of its own motion against the walls it knows, with the same swept-motion code by which the
world moves bodies. It never knowingly bumps into a wall.
"""

from __future__ import annotations

import math

from agent.routes.ground import Ground
from patrol.ground.swept_path import free_fraction, line_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Velocity
from patrol.scenario import RobotSpec

EASIER = (1.0, 0.5, 0.25, 0.125)
"""Shares of a full step, tried in turn where it does not fit."""

TOUCH = 1e-6
"""Gap left between a body and the wall at which it stops, m."""


class Footing:
    """The places where a body may stop because it gets on from there: a straight drive leads to the ground of routes.

    Without such a rule a random step may end in a pocket, in which the body is but from which no route leads.
    """

    def __init__(self, terrain: Terrain, ground: Ground, radius: float, *, wanted: bool = True) -> None:
        """Compute nothing yet.

        Args:
            terrain: The map.
            ground: Where the robot's centre may be.
            radius: Of the body, m.
            wanted: Whether there is such a rule; otherwise a step may end anywhere.
        """
        self._wanted = wanted
        self._terrain = terrain
        self._ground = ground
        self._radius = radius

    def holds(self, x: float, y: float) -> bool:
        """Return True if a straight drive leads from a place to the ground, with nothing closed.

        Args:
            x: m.
            y: m.
        """
        static = self._ground.static
        joined = static.join(x, y)
        if joined is None:
            return False
        return line_is_free(self._terrain, (x, y), static.centre(*joined), self._radius)

    def may_end(self, pose: Pose, x: float, y: float) -> bool:
        """Return True if a step may end at a place; from where the footing does not hold, any step may be taken.

        Args:
            pose: The robot's own.
            x: m.
            y: m.
        """
        return not self._wanted or self.holds(x, y) or not self.holds(pose.x, pose.y)


class HolonomicSteering:
    """Steering of a robot that moves in any direction at once.

    Attributes:
        stride: Longest way in one step, m.
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, step: float) -> None:
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self.stride = spec.speed * step

    def towards(self, pose: Pose, target: tuple[float, float]) -> tuple[Velocity, float]:
        """Return a step straight towards a target, as far as the body is free.

        Args:
            pose: The robot's own.
            target: x and y in m.

        Returns:
            The command, and the length of its way in m.
        """
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
        """Return a step at a given velocity, as far as the body is free.

        Args:
            pose: The robot's own.
            wanted: The velocity, within the robot's limits.
        """
        end = (pose.x + wanted.vx * self._step, pose.y + wanted.vy * self._step)
        return self.towards(pose, end)[0]

    def heading(self, pose: Pose, bearing: float) -> tuple[Velocity, float]:
        """Return a full step in a direction, as far as the body is free.

        Args:
            pose: The robot's own.
            bearing: The direction, rad.

        Returns:
            The command, and the length of its way in m.
        """
        target = (pose.x + self.stride * math.cos(bearing), pose.y + self.stride * math.sin(bearing))
        return self.towards(pose, target)
