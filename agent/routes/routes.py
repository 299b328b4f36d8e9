"""Routes: lengths and first bends of the shortest ways over the ground as it is now."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import FAR
from agent.routes.ground import BoxPaths, Ground, Spot
from agent.routes.path_window import DIAGONAL, Place
from agent.routes.wave import LONGEST, box_between, paths_in

STRAIGHT_OVER = 2**16
"""Points between two places among which a closed one is looked for before a wave."""

SLACK = 8
"""A way is looked for first within a limit longer by one part in so many than the way without obstacles."""

Element = tuple[int, int]
"""Row and column in `Ground.state`: one more than those of the terrain's point."""


@dataclass(frozen=True, slots=True)
class Way:
    """The shortest way to a place."""

    place: Spot  # x and y in m: the target's centre, or that of the nearest reachable point
    bend: Spot  # the first bend, x and y in m; `place` where the way is straight
    length: float  # m


def unhindered(one: Element, other: Element) -> int:
    """Return the length of the way between two elements if nothing is in between, in hundredths of a point."""
    up, across = abs(one[0] - other[0]), abs(one[1] - other[1])
    return 100 * max(up, across) + (DIAGONAL - 100) * min(up, across)


def _nearest_in(paths: BoxPaths, point: Place) -> Place:
    """Return the point of the terrain nearest to another one to which a path leads."""
    rows, cols = np.nonzero(paths.length < FAR)
    rows, cols = rows + paths.row0, cols + paths.col0
    nearest = int(np.argmin((rows - point[0]) ** 2 + (cols - point[1]) ** 2))
    return int(rows[nearest]), int(cols[nearest])


class Routes:
    """Shortest ways over one robot's ground, computed on demand.

    A way runs from point to neighbouring point (8 neighbours; a straight step counts 1, a diagonal one 1.41 points) and
    cuts no corner (paper, "The wave").
    """

    def __init__(self, ground: Ground) -> None:
        """Compute nothing yet."""
        self._ground = ground

    def lengths(self, place: Spot, within: float | None = None) -> NDArray[np.float64]:
        """Return the lengths of the ways from a place (x, y) to all points, float64 (h, w) in m.

        They are infinite where no way leads, or only one longer than `within` (m; None for no limit). A place that is
        closed at this tick starts from the ground with nothing closed, since robots do stand there.
        """
        terrain = self._ground.terrain
        if not all(map(math.isfinite, place)) or (within is not None and not within >= 0.0):
            raise ValueError(f"lengths from {place} within {within}: give a place in m, and a limit of 0 m or more")
        far = np.full(terrain.shape, np.inf)
        ground = self._ground
        start = ground.join(*place)
        if start is None:
            ground = ground.static
            start = ground.join(*place)
        if start is None:
            return far
        limit = LONGEST if within is None else round(min(LONGEST, 100.0 * within / terrain.point))
        box = 0, terrain.height, 0, terrain.width
        lengths = paths_in(ground, [(start[0] - 1, start[1] - 1)], box, limit).length[1:-1, 1:-1]
        np.copyto(far, lengths * (terrain.point / 100.0), where=lengths < FAR)
        return far

    def way(self, start: Element, target: Element, expected: int | None = None) -> Way:
        """Return the way from an open element of the ground to another one, or to the nearest reachable place.

        `expected` is a likely upper bound of the way's length, in hundredths of a point. The search goes beyond it only
        if needed.
        """
        way = self.way_within(start, target, LONGEST, expected)
        if way is None:
            height, width = self._ground.terrain.shape
            paths = paths_in(self._ground, [(start[0] - 1, start[1] - 1)], (0, height, 0, width), LONGEST)
            row, col = _nearest_in(paths, (target[0] - 1, target[1] - 1))
            way = self.way_within(start, (row + 1, col + 1), LONGEST)
        assert way is not None, "a point that a path has reached"
        return way

    def way_within(self, start: Element, target: Element, limit: int, expected: int | None = None) -> Way | None:
        """Return the way from an open element of the ground to another one; None where none is as short as a limit.

        `limit` and `expected` are in hundredths of a point; `expected` is a likely upper bound of the way's length.
        """
        ground, direct, limit = self._ground, unhindered(start, target), min(limit, LONGEST)
        if direct > limit:
            return None
        if start == target or self._is_straight(start, target):
            spot = ground.centre(*target)
            return Way(spot, spot, float(direct) * ground.terrain.point / 100.0)
        here, goal, shape = (start[0] - 1, start[1] - 1), (target[0] - 1, target[1] - 1), ground.terrain.shape
        if not ground.terrain.inside(*goal) or not ground.open_now[goal]:
            return None
        # Most ways are shorter than a walk along two sides of the terrain; the others are looked for without a limit.
        long = 100 * sum(shape)
        reach = max(expected or 0, direct + direct // SLACK)
        while True:
            reach = min(limit, reach if reach < long else LONGEST)
            box = box_between(here, goal, reach // 100 + 1, shape)
            paths = paths_in(ground, [here], box, reach, bends=True, goal=goal)
            if paths.length_to(*goal) < FAR:
                return self._way_in(paths, *goal)
            if reach == limit:
                return None
            reach += reach // 2

    def _is_straight(self, start: Element, target: Element) -> bool:
        """Return True if nothing is closed between two elements, and the one is in sight of the other.

        Then no way is shorter than theirs, and it does not bend. No look reaches farther than the terrain is long.
        Where much lies between them, something is closed nearly always, and is not looked for.
        """
        (row, col), (to_row, to_col) = start, target
        if math.dist(start, target) > max(self._ground.terrain.shape):
            return False
        if (abs(to_row - row) + 1) * (abs(to_col - col) + 1) > STRAIGHT_OVER:
            return False
        rows, cols = slice(min(row, to_row), max(row, to_row) + 1), slice(min(col, to_col), max(col, to_col) + 1)
        return bool(self._ground.state[rows, cols].all())

    def _way_in(self, paths: BoxPaths, row: int, col: int) -> Way:
        """Return the way to a point of the terrain that a path leads to."""
        up, across = row - paths.row0, col - paths.col0
        bend_row, bend_col = divmod(int(paths.bend[up, across]), paths.bend.shape[1])
        terrain = self._ground.terrain
        bend = terrain.centre(bend_row + paths.row0, bend_col + paths.col0)
        return Way(terrain.centre(row, col), bend, float(paths.length[up, across]) * terrain.point / 100.0)
