"""Steps towards a goal, straight or along an arc, and the places where a step may end.

A mind predicts one step of its own motion against the walls it knows, with the same swept-motion code by which the
world moves bodies. It never knowingly bumps into a wall.
"""

from __future__ import annotations

import math

from agent.routes.ground import Ground
from patrol.ground.swept_path import advance, free_fraction, line_is_free, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose, Velocity, wrap
from patrol.scenario import RobotSpec

EASIER = (1.0, 0.5, 0.25, 0.125)
"""Shares of a full step, tried in turn where it does not fit."""

TOUCH = 1e-6
"""Gap left between a body and the wall at which it stops, m."""

PARKING_TURNS = (0.0, 0.5, -0.5, 1.0, -1.0)
PARKING_SPEEDS = (1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.125, -0.125)
"""Shares of the tightest turn and of the full speed that a car tries while it parks."""

WORTH_IT = 0.05
"""A car that parks stays where it is unless a step brings it nearer to its place by more than this, m."""


class Footing:
    """The places where a body may stop because it gets on from there: a straight drive leads to the ground of routes.

    Without such a rule a random step may end in a pocket, in which the body is but from which no route leads.
    """

    def __init__(self, terrain: Terrain, ground: Ground, radius: float, *, wanted: bool = True) -> None:
        """Keep the body's radius (m) and the ground; if not `wanted`, a step may end anywhere."""
        self._wanted = wanted
        self._terrain = terrain
        self._ground = ground
        self._radius = radius

    def holds(self, x: float, y: float) -> bool:
        """Return True if a straight drive leads from a place to the ground, with nothing closed."""
        static = self._ground.static
        joined = static.join(x, y)
        if joined is None:
            return False
        return line_is_free(self._terrain, (x, y), static.centre(*joined), self._radius)

    def may_end(self, pose: Pose, x: float, y: float) -> bool:
        """Return True if a step may end at a place; from where the footing does not hold, any step may be taken."""
        return not self._wanted or self.holds(x, y) or not self.holds(pose.x, pose.y)


class HolonomicSteering:
    """Steering of a robot that moves in any direction at once.

    `stride` is the longest way in one step, m.
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, step: float, footing: Footing | None = None) -> None:
        """Keep where the body may stop, for `reach`; it may anywhere without `footing`."""
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self._footing = footing
        self.stride = spec.speed * step

    def reach(self, pose: Pose, target: tuple[float, float]) -> float:
        """Return the length of the longest straight step towards a target, m, whichever way the body faces.

        It is 0 where no step is possible.
        """
        _, way = self.towards(pose, target)
        bearing = math.atan2(target[1] - pose.y, target[0] - pose.x)
        for share in EASIER:
            part = share * way
            end = pose.x + part * math.cos(bearing), pose.y + part * math.sin(bearing)
            if self._footing is None or self._footing.may_end(pose, *end):
                return part
        return 0.0

    def towards(self, pose: Pose, target: tuple[float, float]) -> tuple[Velocity, float]:
        """Return a step straight towards a target, as far as the body is free, and the length of its way, m."""
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
        """Return a step at a given velocity, as far as the body is free."""
        end = (pose.x + wanted.vx * self._step, pose.y + wanted.vy * self._step)
        return self.towards(pose, end)[0]

    def heading(self, pose: Pose, bearing: float) -> tuple[Velocity, float]:
        """Return a full step in a direction (rad), as far as the body is free, and the length of its way, m."""
        target = (pose.x + self.stride * math.cos(bearing), pose.y + self.stride * math.sin(bearing))
        return self.towards(pose, target)


class CarSteering:
    """Steering of a robot that drives arcs of at least its turning radius.

    It drives forward and turns its wheels so that it faces the desired direction as soon as possible (paper,
    "nonholonomic robots"). `stride` is the longest way in one step, m.
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, step: float) -> None:
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self.stride = spec.speed * step

    def towards(self, pose: Pose, target: tuple[float, float]) -> Drive:
        """Drive forward at full speed, turning towards a target as tightly as needed and possible."""
        bearing = math.atan2(target[1] - pose.y, target[0] - pose.x)
        return self.turning(pose, bearing, self._spec.speed)

    def turning(self, pose: Pose, heading: float, speed: float) -> Drive:
        """Drive and turn until the robot faces a heading in rad, at a speed in m/s.

        The speed is negative in reverse, and never 0.
        """
        tightest = 1.0 / self._spec.turning_radius
        curvature = wrap(heading - pose.heading) / (speed * self._step)
        return Drive(speed, max(-tightest, min(tightest, curvature)))

    def park(self, pose: Pose, place: tuple[float, float]) -> Drive:
        """Return the step, forward or in reverse, that ends nearest to a place.

        Its speed is zero where no step brings the car nearer.
        """
        best, nearest_m = Drive(0.0, 0.0), math.dist((pose.x, pose.y), place) - WORTH_IT
        for speed in PARKING_SPEEDS:
            for turn in PARKING_TURNS:
                drive = Drive(speed * self._spec.speed, turn / self._spec.turning_radius)
                end = advance(pose, drive, self._step)
                left = math.dist((end.x, end.y), place)
                if left < nearest_m and self.is_free(pose, drive):
                    best, nearest_m = drive, left
        return best

    def is_free(self, pose: Pose, drive: Drive) -> bool:
        """Return True if the next step of ``drive`` touches no wall."""
        return path_is_free(self._terrain, pose, drive, self._step, self._spec.radius)
