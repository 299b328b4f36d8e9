"""The ground as one robot's planning sees it: where its centre may be, and what is in the way just now."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.routes.kernels.wave import BLOCKED, HEMMED, OPEN
from patrol.ground.fields import anchor
from patrol.ground.terrain import Terrain

Disc = tuple[float, float, float]
"""x, y and radius in m."""


class Ground:
    """The reachable points of a robot, framed by one blocked point on every side, in the wave's encoding.

    state: uint8 (h + 2, w + 2); element (row + 1, col + 1) belongs to the terrain's point (row, col). The two low bits
    are OPEN or BLOCKED; HEMMED is set beside a blocked point.
    """

    def __init__(self, terrain: Terrain, reach: NDArray[np.bool_], areas: Sequence[NDArray[np.bool_]] = ()) -> None:
        """reach: bool (h, w). areas: bool (h, w) each, those that `obstruct` can close, numbered from 1."""
        self.terrain = terrain
        self._areas = [_Area(area) for area in areas]
        self._reach: NDArray[np.bool_] = np.pad(reach, 1)
        self._is_open: NDArray[np.bool_] = self._reach.copy()
        height, width = terrain.shape
        self.state: NDArray[np.uint8] = np.zeros((height + 2, width + 2), dtype=np.uint8)
        self._encode((0, height + 2, 0, width + 2))
        self._closed: tuple[tuple[Disc, ...], tuple[int, ...]] = (), ()
        self._static: Ground | None = None

    @property
    def static(self) -> Ground:
        """The same ground with nothing closed: this one as long as nothing is, made when first needed otherwise."""
        if self._closed == ((), ()):
            return self
        if self._static is None:
            self._static = Ground(self.terrain, self._reach[1:-1, 1:-1])
        return self._static

    def obstruct(self, discs: Sequence[Disc], areas: Sequence[int] = ()) -> None:
        """Block the points whose centres lie within these discs, these areas, and none else but the terrain's own."""
        closed = tuple(discs), tuple(areas)
        if closed == self._closed:
            return
        before, self._closed = self._closed, closed
        boxes = [self._box(disc) for disc in (*before[0], *discs)]
        boxes += [self._areas[number - 1].box for number in (*before[1], *areas)]
        for top, bottom, left, right in boxes:
            self._is_open[top:bottom, left:right] = self._reach[top:bottom, left:right]
        for disc in discs:
            self._block(disc)
        for number in areas:
            top, bottom, left, right = self._areas[number - 1].box
            self._is_open[top:bottom, left:right] &= ~self._areas[number - 1].mask
        for box in boxes:
            self._encode(box)

    def join(self, x: float, y: float) -> tuple[int, int] | None:
        """The open element (row, col) of `state` through which a body at (x, y) in m joins the reachable points.

        Its own point, or where that is not open one next to it that a straight line leads to; None if there is none.
        """
        row, col = self.terrain.point_at(x, y)
        if self.terrain.inside(row, col) and self._is_open[row + 1, col + 1]:
            return row + 1, col + 1
        beside = anchor(self.terrain, self._is_open[1:-1, 1:-1], x, y)
        return None if beside is None else (beside[0] + 1, beside[1] + 1)

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """(x, y) in m of the centre of element (row, col) of `state`."""
        return self.terrain.centre(row - 1, col - 1)

    def _place(self, disc: Disc) -> tuple[float, float, float]:
        """A disc's row, column and radius in points of `state`."""
        x, y, radius = disc
        ox, oy = self.terrain.origin
        point = self.terrain.point
        return (y - oy) / point + 1.0, (x - ox) / point + 1.0, radius / point

    def _box(self, disc: Disc) -> tuple[int, int, int, int]:
        """The rows and columns, each from and to before, that hold a disc."""
        row, col, radius = self._place(disc)
        rows, cols = self.state.shape
        top, bottom = _within(math.floor(row - radius), math.ceil(row + radius) + 1, rows)
        left, right = _within(math.floor(col - radius), math.ceil(col + radius) + 1, cols)
        return top, bottom, left, right

    def _block(self, disc: Disc) -> None:
        row, col, radius = self._place(disc)
        top, bottom, left, right = self._box(disc)
        up = np.arange(top, bottom) + 0.5 - row
        across = np.arange(left, right) + 0.5 - col
        self._is_open[top:bottom, left:right] &= up[:, None] ** 2 + across[None, :] ** 2 >= radius**2

    def _encode(self, box: tuple[int, int, int, int]) -> None:
        """Bring `state` up to date in a box and one point around it; the frame stays blocked."""
        rows, cols = self.state.shape
        top, bottom = max(1, box[0] - 1), min(rows - 1, box[1] + 1)
        left, right = max(1, box[2] - 1), min(cols - 1, box[3] + 1)
        if bottom <= top or right <= left:
            return
        is_open = self._is_open[top:bottom, left:right]
        surrounded = is_open.copy()
        for up in (-1, 0, 1):
            for across in (-1, 0, 1):
                surrounded &= self._is_open[top + up : bottom + up, left + across : right + across]
        self.state[top:bottom, left:right] = np.where(surrounded, OPEN, np.where(is_open, OPEN | HEMMED, BLOCKED))


class _Area:
    """A part of the ground, cut out. box: rows and columns of `Ground.state`, each from and to before. mask: bool."""

    def __init__(self, area: NDArray[np.bool_]) -> None:
        rows, cols = np.flatnonzero(area.any(axis=1)), np.flatnonzero(area.any(axis=0))
        top, bottom = (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, 0)
        left, right = (int(cols[0]), int(cols[-1]) + 1) if cols.size else (0, 0)
        self.box = top + 1, bottom + 1, left + 1, right + 1
        self.mask = area[top:bottom, left:right].copy()


def _within(first: int, end: int, size: int) -> tuple[int, int]:
    """The part of the range from ``first`` to before ``end`` that lies within 0 to ``size``; perhaps empty."""
    low = min(max(0, first), size)
    return low, min(max(low, end), size)
