"""The ground for one robot's planning: where its centre may be, and the discs and areas in the way at this tick."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import BLOCKED, HEMMED, OPEN
from patrol.ground.fields import anchor
from patrol.ground.terrain import ALL_WAYS, Terrain

Spot = tuple[float, float]
"""x and y in m."""

Disc = tuple[float, float, float]
"""x, y and radius in m."""


_REMEMBERED = 65536
"""Places off the open points whose elements a ground remembers, at most."""

_UNKNOWN = (-1, -1)


class Area:
    """A part of the ground that can be closed as a whole.

    `box` holds its bounds in `Ground.state`: first row, end row, first column, end column; ends are exclusive. `mask`
    is bool, the area's points within the box.
    """

    def __init__(self, area: NDArray[np.bool_]) -> None:
        """Cut an area out of a grid: bool (h, w), the terrain's points that belong to the area."""
        rows, cols = np.flatnonzero(area.any(axis=1)), np.flatnonzero(area.any(axis=0))
        top, bottom = (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, 0)
        left, right = (int(cols[0]), int(cols[-1]) + 1) if cols.size else (0, 0)
        self.box = top + 1, bottom + 1, left + 1, right + 1
        self.mask = area[top:bottom, left:right].copy()


class Ground:
    """The points on which a robot's centre may be, minus the discs and areas in the way at this tick.

    `begin` sets the obstacles of the robot's body each tick. A policy may `close` more for that tick, which affects its
    own routes and the body alike. Elements are numbered like those of `state`.

    `against`, uint8 (h, w), holds the steps that lead against one-way zones (`patrol.ground.terrain.Terrain.against`);
    it is `ALL_WAYS` where ways may lead in all directions. `behind`, bool (h, w), holds the points of one-way zones
    that lie behind the robot, on which manoeuvres keep off; it is None for none.
    """

    def __init__(
        self, terrain: Terrain, reach: NDArray[np.bool_], base: Ground | None = None, *, one_way: bool = True
    ) -> None:
        """Start with nothing closed; `reach`, bool (h, w), holds the points on which the robot's centre may be.

        `base` is the same ground, on which nothing is ever closed; then this one has grids of its own only while
        something is closed on it. Without `one_way` the terrain's one-way zones do not count.
        """
        self.against = terrain.against if one_way else ALL_WAYS
        self.behind: NDArray[np.bool_] | None = None
        self.terrain = terrain
        self._borrows = base is not None
        self._beside: dict[tuple[float, float], tuple[int, int] | None] = {}
        self._joined: tuple[float, float, tuple[int, int] | None] | None = None
        self._static = base
        self._wanted: tuple[tuple[Disc, ...], tuple[Area, ...]] = (), ()
        self._closed: tuple[tuple[Disc, ...], tuple[Area, ...]] = (), ()
        self._reach = reach
        self._is_open: NDArray[np.bool_]
        self._state: NDArray[np.uint8]
        if base is not None:
            self._borrow_grids(base)
            return
        self._is_open = np.pad(reach, 1)
        height, width = terrain.shape
        self._state = np.zeros((height + 2, width + 2), dtype=np.uint8)
        self._shown = _read_only(self._state)  # kernels rely on its frame, and policies have access to it
        self._encode_box((0, height + 2, 0, width + 2))

    @property
    def state(self) -> NDArray[np.uint8]:
        """The ground in the wave's encoding, framed by one blocked point on every side: uint8 (h + 2, w + 2).

        Read-only. Element (row + 1, col + 1) belongs to the terrain's point (row, col). The two low bits are OPEN or
        BLOCKED; HEMMED is set beside a blocked point.
        """
        self._apply_changes()
        return self._shown

    @property
    def open_now(self) -> NDArray[np.bool_]:
        """The terrain's points on which the robot's centre may be now: bool (h, w), read-only."""
        self._apply_changes()
        is_open = self._is_open[1:-1, 1:-1]
        is_open.flags.writeable = False
        return is_open

    @property
    def static(self) -> Ground:
        """The same ground with nothing closed; while something is closed, a copy made on first use."""
        if self._wanted == ((), ()):
            return self
        if self._static is None:
            self._static = Ground(self.terrain, self._reach)
        return self._static

    def is_closed(self, row: int, col: int) -> bool:
        """Return True if the robot's centre may be on a point of the terrain, but not at this tick."""
        return bool(self.static.open_now[row, col] and not self.open_now[row, col])

    def begin(self, discs: Sequence[Disc]) -> None:
        """Begin a tick: open everything again, then close the points whose centres lie within some discs."""
        self._wanted = tuple(discs), ()

    def close(self, discs: Sequence[Disc] = (), areas: Sequence[Area] = ()) -> None:
        """Close more for this tick: the points whose centres lie within some discs, and whole areas.

        A disc with a number that is not finite raises `ValueError`.
        """
        for disc in discs:
            if not all(map(math.isfinite, disc)):
                raise ValueError(f"the disc {disc} to be closed has a number that is not finite")
        self._wanted = (*self._wanted[0], *discs), (*self._wanted[1], *areas)

    def _apply_changes(self) -> None:
        """Bring the grids up to date with the discs and areas to be closed."""
        if self._wanted == self._closed:
            return
        before, self._closed = self._closed, self._wanted
        self._joined = None
        discs, areas = self._closed
        if self._borrows and self._static is not None:
            if not discs and not areas:
                self._borrow_grids(self._static)
                return
            if self._state is self._static._state:
                self._is_open, self._state = self._is_open.copy(), self._state.copy()
                self._shown = _read_only(self._state)
        boxes = [self._bound_disc(disc) for disc in (*before[0], *discs)]
        boxes += [area.box for area in (*before[1], *areas)]
        inside, reach = self._is_open[1:-1, 1:-1], self._reach
        for top, bottom, left, right in boxes:
            rows, cols = slice(max(top - 1, 0), max(bottom - 1, 0)), slice(max(left - 1, 0), max(right - 1, 0))
            inside[rows, cols] = reach[rows, cols]
        for disc in discs:
            self._block_disc(disc)
        for area in areas:
            top, bottom, left, right = area.box
            self._is_open[top:bottom, left:right] &= ~area.mask
        for box in boxes:
            self._encode_box(box)

    def join(self, x: float, y: float) -> tuple[int, int] | None:
        """Return (row, col) of the open element of `state` through which a body joins the reachable points.

        That is the body's own point, or, where that is not open, a neighbouring one that a straight line leads to; None
        if there is none.
        """
        self._apply_changes()
        joined = self._joined  # one attribute, because several threads may ask at once
        if joined is None or joined[0] != x or joined[1] != y:
            joined = self._joined = x, y, self._find_join(x, y)
        return joined[2]

    def _find_join(self, x: float, y: float) -> tuple[int, int] | None:
        row, col = self.terrain.point_at(x, y)
        if self.terrain.inside(row, col) and self._is_open[row + 1, col + 1]:
            return row + 1, col + 1
        beside = anchor(self.terrain, self._is_open[1:-1, 1:-1], x, y)
        return None if beside is None else (beside[0] + 1, beside[1] + 1)

    def join_each(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the open elements of `state` through which several bodies join the reachable points.

        The places are float64 (n, 2), x and y of the bodies' centres in m. The result is int64 (k, 2), row and column
        as of `join`, in the order of the bodies; those that do not join are left out.
        """
        self._apply_changes()
        if self._static is not None and self._state is self._static._state:
            return self._static.join_each(places)  # which remembers for all that borrow its grids
        # The frame, which is closed, stands for all that lies off the terrain.
        outside = np.array(self._is_open.shape) - 1
        points = np.floor((places - self.terrain.origin)[:, ::-1] / self.terrain.point) + 1.0
        elements: NDArray[np.int64] = np.clip(points, 0, outside).astype(np.int64)
        for index in np.flatnonzero(~self._is_open[elements[:, 0], elements[:, 1]]):
            x, y = places[index].tolist()
            beside = self._beside.get((x, y), _UNKNOWN) if self._closed == ((), ()) else self.join(x, y)
            if beside == _UNKNOWN:
                beside = self.join(x, y)
                if len(self._beside) < _REMEMBERED:
                    self._beside[x, y] = beside
            elements[index] = (-1, -1) if beside is None else beside
        return elements[elements[:, 0] >= 0]

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Return the centre (x, y) in m of element (row, col) of `state`."""
        return self.terrain.centre(row - 1, col - 1)

    def _borrow_grids(self, base: Ground) -> None:
        self._is_open, self._state, self._shown = base._is_open, base._state, base._shown

    def _locate_disc(self, disc: Disc) -> tuple[float, float, float]:
        """Return a disc's row, column and radius in points of `state`."""
        x, y, radius = disc
        ox, oy = self.terrain.origin
        point = self.terrain.point
        return (y - oy) / point + 1.0, (x - ox) / point + 1.0, radius / point

    def _bound_disc(self, disc: Disc) -> tuple[int, int, int, int]:
        """Return a disc's bounds in `state`: first row, end row, first column, end column; ends are exclusive."""
        row, col, radius = self._locate_disc(disc)
        rows, cols = self._state.shape
        top, bottom = _clip_range(math.floor(row - radius), math.ceil(row + radius) + 1, rows)
        left, right = _clip_range(math.floor(col - radius), math.ceil(col + radius) + 1, cols)
        return top, bottom, left, right

    def _block_disc(self, disc: Disc) -> None:
        row, col, radius = self._locate_disc(disc)
        top, bottom, left, right = self._bound_disc(disc)
        up = np.arange(top, bottom) + 0.5 - row
        across = np.arange(left, right) + 0.5 - col
        self._is_open[top:bottom, left:right] &= up[:, None] ** 2 + across[None, :] ** 2 >= radius**2

    def _encode_box(self, box: tuple[int, int, int, int]) -> None:
        """Bring `state` up to date in a box and one point around it; the frame stays blocked."""
        rows, cols = self._state.shape
        top, bottom = max(1, box[0] - 1), min(rows - 1, box[1] + 1)
        left, right = max(1, box[2] - 1), min(cols - 1, box[3] + 1)
        if bottom <= top or right <= left:
            return
        is_open = self._is_open[top:bottom, left:right]
        surrounded = is_open.copy()
        for up in (-1, 0, 1):
            for across in (-1, 0, 1):
                surrounded &= self._is_open[top + up : bottom + up, left + across : right + across]
        self._state[top:bottom, left:right] = np.where(surrounded, OPEN, np.where(is_open, OPEN | HEMMED, BLOCKED))


def _read_only(grid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    shown = grid.view()
    shown.flags.writeable = False
    return shown


def _clip_range(first: int, end: int, size: int) -> tuple[int, int]:
    """Clip the range from ``first`` to before ``end`` to 0 to ``size``; the result may be empty."""
    low = min(max(0, first), size)
    return low, min(max(low, end), size)
