"""Kernel of the ages of a round's points."""

from __future__ import annotations

import numpy as np
from numba import njit, types

int64 = types.int64
float64 = types.float64
POINTS = types.Array(types.int64, 1, "C", readonly=True)
PATROLLED = types.Array(types.boolean, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C", readonly=True)
WEIGHTS = types.Array(types.float64, 2, "C", readonly=True)
AGES = types.Array(types.float64, 1, "C")


@njit(types.void(POINTS, PATROLLED, TICKS, TICKS, WEIGHTS, int64, float64, AGES), cache=True, nogil=True)
def weighted_ages(points, patrolled, last_seen, looked, weights, tick, step, ages):
    """Find how long ago some points were last seen, times their weights.

    Args:
        points: int64 (n,), their flat indices.
        patrolled: bool (h, w), the points that have an age.
        last_seen: int32 (h, w), when each was last seen.
        looked: int32 (h, w), when each was last in view; one that is in view now has no age.
        weights: float64 (h, w); (0, 0) where all count the same.
        tick: Now.
        step: Length of a tick, s.
        ages: float64 (n,), overwritten: s.
    """
    for i in range(points.size):
        row, col = divmod(points[i], last_seen.shape[1])
        ages[i] = 0.0
        if patrolled[row, col] and looked[row, col] != tick:
            ages[i] = (tick - max(np.int64(last_seen[row, col]), 0)) * step
            if weights.size:
                ages[i] *= weights[row, col]
