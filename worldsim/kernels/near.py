"""Kernel of motion: finds the bodies that come near others in a step, so that only these are looked at in detail."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

_DISCS = types.Array(types.float64, 2, "C", readonly=True)
_FLAGS = types.Array(types.bool_, 1, "C")


@njit(_FLAGS(_DISCS), cache=True, nogil=True, error_model="numpy")
def near_others(discs):
    """Mark the discs that overlap at least one other disc; touching counts.

    Args:
        discs: float64 (n, 3), x and y of the centres and the radii, m.

    Returns:
        bool (n,).
    """
    count = discs.shape[0]
    near = np.zeros(count, dtype=np.bool_)
    widest = 0.0
    for i in range(count):
        widest = max(widest, discs[i, 2])
    order = np.argsort(discs[:, 0])
    for rank in range(count):
        i = order[rank]
        for next_rank in range(rank + 1, count):
            j = order[next_rank]
            if discs[j, 0] - discs[i, 0] > discs[i, 2] + widest:
                break
            distance = math.hypot(discs[j, 0] - discs[i, 0], discs[j, 1] - discs[i, 1])
            if distance <= discs[i, 2] + discs[j, 2]:
                near[i] = near[j] = True
    return near
