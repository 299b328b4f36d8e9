"""Kernel that sums up the fog by directions."""

from __future__ import annotations

import numpy as np
from numba import njit, types

int64 = types.int64
SEEN = types.Array(types.int32, 2, "C", readonly=True)
PATROLLED = types.Array(types.boolean, 2, "C", readonly=True)
SUMS = types.Array(types.int64, 2, "C")

NARROW = np.sqrt(2.0) - 1.0
"""The tangent of half a sector, 22.5 degrees."""


@njit(types.void(SEEN, PATROLLED, int64, int64, int64, int64, SUMS), cache=True, nogil=True)
def sum_ages(last_seen, patrolled, row, col, half, tick, sums):
    """Sum the ages of the patrolled points in each of eight sectors around a point, near it and farther away.

    Sector s is centred on the direction of 45 s degrees, counted from the columns' direction towards the rows'. The
    point itself is in none. Sums of whole numbers do not depend on their order.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen; below 0 counts as tick 0.
        patrolled: bool (h, w), the points that count.
        row: Of the point; it may lie off the grid, as may the column.
        col: Of the point.
        half: Points on each side of it that are near.
        tick: Now.
        sums: int64 (8, 4), filled: for each sector the sum of the ages and the number of near points, and the same of
            all others.
    """
    height, width = last_seen.shape
    bounds = np.empty(7, dtype=np.int64)
    sectors = np.empty(6, dtype=np.int64)
    sums[:] = 0
    for r in range(height):
        up = r - row
        if up == 0:
            bounds[0], bounds[1], bounds[2], bounds[3] = 0, col, col + 1, width
            sectors[0], sectors[1], sectors[2] = 4, -1, 0
            runs = 3
        else:
            rise = abs(up)
            steep = np.int64(np.floor(NARROW * rise))
            flat = np.int64(np.floor(rise / NARROW))
            bounds[0], bounds[1], bounds[2] = 0, col - flat, col - steep
            bounds[3], bounds[4], bounds[5] = col + steep + 1, col + flat + 1, width
            sectors[0], sectors[4] = 4, 0
            if up > 0:
                sectors[1], sectors[2], sectors[3] = 3, 2, 1
            else:
                sectors[1], sectors[2], sectors[3] = 5, 6, 7
            runs = 5
        is_near = abs(up) <= half
        for run in range(runs):
            sector = sectors[run]
            if sector < 0:
                continue
            first = min(max(bounds[run], 0), width)
            last = max(min(bounds[run + 1], width), first)
            near_first = min(max(col - half, first), last) if is_near else last
            near_last = max(min(col + half + 1, last), near_first) if is_near else last
            for part in range(3):
                if part == 0:
                    begin, end = first, near_first
                elif part == 1:
                    begin, end = near_first, near_last
                else:
                    begin, end = near_last, last
                ages, count = 0, 0
                seen, counts = last_seen[r, begin:end], patrolled[r, begin:end]
                for k in range(seen.size):
                    age = tick - max(seen[k], 0)
                    ages += age if counts[k] else 0
                    count += 1 if counts[k] else 0
                at = 0 if part == 1 else 2
                sums[sector, at] += ages
                sums[sector, at + 1] += count
