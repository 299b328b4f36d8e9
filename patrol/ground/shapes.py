"""Polygons in metres laid over the grid, never smaller than they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid

Polygon = Sequence[tuple[float, float]]
"""Corners (x, y) in m, in order; the last is joined to the first. It may be concave."""

TOLERANCE = 1e-6
"""Overlaps thinner than this (in points) are rounding and do not count."""


def cover(polygon: Polygon, shape: tuple[int, int], point: float, origin: tuple[float, float]) -> BoolGrid:
    """The points that share some area with a polygon, whose inside is by the even-odd rule.

    Args:
        polygon: corners in m.
        shape: (height, width) of the grid, points.
        point: side of one point, m.
        origin: (x, y) in m of the outer corner of point (0, 0).

    Returns:
        bool (height, width).
    """
    covered = np.zeros(shape, dtype=np.bool_)
    corners = [((x - origin[0]) / point, (y - origin[1]) / point) for x, y in polygon]
    cols = _span([x for x, _ in corners], shape[1])
    rows = _span([y for _, y in corners], shape[0])
    if cols.size == 0 or rows.size == 0:
        return covered
    window = np.zeros((rows.size, cols.size), dtype=np.bool_)
    centre_x = np.asarray(cols[None, :] + 0.5, dtype=np.float64)
    centre_y = np.asarray(rows[:, None] + 0.5, dtype=np.float64)
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        window ^= _left_of(x0, y0, x1, y1, centre_y, centre_x)
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        enter_x, leave_x = _crossing(x0, x1, cols)
        enter_y, leave_y = _crossing(y0, y1, rows)
        enter = np.maximum(enter_x[None, :], enter_y[:, None])
        leave = np.minimum(leave_x[None, :], leave_y[:, None])
        window |= np.maximum(enter, 0.0) < np.minimum(leave, 1.0)
    covered[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1] = window
    return covered


def _span(values: Sequence[float], count: int) -> NDArray[np.int64]:
    """Indices of the rows or columns, of `count`, that values in points reach over."""
    low, high = np.clip([min(values), max(values)], 0.0, float(count))
    return np.arange(math.floor(low), math.ceil(high), dtype=np.int64)


def _left_of(x0: float, y0: float, x1: float, y1: float, ys: NDArray[np.float64], xs: NDArray[np.float64]) -> BoolGrid:
    """Where a ray in the direction of +x crosses an edge: one such crossing more, and inside becomes outside."""
    if y0 == y1:
        return np.zeros((ys.size, xs.size), dtype=np.bool_)
    between = (ys >= y0) != (ys >= y1)
    crossing: BoolGrid = between & (xs < x0 + (ys - y0) * ((x1 - x0) / (y1 - y0)))
    return crossing


def _crossing(a0: float, a1: float, index: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fractions of an edge from `a0` to `a1` at which it enters and leaves the open slabs [index, index + 1]."""
    low = index + TOLERANCE
    high = index + 1.0 - TOLERANCE
    if a0 == a1:
        inside = (low < a0) & (a0 < high)
        return np.where(inside, -np.inf, np.inf), np.where(inside, np.inf, -np.inf)
    first = (low - a0) / (a1 - a0)
    second = (high - a0) / (a1 - a0)
    return np.minimum(first, second), np.maximum(first, second)
