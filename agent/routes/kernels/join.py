"""Kernel that finds the elements of the ground on which bodies stand."""

from __future__ import annotations

import math

from numba import njit, types

PLACES = types.Array(types.float64, 2, "C", readonly=True)
OPEN = types.Array(types.boolean, 2, "C", readonly=True)
FOUND = types.Array(types.int64, 2, "C")
int64 = types.int64
float64 = types.float64


@njit(int64(PLACES, OPEN, float64, float64, float64, FOUND), cache=True, nogil=True)
def stand_on(places, is_open, left, bottom, point, found):
    """Find the open elements that bodies stand on.

    Args:
        places: float64 (n, 2), x and y of the bodies' centres in m.
        is_open: bool (m, n), framed by one element on every side that is not open.
        left: x at which the second column begins, m.
        bottom: y at which the second row begins, m.
        point: Side of an element, m.
        found: int64 (n, 2), overwritten with row and column of each; the row is -1 where the element is not open.

    Returns:
        The number of bodies whose element is not open.
    """
    rows, cols = is_open.shape
    off = 0
    for k in range(places.shape[0]):
        row = min(max(int64(math.floor((places[k, 1] - bottom) / point)) + 1, 0), rows - 1)
        col = min(max(int64(math.floor((places[k, 0] - left) / point)) + 1, 0), cols - 1)
        found[k, 0], found[k, 1] = row, col
        if not is_open[row, col]:
            found[k, 0] = -1
            off += 1
    return off
