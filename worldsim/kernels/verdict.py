"""Kernels of the verdict, which compute again what those of the world do.

They find bodies that overlap among many, looking at near pairs only (`collide.py` has the world's), and lines of sight,
from running sums of walls (the world's are in `radio.py`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types


@njit(
    "UniTuple(i8, 2)(Array(f8, 2, 'C', True, aligned=True), Array(f8, 1, 'C', True, aligned=True),"
    "Array(i8, 1, 'C', True, aligned=True), f8)",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def first_overlap(places, radii, order, slack):
    """Find the first pair of bodies whose centres are nearer than the sum of their radii.

    For example, (0, 1) for bodies of 0.5 m at x = 0, 0.9 and 3 m.

    Args:
        places: float64 (n, 2), x and y of the centres, m.
        radii: float64 (n,), m.
        order: int64 (n,), the bodies in the order of x.
        slack: By how much they may be nearer all the same, m.

    Returns:
        Indices i < j, the smallest i and for it the smallest j; (n, n) where no pair overlaps.
    """
    count = radii.size
    widest = 0.0
    for i in range(count):
        widest = max(widest, radii[i])
    first, second = count, count
    for rank in range(count):
        i = order[rank]
        for next_rank in range(rank + 1, count):
            j = order[next_rank]
            if places[j, 0] - places[i, 0] >= radii[i] + widest:
                break
            distance = math.hypot(places[j, 0] - places[i, 0], places[j, 1] - places[i, 1])
            if distance < radii[i] + radii[j] - slack:
                low, high = min(i, j), max(i, j)
                # Found in the order of x, but named by the lowest numbers, so that the message does not depend on
                # places.
                if low < first or (low == first and high < second):
                    first, second = low, high
    return first, second


_SUMS = types.Array(types.int64, 2, "C", readonly=True)
_COUNTS = types.Array(types.int64, 1, "C")
_F = types.float64


@njit(_COUNTS(_SUMS, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def touched(sums, x0, y0, x1, y1, margin):
    """Count the points of wall that a line touches in each column of a grid.

    For example, a level line through the middle of a row with walls in columns 2 and 3 gives 0, 0, 1, 1.

    Args:
        sums: int64 (h + 1, w), how many points of wall there are below each row, column by column.
        x0: Of one end, in points, and so are all that follow.
        y0: Of one end.
        x1: Of the other end; the line is no steeper than a diagonal.
        y1: Of the other end.
        margin: By how much the line is widened or, where negative, narrowed.

    Returns:
        int64 (w,).
    """
    height, width = sums.shape[0] - 1, sums.shape[1]
    counts = np.zeros(width, dtype=np.int64)
    if x0 > x1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    begin, end = x0 - margin, x1 + margin
    # Narrowed by more than its length, it touches nothing.
    if begin > end:
        return counts
    slope = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
    for column in range(max(math.floor(begin), 0), min(math.floor(end), width - 1) + 1):
        enters = y0 + slope * (min(max(column, begin), end) - x0)
        leaves = y0 + slope * (min(max(column + 1, begin), end) - x0)
        low = min(max(math.floor(min(enters, leaves) - margin), 0), height)
        high = min(max(math.floor(max(enters, leaves) + margin) + 1, low), height)
        counts[column] = sums[high, column] - sums[low, column]
    return counts


@njit(
    "UniTuple(i8, 2)(Array(i8, 2, 'C', True, aligned=True), f8, f8, f8, f8, f8)",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def crossings(sums, x0, y0, x1, y1, margin):
    """Count the unbroken stretches of columns in which a line touches walls.

    A column in which the widened line touches walls and the narrowed one does not may count or not.

    Args:
        sums: As for `touched`, like the ends of the line.
        x0: As for `touched`.
        y0: As for `touched`.
        x1: As for `touched`.
        y1: As for `touched`.
        margin: By how much the line is widened and narrowed, in points, above 0.

    Returns:
        The least and the greatest number.
    """
    widened = touched(sums, x0, y0, x1, y1, margin)
    narrowed = touched(sums, x0, y0, x1, y1, -margin)
    never = np.int64(sums.shape[1] + 1)
    # The least and the greatest number up to a column, if that is in a wall and if it is in none.
    least_in, most_in, least_out, most_out = never, -never, np.int64(0), np.int64(0)
    for column in range(widened.size):
        least_gap, most_gap = min(least_in, least_out), max(most_in, most_out)
        if widened[column] > 0:
            least_in, most_in = min(least_in, least_out + 1), max(most_in, most_out + 1)
        else:
            # Out of the question here: more and fewer than any line can have.
            least_in, most_in = never, -never
        if narrowed[column] > 0:
            least_out, most_out = never, -never
        else:
            least_out, most_out = least_gap, most_gap
    return min(least_in, least_out), max(most_in, most_out)
