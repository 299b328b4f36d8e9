"""A simple Nav2 of a simulated robot: it finds a way to a goal on the map, and drives it."""

from __future__ import annotations

import math
from collections import deque

from patrol.ground.cspace import cspace_of
from patrol.ground.fields import anchor
from patrol.ground.swept_path import line_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.scenario import RobotSpec
from ros2.wire.frames import composed, inverted
from ros2.wire.messages import Twist

Point = tuple[int, int]

THERE_M = 0.2
"""Distance at which a goal is reached, m."""
FACING_RAD = 0.3
"""A robot that must turn farther than this towards where it drives turns on the spot."""
TURNS_PER_S = 2.0
"""The turn rate per angle that is left to turn, 1/s."""

_SIDES = ((0, 1), (1, 0), (0, -1), (-1, 0))


class Navigator:
    """Drives to goals."""

    def __init__(self, terrain: Terrain, spec: RobotSpec) -> None:
        self._terrain = terrain
        self._spec = spec
        self._cspace = cspace_of(terrain, spec.radius)
        self._goal: Pose | None = None
        self._way: list[tuple[float, float]] = []

    def velocity(self, pose: Pose, goal: Pose) -> Twist | None:
        """Return the velocity towards a goal, in the body's frame; None where there is no way."""
        if goal != self._goal:
            self._goal, self._way = goal, self._find_way(pose, goal)
        # Shortcuts: what is in reach of a straight line needs no points in between.
        while len(self._way) > 1 and self._is_free(pose, self._way[1]):
            del self._way[0]
        if not self._way:
            return None
        ahead = composed(inverted(pose), Pose(*self._way[0], 0.0))
        distance, bearing = math.hypot(ahead.x, ahead.y), math.atan2(ahead.y, ahead.x)
        # Slower near the place, or it would drive past.
        speed = min(0.5 * self._spec.speed, distance)
        if self._spec.model == "holonomic":
            return Twist(speed * math.cos(bearing), speed * math.sin(bearing), 0.0)
        return Twist(0.0 if abs(bearing) > FACING_RAD else speed, 0.0, TURNS_PER_S * bearing)

    def _is_free(self, pose: Pose, place: tuple[float, float]) -> bool:
        return line_is_free(self._terrain, (pose.x, pose.y), place, self._spec.radius)

    def _find_way(self, pose: Pose, goal: Pose) -> list[tuple[float, float]]:
        """Places on a way from point to point, the goal last; none where there is no way."""
        first = anchor(self._terrain, self._cspace, pose.x, pose.y)
        last = anchor(self._terrain, self._cspace, goal.x, goal.y)
        if first is None or last is None:
            return []
        # From the goal, so that each point knows the next one on its way there.
        towards: dict[Point, Point] = {last: last}
        waiting = deque([last])
        while waiting and first not in towards:
            row, col = waiting.popleft()
            for up, across in _SIDES:
                beside = (row + up, col + across)
                if beside not in towards and self._terrain.inside(*beside) and self._cspace[beside]:
                    towards[beside] = (row, col)
                    waiting.append(beside)
        if first not in towards:
            return []
        way, cell = [first], first
        while cell != last:
            cell = towards[cell]
            way.append(cell)
        return [self._terrain.centre(*point) for point in way]
