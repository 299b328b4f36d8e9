"""Polygons in metres laid over the grid, never smaller than they are; and discs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Terrain

Polygon = Sequence[tuple[float, float]]
"""Corners (x, y) in m, in order; the last is joined to the first. It may be concave."""

TOLERANCE = 1e-6
"""Overlaps thinner than this (in points) are rounding and do not count."""


def cover(polygon: Polygon, shape: tuple[int, int], point: float, origin: tuple[float, float]) -> BoolGrid:
    """Return the points that share some area with a polygon, whose inside is by the even-odd rule.

    For example, the square from (0.5, 0.5) to (1.0, 1.0) m covers one point of 1 m, and one from (0.5, 0.5) to (1.1,
    1.1) covers four.
    """
    covered = np.zeros(shape, dtype=np.bool_)
    corners = [((x - origin[0]) / point, (y - origin[1]) / point) for x, y in polygon]
    cols = _covered_indices([x for x, _ in corners], shape[1])
    rows = _covered_indices([y for _, y in corners], shape[0])
    if cols.size == 0 or rows.size == 0:
        return covered
    return _paint_polygon(covered, _polygon_edges(corners), rows, cols)


_Edge = tuple[float, float, float, float]
"""x and y of its ends, in points."""

_BLOCK = 64
"""Rows of an edge that are looked at together: an edge takes time by its length, not by its bounding box."""


def _polygon_edges(corners: Sequence[tuple[float, float]]) -> list[_Edge]:
    return [(*start, *end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)]


def _paint_polygon(
    covered: BoolGrid, edges: Sequence[_Edge], rows: NDArray[np.int64], cols: NDArray[np.int64]
) -> BoolGrid:
    """Mark the points inside of a polygon, and those that its edges run through, within some rows and columns."""
    xs = np.asarray(cols + 0.5, dtype=np.float64)
    # Where an edge crosses the middle of a row, inside and outside change places for all that lies left of it.
    flips = np.zeros((rows.size, cols.size + 1), dtype=np.bool_)
    for x0, y0, x1, y1 in edges:
        between, crossing = _row_crossings(x0, y0, x1, y1, rows)
        flips[between, np.searchsorted(xs, crossing)] ^= True
    window = np.logical_xor.accumulate(flips[:, ::-1], axis=1)[:, -2::-1]
    for x0, y0, x1, y1 in edges:
        low, high = _reached_range(y0, y1, rows)
        left, right = _reached_range(x0, x1, cols)
        enter_x, leave_x = _slab_crossing(x0, x1, cols[left:right])
        for first in range(low, high, _BLOCK):
            block = slice(first, min(first + _BLOCK, high))
            enter_y, leave_y = (bound[:, None] for bound in _slab_crossing(y0, y1, rows[block]))
            near = left + np.flatnonzero((enter_x < leave_y.max()) & (enter_y.min() < leave_x))
            if near.size:
                part = slice(near[0], near[-1] + 1)
                within = slice(near[0] - left, near[-1] + 1 - left)
                enter = np.maximum(enter_x[None, within], enter_y)
                leave = np.minimum(leave_x[None, within], leave_y)
                window[block, part] |= np.maximum(enter, 0.0) < np.minimum(leave, 1.0)
    # Rows and columns of the bounding box alone: outside of it nothing is covered.
    covered[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1] = window
    return covered


def _reached_range(a0: float, a1: float, index: NDArray[np.int64]) -> tuple[int, int]:
    """Return the range of rows or columns, as places in `index`, that an edge may run through, and a few more."""
    low, high = np.clip([min(a0, a1) - 2.0, max(a0, a1) + 2.0], float(index[0]), float(index[-1] + 1))
    return math.floor(low) - int(index[0]), math.ceil(high) - int(index[0])


def _covered_indices(values: Sequence[float], count: int) -> NDArray[np.int64]:
    """Indices of the rows or columns, of `count`, that values in points reach over."""
    low, high = np.clip([min(values), max(values)], 0.0, float(count))
    return np.arange(math.floor(low), math.ceil(high), dtype=np.int64)


def _row_crossings(
    x0: float, y0: float, x1: float, y1: float, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the rows, as places in `rows`, whose middle an edge crosses, and where, in points."""
    low, high = _reached_range(y0, y1, rows)
    ys = np.asarray(rows[low:high] + 0.5, dtype=np.float64)
    # Half open, so that a corner in the middle of a row counts for one of its two edges only.
    between = np.flatnonzero((ys >= y0) != (ys >= y1))
    if y0 == y1:
        return between, np.zeros(0)
    return low + between, x0 + (ys[between] - y0) * ((x1 - x0) / (y1 - y0))


def _slab_crossing(a0: float, a1: float, index: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fractions of an edge from `a0` to `a1` at which it enters and leaves the open slabs [index, index + 1]."""
    low = index + TOLERANCE
    high = index + 1.0 - TOLERANCE
    if a0 == a1:
        inside = (low < a0) & (a0 < high)
        return np.where(inside, -np.inf, np.inf), np.where(inside, np.inf, -np.inf)
    # An edge as short as the smallest numbers lies in no slab: its fractions are infinite.
    with np.errstate(over="ignore"):
        first, second = (low - a0) / (a1 - a0), (high - a0) / (a1 - a0)
    return np.minimum(first, second), np.maximum(first, second)


def touched_points(
    cells: BoolGrid, resolution: float, point: float, shape: tuple[int, int], start: tuple[float, float] = (0.0, 0.0)
) -> BoolGrid:
    """Return the points of a grid of some shape that share some area with a marked cell.

    `resolution` is the side of a cell and `point` that of a point, m; either may be the larger one. `start` is x and y
    in m of the corner of point (0, 0) from the corner of cell (0, 0).

    For example, with cells of 0.05 m and points of 0.1 m a point is marked if one of its four cells is.
    """
    # count[r, c] counts the marked cells below row r and left of column c.
    count = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), dtype=np.int32)
    np.cumsum(cells, axis=0, dtype=np.int32, out=count[1:, 1:])
    np.cumsum(count[1:, 1:], axis=1, out=count[1:, 1:])
    low_row, high_row = _overlapping_cells(shape[0], cells.shape[0], point / resolution, start[1] / resolution)
    low_col, high_col = _overlapping_cells(shape[1], cells.shape[1], point / resolution, start[0] / resolution)
    touched = count[np.ix_(high_row, high_col)] - count[np.ix_(low_row, high_col)]
    touched += count[np.ix_(low_row, low_col)] - count[np.ix_(high_row, low_col)]
    return np.asarray(touched > 0)


def _overlapping_cells(
    count: int, cells: int, point: float, start: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First cell, and the one after the last, that each point along one side shares some area with; both in cells."""
    index = np.arange(count, dtype=np.float64)
    first = np.floor(index * point + start + TOLERANCE).astype(np.int64)
    after = np.ceil((index + 1.0) * point + start - TOLERANCE).astype(np.int64)
    return np.clip(first, 0, cells), np.clip(after, 0, cells)


def points_near(terrain: Terrain, place: tuple[float, float], radius: float) -> BoolGrid:
    """Mark the points whose centres are nearer to a place than a radius, m."""
    rows, cols = np.ogrid[: terrain.height, : terrain.width]
    x, y = ((at - origin) / terrain.point - 0.5 for at, origin in zip(place, terrain.origin, strict=True))
    near: BoolGrid = (rows - y) ** 2 + (cols - x) ** 2 < (radius / terrain.point) ** 2
    return near
