"""The ground for one robot's planning: where its centre may be, and the discs and areas in the way at this tick."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.kernels.ground import close_discs, open_elements
from agent.kernels.wave import FAR, encode
from patrol.ground.fields import anchor
from patrol.ground.terrain import BoolGrid, Terrain

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


Closed = tuple[tuple[Disc, ...], tuple[Area, ...]]
"""The discs and areas in the way."""

NOTHING: Closed = (), ()


NO_BENDS: NDArray[np.int32] = np.zeros((0, 0), dtype=np.int32)


class BoxPaths(NamedTuple):
    """The paths from the nearest of some points, over a box of the ground."""

    length: NDArray[np.int32]  # (m, n), in hundredths of a point, `FAR` where unknown; framed by one such point
    bend: NDArray[np.int32]  # (m, n), flat index into the box of each path's first bend; size 0 unless asked for
    row0: int  # row of the terrain under row 0
    col0: int  # column of the terrain under column 0
    limit: int  # longest path that counts as known, in hundredths of a point

    def length_to(self, row: int, col: int) -> int:
        """Return the length of the path to a point (row, col) of the terrain; `FAR` for none within the limit."""
        up, across = row - self.row0, col - self.col0
        inside = 0 <= up < self.length.shape[0] and 0 <= across < self.length.shape[1]
        length = int(self.length[up, across]) if inside else FAR
        return length if length <= self.limit else FAR


NO_PATHS = BoxPaths(NO_BENDS, NO_BENDS, 0, 0, 0)


class _Grids:
    """The points of a ground with some discs and areas closed, framed by one blocked point on every side."""

    def __init__(self, terrain: Terrain, reach: BoolGrid) -> None:
        self._terrain = terrain
        self._reach = reach
        self._closed: Closed | None = NOTHING  # None: not known, since an area that does not fit has raised an error
        self.is_open = np.pad(reach, 1)
        self._state = np.zeros(self.is_open.shape, dtype=np.uint8)
        self.state = _read_only(self._state)  # kernels rely on its frame, and policies have access to it
        height, width = self.is_open.shape
        encode(self.is_open, self._state, np.array([(0, height, 0, width)]))

    def show(self, closed: Closed) -> None:
        """Close some discs and areas, and open all others."""
        if closed is self._closed or closed == self._closed:
            return
        before, self._closed = self._closed, None
        discs, areas = closed
        places = [self._locate(disc) for disc in discs]
        bounds = [self._bound(place) for place in places]
        boxes = [*bounds, *(area.box for area in areas)]
        if before is None:
            boxes.append((0, self.is_open.shape[0], 0, self.is_open.shape[1]))
        else:
            boxes += [*map(self._bound, map(self._locate, before[0])), *(area.box for area in before[1])]
        changed = np.array(boxes, dtype=np.int64)
        bounded = np.array(bounds, dtype=np.int64).reshape(-1, 4)
        close_discs(self._reach, self.is_open, changed, np.array(places).reshape(-1, 3), bounded)
        for area in areas:
            top, bottom, left, right = area.box
            self.is_open[top:bottom, left:right] &= ~area.mask
        encode(self.is_open, self._state, changed)
        self._closed = closed

    def _locate(self, disc: Disc) -> tuple[float, float, float]:
        """Return a disc's row, column and radius in points of the grids."""
        x, y, radius = disc
        ox, oy = self._terrain.origin
        point = self._terrain.point
        return (y - oy) / point + 1.0, (x - ox) / point + 1.0, radius / point

    def _bound(self, located: tuple[float, float, float]) -> tuple[int, int, int, int]:
        """Return a located disc's bounds: first row, end row, first column, end column; ends are exclusive."""
        row, col, radius = located
        rows, cols = self.is_open.shape
        top, bottom = _clip_range(math.floor(row - radius), math.ceil(row + radius) + 1, rows)
        left, right = _clip_range(math.floor(col - radius), math.ceil(col + radius) + 1, cols)
        return top, bottom, left, right


class _Shared:
    """The grids of all grounds over each other: some with nothing closed, and some to close on, made on first use."""

    def __init__(self, terrain: Terrain, reach: BoolGrid) -> None:
        self._terrain, self._reach = terrain, reach
        self._plain = _Grids(terrain, reach)
        self._spare: _Grids | None = None
        self.beside: dict[Spot, tuple[int, int] | None] = {}  # elements that places off the open points join
        self.kept: dict[tuple[int, int], BoxPaths] = {}

    def grids(self, closed: Closed) -> _Grids:
        """Return the grids with something closed, as they are until others are asked for."""
        if closed is NOTHING:
            return self._plain
        if self._spare is None:
            self._spare = _Grids(self._terrain, self._reach)
        self._spare.show(closed)
        return self._spare


