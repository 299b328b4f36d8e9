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

from patrol.kernels.components import label_parts

if TYPE_CHECKING:
    from agent.routes.ground import Spot
    from patrol.ground.terrain import Terrain

KEEP_RADII = 3.5
"""Distance between a standing robot and the way of one that gets past it without slowing down, in radii."""

AROUND = 3.0
"""Distance up to which others have to get past a standing robot, in distances that they keep from it."""

CORNER = 0.25
"""More than a disc cuts off in a right-angled corner, in squares of its radius: 1 - pi / 4."""


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

        What it cuts off counts only if it is larger than what a disc leaves in a corner.
        """
        row, col = self._terrain.point_at(*spot)
        half = math.ceil(AROUND * self._keep)
        top, left = max(0, row - half), max(0, col - half)
        before = self._reach[top : row + half + 1, left : col + half + 1].astype(np.uint8)
        for neighbour in standing:
            cell = self._terrain.point_at(*neighbour)
            if math.dist(cell, (row, col)) <= self._keep:
                return False
            self._take(before, cell[0] - top, cell[1] - left)
        if not before[row - top, col - left]:
            return False
        after = before.copy()
        self._take(after, row - top, col - left)
        parts, work = np.empty(before.shape, dtype=np.int32), np.empty(before.size, dtype=np.int32)
        label_parts(before, parts, work)
        here = parts == parts[row - top, col - left]
        label_parts(after, parts, work)
        sizes = np.bincount(parts[here & (after != 0)], minlength=1)
        return int((sizes > CORNER * self._keep**2).sum()) <= 1

    def _take(self, ground: NDArray[np.uint8], row: int, col: int) -> None:
        """Take the points off the ground on which no centre can be because of a robot on a point."""
        rows, cols = np.ogrid[: ground.shape[0], : ground.shape[1]]
        ground[(rows - row) ** 2 + (cols - col) ** 2 <= self._keep**2] = 0

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
