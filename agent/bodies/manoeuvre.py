"""Manoeuvres: how a car gets where no single arc leads, with three-point turns and ways out in reverse.

A car that drives towards the next bend with its nose ends up facing walls that it cannot turn away from. So a car on
its way to a place searches over the arcs that it can drive, forward and in reverse (hybrid A*), guided by the length of
the way that is left, and drives what it has found to the end. Every search brings it nearer to the place.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from agent.bodies.kernels.manoeuvre import search
from patrol.ground.swept_path import advance
from patrol.pose import Drive

if TYPE_CHECKING:
    from agent.bodies.steering import CarSteering
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import RobotSpec

LEAST_TURN = 0.25
"""Least angle that the tightest arc of a search turns by, rad; a shorter step is taken several times."""

TIGHTNESS = (0.0, 1.0, -1.0, 0.5, -0.5)
"""Curvatures of the arcs, as shares of the tightest."""

SHORT = 0.4
"""Length of the short arcs, as a share of the long ones; they fit where those do not."""

AHEAD = 5.0
"""How much nearer one search has to come, in turning radii."""

MOST_NODES = 12_000
"""Poses that one search looks at."""

MOST_ARCS = 256
"""Arcs that one search may find."""

ON_COURSE = 1e-3
"""How far a car may be from where its last arc should have brought it, m and rad."""

NEAR = 0.5
"""A car is at a place from which it is at most so many strides away."""


class Manoeuvres:
    """Arcs to be driven one after the other."""

    def __init__(self, spec: RobotSpec, terrain: Terrain, steering: CarSteering, step: float) -> None:
        """Lay out the arcs of the search.

        Args:
            spec: The car's.
            terrain: The map.
            steering: Of this car.
            step: s per tick.
        """
        self._spec = spec
        self._terrain = terrain
        self._steering = steering
        self._step = step
        stride = spec.speed * step
        self._times = max(1, math.ceil(LEAST_TURN * spec.turning_radius / stride))
        self.near = max(NEAR * stride, terrain.point)
        tightest = 1.0 / spec.turning_radius
        drives = [
            Drive(sign * share * spec.speed, bend * tightest)
            for share in (1.0, SHORT)
            for sign in (1.0, -1.0)
            for bend in TIGHTNESS
        ]
        self._drives = drives
        length = self._times * step
        self._arcs = np.array([(drive.speed * length, drive.curvature) for drive in drives])
        self._cell = max(0.5 * stride * self._times * SHORT, terrain.point)
        self._plan: deque[Drive] = deque()
        self._place: Spot | None = None
        self._expected: Pose | None = None

    def drop(self) -> None:
        """Forget what was found."""
        self._plan.clear()

    def next(self, view: View, place: Spot | None) -> Drive | None:
        """The next step towards a place.

        Args:
            view: Of this tick.
            place: x and y in m, where the car's centre may be; None for anywhere on the ground that routes run over.

        Returns:
            None where no arc brings the car nearer.
        """
        pose, expected = view.pose, self._expected
        if self._place is None or place is None:
            if self._place is not place:
                self.drop()
        elif math.dist(self._place, place) > self.near:
            self.drop()
        on_course = (
            expected is not None
            and math.dist((pose.x, pose.y), (expected.x, expected.y)) <= ON_COURSE
            and abs(math.remainder(pose.heading - expected.heading, math.tau)) <= ON_COURSE
        )
        if not on_course or not self._plan or not self._steering.is_free(pose, self._plan[0]):
            self._search(view, place)
        if not self._plan or not self._steering.is_free(pose, self._plan[0]):
            self.drop()
            return None
        drive = self._plan.popleft()
        self._expected = advance(pose, drive, self._step)
        return drive

    def _search(self, view: View, place: Spot | None) -> None:
        self.drop()
        self._place = place
        pose, terrain, start = view.pose, self._terrain, view.start
        turning = self._spec.turning_radius
        if place is None:
            left = np.where(view.ground.static.open_now, 0.0, np.inf)
            first = 2.0 * (AHEAD * turning + self.near)
        elif start is not None:
            left = view.lengths(place)
            here = view.ground.centre(*start)
            first = float(left[start[0] - 1, start[1] - 1]) + math.dist(here, (pose.x, pose.y))
        else:
            return
        if not math.isfinite(first):
            return
        found = np.zeros(MOST_ARCS, dtype=np.int64)
        count = search(
            terrain.blocked,
            self._closed(view),
            left,
            terrain.point,
            *terrain.origin,
            pose.x,
            pose.y,
            pose.heading,
            first,
            self._arcs,
            self._cell,
            self._spec.radius,
            turning,
            self.near,
            AHEAD * turning,
            MOST_NODES,
            found,
        )
        for index in found[:count]:
            self._plan.extend([self._drives[index]] * self._times)

    def _closed(self, view: View) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
        """The points that are closed at this tick; of size 0 where there are none or the car is on one of them."""
        ground = view.ground
        row, col = self._terrain.point_at(view.pose.x, view.pose.y)
        if ground.static is ground:
            return np.zeros((0, 0), dtype=np.uint8)
        closed = ground.static.open_now & ~ground.open_now
        if closed[row, col]:
            return np.zeros((0, 0), dtype=np.uint8)
        return closed.view(np.uint8)
