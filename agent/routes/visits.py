"""A robot's visits to one-way zones: the part of a zone that lies behind it, and whether it can still get out ahead.

Ways lead against no zone, but bodies do not only follow ways: they take turns in several moves, back off from each
other, and take random steps. So a robot in a zone may go back to where it came in, and a body's width farther. A step
that would end beyond that is not taken.

    zone of 0 degrees    +--------------------------+
                         |  behind :  ^ came in     |    The robot came in by a side door. It may not drive onto what
                         |         :  |    o >      |    lies behind.
                         +-------------  -----------+

Where everything ahead is closed, for example by a robot that has died, ways may lead back out of the zone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from agent.routes.path_window import FAR
from agent.routes.wave import LONGEST, paths_in
from patrol.ground.swept_path import advance
from patrol.ground.terrain import ALL_WAYS
from patrol.ground.ways import unit
from patrol.zones.ground import points_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.routes.ground import Ground
    from patrol.pose import Command, Pose
    from patrol.zones.ground import Zone


@dataclass(frozen=True, slots=True)
class _OneWay:
    """A one-way zone."""

    points: NDArray[np.bool_]  # (h, w)
    towards: tuple[float, float]  # x and y of its direction, of length 1
    inside: NDArray[np.int64]  # flat indices of its points
    along: NDArray[np.float64]  # how far along the direction the centres of these lie, m

    def place(self, x: float, y: float) -> float:
        """Return how far along the direction a place lies, m."""
        return x * self.towards[0] + y * self.towards[1]


class Visits:
    """One robot's visits to the one-way zones of its ground."""

    def __init__(self, zones: Iterable[Zone], ground: Ground, radius: float, step: float) -> None:
        """Begin outside of all zones."""
        self._ground = ground
        self._back_m = 2.0 * radius
        self._step = step
        self._zones: list[_OneWay] = []
        terrain = ground.terrain
        for zone in zones:
            if zone.one_way is not None:
                points, (across, up) = points_of(zone, terrain), unit(zone.one_way)
                rows, cols = np.nonzero(points)
                xs, ys = (
                    terrain.origin[0] + (cols + 0.5) * terrain.point,
                    terrain.origin[1] + (rows + 0.5) * terrain.point,
                )
                inside = np.flatnonzero(points)
                self._zones.append(_OneWay(points, (across, up), inside, xs * across + ys * up))
        self._came_in: dict[int, float] = {}

    def note(self, x: float, y: float) -> None:
        """Take note of where the robot is, and bring its ground up to date; call it once a tick."""
        if not self._zones:
            return
        before = self._came_in
        self._came_in = {
            number: before.get(number, zone.place(x, y))
            for number, zone in enumerate(self._zones)
            if self._contains_spot(zone, x, y)
        }
        if self._came_in != before:
            self._ground.behind = self._find_behind()
        self._ground.against = self._ground.terrain.against
        if self._came_in and self._ground.static is not self._ground and self._is_shut_in(x, y):
            self._ground.against = ALL_WAYS

    def allow(self, pose: Pose, command: Command) -> bool:
        """Return True unless a step would end behind in a zone, and farther back than it begins."""
        if not self._came_in:
            return True
        end = advance(pose, command, self._step)
        for number, came_in in self._came_in.items():
            zone = self._zones[number]
            limit_m = min(came_in - self._back_m, zone.place(pose.x, pose.y))
            if self._contains_spot(zone, end.x, end.y) and zone.place(end.x, end.y) < limit_m:
                return False
        return True

    def _contains_spot(self, zone: _OneWay, x: float, y: float) -> bool:
        row, col = self._ground.terrain.point_at(x, y)
        return self._ground.terrain.inside(row, col) and bool(zone.points[row, col])

    def _find_behind(self) -> NDArray[np.bool_] | None:
        """Return the points of the zones that the robot is in that lie behind it; None for none."""
        if not self._came_in:
            return None
        behind = np.zeros(self._ground.terrain.shape, dtype=np.bool_)
        for number, came_in in self._came_in.items():
            zone = self._zones[number]
            behind.reshape(-1)[zone.inside[zone.along < came_in - self._back_m]] = True
        return behind

    def _is_shut_in(self, x: float, y: float) -> bool:
        """Return True if no way leads out of the zones that the robot is in, over the ground as it is now."""
        ground = self._ground
        start = ground.join(x, y)
        if start is None:
            return False
        box = 0, ground.terrain.height, 0, ground.terrain.width
        reached = paths_in(ground, [(start[0] - 1, start[1] - 1)], box, LONGEST).length[1:-1, 1:-1] < FAR
        inside = np.logical_or.reduce([self._zones[number].points for number in self._came_in])
        return not (reached & ~inside).any()
