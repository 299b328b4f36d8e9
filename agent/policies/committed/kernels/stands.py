"""Kernel of stands: the point with the shortest path among those from which a target is in sight."""

from __future__ import annotations

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
CELLS = types.Array(types.uint32, 2, "C", readonly=True)
int64 = types.int64


@njit(int64(MASK, int64, int64, int64, CELLS, int64), cache=True, nogil=True)
def nearest_stand(seen, slack, row0, col0, cell, limit):
    """Find the point with the shortest path among those in sight, with room to spare if any point has that much.

    Args:
        seen: uint8 (m, n), 1 in sight.
        slack: Rows and columns to each side that have to be in sight as well; points at the edge have none.
        row0: Row of the cells under row 0 of ``seen``.
        col0: Column of the cells under column 0 of ``seen``.
        cell: uint32 (p, q), see `agent.routes.kernels.lengths`.
        limit: Longest path that counts, in hundredths of a point.

    Returns:
        The flat index in ``seen`` of the first such point, row by row; -1 without any.
    """
    rows, cols = seen.shape
    inner = np.zeros((rows, cols), dtype=np.uint8)
    # How many points in a row have so much room to both sides, in this row and in those right before it.
    above = np.zeros(cols, dtype=np.int64)
    any_inner = False
    for row in range(rows):
        beside = 0
        for col in range(cols):
            beside = beside + 1 if seen[row, col] != 0 else 0
            if col < slack:
                continue
            middle = col - slack
            above[middle] = above[middle] + 1 if beside > 2 * slack else 0
            if above[middle] > 2 * slack:
                inner[row - slack, middle] = 1
                any_inner = True
    best, found = int64(2 * limit + 2), int64(-1)
    for row in range(max(0, -row0), min(rows, cell.shape[0] - row0)):
        for col in range(max(0, -col0), min(cols, cell.shape[1] - col0)):
            if (inner[row, col] if any_inner else seen[row, col]) == 0:
                continue
            known = int64(cell[row0 + row, col0 + col])
            if known > 0 and known >> 1 < best >> 1:
                best, found = known, row * cols + col
    return found
