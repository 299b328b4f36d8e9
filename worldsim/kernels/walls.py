"""Kernel of the walls between two places, for what radio waves and lines of sight have to pass.

A line is cut into columns of the grid, or into rows where it is steeper than its diagonals. A wall is an unbroken
stretch of these in which the line touches a set point, so a wall counts once however thick it is:

    . . # . . # # # .
    a . # . . # # # b     2 walls
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

_MASK = types.Array(types.uint8, 2, "C", readonly=True)
_ANY = types.Array(types.uint8, 2, "A", readonly=True)
_PLACES = types.Array(types.float64, 2, "C", readonly=True)
_COUNTS = types.Array(types.int64, 2, "C")
_F = types.float64


@njit(types.int64(_ANY, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _count_stretches(mask, u0, v0, u1, v1, margin):
    """Count the stretches of columns in which a line touches a set point; all in points, |v1 - v0| <= |u1 - u0|."""
    if u0 > u1:
        u0, v0, u1, v1 = u1, v1, u0, v0
    begin, end = u0 - margin, u1 + margin
    slope = (v1 - v0) / (u1 - u0) if u1 > u0 else 0.0
    count = 0
    inside = False
    for column in range(max(math.floor(begin), 0), min(math.floor(end), mask.shape[1] - 1) + 1):
        enters = v0 + slope * (max(float(column), begin) - u0)
        leaves = v0 + slope * (min(column + 1.0, end) - u0)
        low = max(math.floor(min(enters, leaves) - margin), 0)
        high = min(math.floor(max(enters, leaves) + margin), mask.shape[0] - 1)
        touches = False
        for row in range(low, high + 1):
            touches = touches or mask[row, column] != 0
        if touches and not inside:
            count += 1
        inside = touches
    return count


@njit(types.int64(_MASK, _F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def walls_on_line(mask, point, ox, oy, x0, y0, x1, y1, margin):
    """Count the walls on a line. All numbers must be finite.

    Args:
        mask: uint8 (h, w), 1 where there is wall; off the grid there is none.
        point: Side of one point, m.
        ox: x of the grid's origin, m.
        oy: y of the grid's origin, m.
        x0: Of one end, m.
        y0: Of one end, m.
        x1: Of the other end, m.
        y1: Of the other end, m.
        margin: Half of the line's width, m.
    """
    u0, v0, u1, v1 = (x0 - ox) / point, (y0 - oy) / point, (x1 - ox) / point, (y1 - oy) / point
    if abs(v1 - v0) > abs(u1 - u0):
        return _count_stretches(mask.T, v0, u0, v1, u1, margin / point)
    return _count_stretches(mask, u0, v0, u1, v1, margin / point)


@njit(_COUNTS(_MASK, _F, _F, _F, _PLACES, _F), cache=True, nogil=True, error_model="numpy")
def walls_between(mask, point, ox, oy, places, margin):
    """Count the walls between each two of several places; the other arguments are those of `walls_on_line`.

    Args:
        mask: uint8 (h, w).
        point: m.
        ox: m.
        oy: m.
        places: float64 (n, 2), m.
        margin: m.

    Returns:
        int64 (n, n), symmetric.
    """
    count = places.shape[0]
    walls = np.zeros((count, count), dtype=np.int64)
    for i in range(count):
        for j in range(i):
            x0, y0, x1, y1 = places[i, 0], places[i, 1], places[j, 0], places[j, 1]
            walls[i, j] = walls[j, i] = walls_on_line(mask, point, ox, oy, x0, y0, x1, y1, margin)
    return walls