class Ground:
    """The points on which a robot's centre may be, minus the discs and areas in the way at this tick.

    `begin` sets the obstacles of the robot's body each tick. A policy may `close` more for that tick, which affects its
    own routes and the body alike. Elements are numbered like those of `state`.

    Grounds that were made by `over` share their grids, so what `state` and `open_now` return holds until another of
    them is looked at.
    """

    def __init__(self, terrain: Terrain, reach: BoolGrid) -> None:
        """Start with nothing closed; `reach`, bool (h, w), holds the points on which the robot's centre may be."""
        self.terrain = terrain
        self._shared = _Shared(terrain, reach)
        self._below = self._closed = NOTHING
        self._joined: tuple[float, float, tuple[int, int] | None] | None = None

    def over(self, discs: Sequence[Disc] = ()) -> Ground:
        """Return the same ground with more discs closed for itself alone."""
        ground = self._with(self._closed)
        ground.begin(discs)
        return ground

    def _with(self, closed: Closed) -> Ground:
        """Return a ground over the same points on which something is always closed."""
        ground = copy.copy(self)
        ground._below = ground._closed = closed
        ground._joined = None
        return ground

    @property
    def state(self) -> NDArray[np.uint8]:
        """The ground in the wave's encoding, framed by one blocked point on every side: uint8 (h + 2, w + 2).

        Read-only. Element (row + 1, col + 1) belongs to the terrain's point (row, col). The two low bits are OPEN or
        BLOCKED; HEMMED is set beside a blocked point.
        """
        return self._grids.state

    @property
    def open_now(self) -> BoolGrid:
        """The terrain's points on which the robot's centre may be now: bool (h, w), read-only."""
        is_open = self._grids.is_open[1:-1, 1:-1]
        is_open.flags.writeable = False
        return is_open

    @property
    def static(self) -> Ground:
        """The same ground with nothing closed."""
        return self if self._closed is NOTHING else self._with(NOTHING)

    @property
    def kept(self) -> dict[tuple[int, int], BoxPaths]:
        """Paths to points that all grounds over these grids keep, as long as nothing is closed on them; else empty."""
        return self._shared.kept if self._closed is NOTHING else {}

    @property
    def _grids(self) -> _Grids:
        return self._shared.grids(self._closed)

    def is_closed(self, row: int, col: int) -> bool:
        """Return True if the robot's centre may be on a point of the terrain, but not at this tick."""
        return bool(self.static.open_now[row, col] and not self.open_now[row, col])

    def begin(self, discs: Sequence[Disc]) -> None:
        """Begin a tick: open everything again, then close the points whose centres lie within some discs."""
        self._closed = self._below
        self._joined = None
        self.close(discs)

    def close(self, discs: Sequence[Disc] = (), areas: Sequence[Area] = ()) -> None:
        """Close more for this tick: the points whose centres lie within some discs, and whole areas.

        A disc with a number that is not finite raises `ValueError`.
        """
        for disc in discs:
            if not all(map(math.isfinite, disc)):
                raise ValueError(f"the disc {disc} to be closed has a number that is not finite")
        if discs or areas:
            self._closed = (*self._closed[0], *discs), (*self._closed[1], *areas)
            self._joined = None

    def join(self, x: float, y: float) -> tuple[int, int] | None:
        """Return (row, col) of the open element of `state` through which a body joins the reachable points.

        That is the body's own point, or, where that is not open, a neighbouring one that a straight line leads to; None
        if there is none.
        """
        joined = self._joined
        if joined is None or joined[0] != x or joined[1] != y:
            joined = self._joined = x, y, self._find_join(x, y)
        return joined[2]

    def _find_join(self, x: float, y: float) -> tuple[int, int] | None:
        row, col = self.terrain.point_at(x, y)
        is_open = self._grids.is_open
        if self.terrain.inside(row, col) and is_open[row + 1, col + 1]:
            return row + 1, col + 1
        beside = anchor(self.terrain, is_open[1:-1, 1:-1], x, y)
        return None if beside is None else (beside[0] + 1, beside[1] + 1)

    def join_each(self, places: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the open elements of `state` through which several bodies join the reachable points.

        The places are float64 (n, 2), x and y of the bodies' centres in m. The result is int64 (k, 2), row and column
        as of `join`, in the order of the bodies; those that do not join are left out.
        """
        known = self._shared.beside
        elements: NDArray[np.int64] = open_elements(
            self._grids.is_open, places, *self.terrain.origin, self.terrain.point
        )
        for index in np.flatnonzero(elements[:, 0] < 0):
            x, y = places[index].tolist()
            beside = known.get((x, y), _UNKNOWN) if self._closed is NOTHING else self.join(x, y)
            if beside == _UNKNOWN:
                beside = self.join(x, y)
                if len(known) < _REMEMBERED:
                    known[x, y] = beside
            elements[index] = (-1, -1) if beside is None else beside
        return elements[elements[:, 0] >= 0]

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Return the centre (x, y) in m of element (row, col) of `state`."""
        return self.terrain.centre(row - 1, col - 1)


def _read_only(grid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    shown = grid.view()
    shown.flags.writeable = False
    return shown


def _clip_range(first: int, end: int, size: int) -> tuple[int, int]:
    """Clip the range from ``first`` to before ``end`` to 0 to ``size``; the result may be empty."""
    low = min(max(0, first), size)
    return low, min(max(low, end), size)
