"""Kernel that finds the rivals whose paths may lead to a box."""

from __future__ import annotations

from numba import njit, types

PLACES = types.Array(types.int64, 2, "C", readonly=True)
FOUND = types.Array(types.int64, 2, "C")
int64 = types.int64


@njit(int64(PLACES, int64, int64, int64, int64, int64, FOUND), cache=True, nogil=True)
def rivals_within(others, limit, top, bottom, left, right, found):
    """Find the rivals from which a path to a box could be short enough if nothing were in between.

    Args:
        others: int64 (n, 2), rows and columns of the points on which rivals stand.
        limit: Longest path, in hundredths of a point.
        top: First row of the box.
        bottom: Last row.
        left: First column.
        right: Last column.
        found: int64 (n, 2), overwritten with the rows and columns of those rivals, in their order.

    Returns:
        Their number.
    """
    count = 0
    for k in range(others.shape[0]):
        row, col = others[k, 0], others[k, 1]
        up, across = max(top - row, row - bottom, 0), max(left - col, col - right, 0)
        if 100 * max(up, across) + 41 * min(up, across) <= limit:
            found[count, 0], found[count, 1] = row, col
            count += 1
    return count
