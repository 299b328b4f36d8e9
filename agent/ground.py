"""The ground as one robot's planning sees it: where its centre may be, and what is in the way just now."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import HEMMED, OPEN
from patrol.fields import anchor
from patrol.terrain import Terrain

Disc = tuple[float, float, float]
"""x, y and radius in m."""


class Ground:
    """The reachable points of a robot, framed by one blocked point on every side, in the wave's encoding.

    state: uint8 (h + 2, w + 2); element (row + 1, col + 1) belongs to the terrain's point (row, col). The two low bits
    are OPEN or BLOCKED; HEMMED is set beside a blocked point.
    """

    def __init__(self, terrain: Terrain, reach: NDArray[np.bool_]) -> None:
        self.terrain = terrain
        self._reach = reach
        self._is_open = reach
        self.state = _encode(reach)
        self._discs: tuple[Disc, ...] = ()

    def obstruct(self, discs: Sequence[Disc]) -> None:
        """Block the points whose centres lie within these discs, and no others besides the terrain's own."""
        if tuple(discs) == self._discs:
            return
        self._discs = tuple(discs)
        is_open = self._reach.copy()
        point = self.terrain.point
        ox, oy = self.terrain.origin
        for x, y, radius in discs:
            row, col = (y - oy) / point, (x - ox) / point
            half = math.ceil(radius / point) + 1
            top, left = max(0, math.floor(row) - half), max(0, math.floor(col) - half)
            box = is_open[top : math.floor(row) + half + 1, left : math.floor(col) + half + 1]
            up = np.arange(top, top + box.shape[0]) + 0.5 - row
            across = np.arange(left, left + box.shape[1]) + 0.5 - col
            box &= up[:, None] ** 2 + across[None, :] ** 2 >= (radius / point) ** 2
        self._is_open = is_open
        self.state = _encode(is_open)

    def join(self, x: float, y: float) -> tuple[int, int] | None:
        """The open element (row, col) of `state` through which a body at (x, y) in m joins the reachable points.

        Its own point, or where that is not open one next to it that a straight line leads to; None if there is none.
        """
        row, col = self.terrain.point_at(x, y)
        if self.terrain.inside(row, col) and self._is_open[row, col]:
            return row + 1, col + 1
        beside = anchor(self.terrain, self._is_open, x, y)
        return None if beside is None else (beside[0] + 1, beside[1] + 1)

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """(x, y) in m of the centre of element (row, col) of `state`."""
        return self.terrain.centre(row - 1, col - 1)


def _encode(is_open: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The wave's encoding of a grid, framed; points beyond the grid's edge count as blocked."""
    framed = np.pad(is_open, 1)
    rows, cols = is_open.shape
    surrounded = np.ones_like(is_open)
    for up in range(3):
        for across in range(3):
            surrounded &= framed[up : up + rows, across : across + cols]
    state = framed * np.uint8(OPEN)
    state[1:-1, 1:-1][is_open & ~surrounded] |= HEMMED
    return state
