"""The ground: which points a body may be on and which a sensor sees through.

A terrain is a grid of square points of side `point` metres, stored row by row with row 0 at the lowest y (paper section
3: squares of 10 x 10 cm, each passable or an obstacle). Point (row, col) covers [ox + col p, ox + (col + 1) p) in x and
likewise in y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["BoolGrid", "Terrain"]

BoolGrid = NDArray[np.bool_]

MAX_POINTS = 50_000_000
"""The largest terrain: 700 x 700 m of 0.1 m points. Flat indices are int32 and every robot keeps several grids."""


def whole_points(length: float, point: float) -> int:
    """Return the number of whole points that lie along a length, at most `MAX_POINTS` + 1.

    A millionth of a point may be missing.

    For example, 0.3 m hold three points of 0.1 m, although 0.3 / 0.1 is a little less than 3.
    """
    return math.floor(min(length / point + 1e-6, MAX_POINTS + 1.0))


def frozen_grid(mask: BoolGrid) -> BoolGrid:
    """Return a read-only, row-major bool view of a mask; copies only where its memory is laid out otherwise."""
    grid = np.ascontiguousarray(mask, dtype=np.bool_).view()
    grid.flags.writeable = False
    return grid


@dataclass(frozen=True, eq=False)
class Terrain:
    """The ground of one scenario."""

    name: str  # what errors and reports call it
    passable: BoolGrid  # (height, width), read-only; False is an obstacle, which stops bodies and sight alike
    point: float  # side of one point, m
    origin: tuple[float, float] = (0.0, 0.0)  # x and y of the outer corner of point (0, 0), m
    # (height, width), read-only; True where bodies may not go although a sensor sees across; all False when omitted
    keep_out: BoolGrid = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))
    source: Path | None = None  # the YAML file of the map that it was read from, for errors; None for any other terrain

    def __post_init__(self) -> None:
        passable = frozen_grid(self.passable)
        if passable.ndim != 2 or passable.size == 0:
            raise ValueError(f"a terrain needs a two-dimensional grid with points, not {passable.shape}")
        keep_out = self.keep_out if self.keep_out.size else np.zeros(passable.shape, dtype=np.bool_)
        if keep_out.shape != passable.shape:
            raise ValueError(f"keep_out is {keep_out.shape}, passable is {passable.shape}")
        # The class is frozen; the constructor replaces what was given by read-only views.
        object.__setattr__(self, "passable", passable)
        object.__setattr__(self, "keep_out", frozen_grid(keep_out))

    @cached_property
    def shape(self) -> tuple[int, int]:
        """(height, width) in points."""
        return int(self.passable.shape[0]), int(self.passable.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.shape[0]

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.shape[1]

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(xmin, ymin, xmax, ymax) in m; for example (0, 0, 20, 10) for 40 by 20 points of 0.5 m."""
        ox, oy = self.origin
        return ox, oy, ox + self.width * self.point, oy + self.height * self.point

    @property
    def span(self) -> str:
        """Its extent along x and y, for people."""
        xmin, ymin, xmax, ymax = self.bounds
        return f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"

    @property
    def point_area(self) -> float:
        """Area of one point in m2."""
        return self.point * self.point

    @cached_property
    def free(self) -> BoolGrid:
        """bool (height, width), read-only: where bodies may be; sight is blocked by ~passable only."""
        return frozen_grid(self.passable & ~self.keep_out)

    @cached_property
    def blocked(self) -> NDArray[np.uint8]:
        """uint8 (height, width), read-only: 1 where bodies may not be, as the kernels of swept motion want it."""
        return frozen_grid(~self.free).view(np.uint8)

    @cached_property
    def room(self) -> NDArray[np.uint8]:
        """uint8 (height, width), read-only: a lower bound of each point's distance from where bodies may not be.

        Rows or columns, whichever are more, to the nearest such point (`patrol.kernels.clearance`).
        """
        from patrol.kernels.clearance import measure_room

        room = np.empty(self.shape, dtype=np.uint8)
        measure_room(self.blocked, room)
        room.flags.writeable = False
        return room

    def with_grids(self, free: BoolGrid, blocked: NDArray[np.uint8]) -> Terrain:
        """Take over `free` and `blocked` computed elsewhere, and return this terrain.

        They come from files that many share, for example, and must be what this terrain would make of its grids.
        """
        vars(self).update(free=frozen_grid(free), blocked=frozen_grid(blocked.view(np.bool_)).view(np.uint8))
        return self

    def point_at(self, x: float, y: float) -> tuple[int, int]:
        """Return the (row, col) of the point that covers a place; it may lie outside the grid.

        For example, with points of 0.5 m from (0, 0) on, (1.3, 0.2) lies on (0, 2), and (-0.1, 0.2) on (0, -1).
        """
        ox, oy = self.origin
        point = self.point
        return math.floor((y - oy) / point), math.floor((x - ox) / point)

    def nearest_point(self, x: float, y: float) -> tuple[int, int]:
        """Return the (row, col) of the point that covers a place, or of the nearest one to a place outside.

        For example, with points of 0.5 m and the origin at (0, 0), (-0.1, 0.2) gives (0, 0).
        """
        row, col = self.point_at(x, y)
        rows, cols = self.shape
        if 0 <= row < rows and 0 <= col < cols:  # nearly always
            return row, col
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def centre(self, row: int, col: int) -> tuple[float, float]:
        """Return the (x, y) in m of the centre of a point.

        For example, with points of 0.5 m and the origin at (0, 0), that of (0, 2) is (1.25, 0.25).
        """
        ox, oy = self.origin
        return ox + (col + 0.5) * self.point, oy + (row + 0.5) * self.point

    def inside(self, row: int, col: int) -> bool:
        """Return True if (row, col) is a point of this grid."""
        height, width = self.shape
        return 0 <= row < height and 0 <= col < width

    def contains(self, x: float, y: float) -> bool:
        """Return True if a place lies on the terrain; False for NaN and infinities."""
        return math.isfinite(x) and math.isfinite(y) and self.inside(*self.point_at(x, y))
