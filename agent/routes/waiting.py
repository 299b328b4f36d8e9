"""Places where a robot can stand for long: others get past it.

A robot does not wait in front of a door, where it shuts the room, but beside the way, where the ground around it stays
in one piece for the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.clearance import label_parts

if TYPE_CHECKING:
    from agent.routes.ground import Spot
    from patrol.ground.terrain import Terrain

KEEP_RADII = 3.5
"""Distance between a standing robot and the way of one that gets past it without slowing down, in radii."""

AROUND = 3.0
"""Distance up to which others have to get past a standing robot, in distances that they keep from it."""

CORNER = 0.25
"""More than a disc cuts off in a right-angled corner, in squares of its radius: 1 - pi / 4."""


def parts_around(
    is_open: NDArray[np.bool_], place: tuple[int, int], wide: float, half: int, standing: Iterable[tuple[int, int]] = ()
) -> NDArray[np.int64]:
    """Return the sizes of the parts into which a disc on a point parts the ground around it.

    Only ground within `half` points (rows and columns) that hangs together with the point counts. The disc, and those
    of others at `standing`, take the points nearer than `wide` points. Nothing is left where one of these takes it.
    """
    (row, col), top, left = place, max(place[0] - half, 0), max(place[1] - half, 0)
    ground = is_open[top : row + half + 1, left : col + half + 1].copy()
    rows, cols = np.ogrid[top : top + ground.shape[0], left : left + ground.shape[1]]
    labels, work = np.empty(ground.shape, dtype=np.int32), np.empty(ground.size, dtype=np.int32)
    for neighbour in standing:
        ground &= (rows - neighbour[0]) ** 2 + (cols - neighbour[1]) ** 2 >= wide**2
    label_parts(ground.view(np.uint8), labels, work)
    own_part = ground & (labels == labels[row - top, col - left])
    own_part &= (rows - row) ** 2 + (cols - col) ** 2 >= wide**2
    label_parts(own_part.view(np.uint8), labels, work)
    return np.bincount(labels[own_part])[1:]


class Waiting:
    """Tells where a robot of a fleet can wait.

    All others are taken to have its body.
    """

    def __init__(self, terrain: Terrain, reach: NDArray[np.bool_], radius: float) -> None:
        """Look at the ground without anything in the way; `reach` marks where the robot's centre may be."""
        self._terrain = terrain
        self._reach = reach
        self._keep = KEEP_RADII * radius / terrain.point
        self._stride = max(1, int(radius / terrain.point))

    def lets_others_pass(self, spot: Spot, standing: Iterable[Spot]) -> bool:
        """Return True if the ground around a robot stays in one piece for the centres of others.

        The part cut off counts only if it is larger than the rest that a disc leaves in a corner.
        """
        point, points = self._terrain.point_at(*spot), [self._terrain.point_at(*neighbour) for neighbour in standing]
        wide = math.nextafter(self._keep, math.inf)  # a point just as far away is taken as well
        if not self._reach[point] or any(math.dist(neighbour, point) < wide for neighbour in points):
            return False
        sizes = parts_around(self._reach, point, wide, math.ceil(AROUND * self._keep), points)
        return int((sizes > CORNER * self._keep**2).sum()) <= 1

    def nearest(self, ways: NDArray[np.float32], among: NDArray[np.bool_], standing: Iterable[Spot]) -> Spot | None:
        """Return the nearest place that lets others pass, x and y in m, or None.

        It is the nearest by `ways`, the lengths of the ways (m) to where the robot wants to be. Of the points in
        `among`, those about a body's radius apart are looked at.
        """
        rows, cols = np.nonzero(among)
        some = (rows % self._stride == 0) & (cols % self._stride == 0)
        rows, cols = (rows[some], cols[some]) if some.any() else (rows, cols)
        neighbours = tuple(standing)
        for index in np.argsort(ways[rows, cols], kind="stable"):
            spot = self._terrain.centre(int(rows[index]), int(cols[index]))
            if self.lets_others_pass(spot, neighbours):
                return spot
        return None
