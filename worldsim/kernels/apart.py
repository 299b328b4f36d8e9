"""Kernel of the verdict: finds bodies that overlap among many, looking at near pairs only."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(
    "UniTuple(i8, 2)(Array(f8, 2, 'C', True, aligned=True), Array(f8, 1, 'C', True, aligned=True), f8)",
    cache=True,
    nogil=True,
    error_model="numpy",
)
def first_overlap(places, radii, slack):
    """Find the first pair of bodies whose centres are nearer than the sum of their radii.

    Args:
        places: float64 (n, 2), x and y of the centres, m.
        radii: float64 (n,), m.
        slack: By how much they may be nearer all the same, m.

    Returns:
        Indices i < j, the smallest i and for it the smallest j; (n, n) where no pair overlaps.
    """
    count = radii.size
    widest = 0.0
    for i in range(count):
        widest = max(widest, radii[i])
    order = np.argsort(places[:, 0])
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
                if low < first or (low == first and high < second):
                    first, second = low, high
    return first, second
