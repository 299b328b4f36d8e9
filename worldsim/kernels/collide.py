"""Kernels of collisions: find the bodies that come near others, and cancel the moves by which they would meet.

Only bodies that come near others in a step are looked at in detail. They are swept all at once, in closed form.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

_DISCS = types.Array(types.float64, 2, "C", readonly=True)
_NEAR = types.Array(types.bool_, 1, "C")


@njit(_NEAR(_DISCS), cache=True, nogil=True, error_model="numpy")
def near_others(discs):
    """Mark the discs that overlap at least one other disc; touching counts.

    For example, of discs with a radius of 1 m at x = 0, 2 and 5 m the first two are marked.

    Args:
        discs: float64 (n, 3), x and y of the centres and the radii, m, in the order of x.

    Returns:
        bool (n,).
    """
    count = discs.shape[0]
    near = np.zeros(count, dtype=np.bool_)
    widest = 0.0
    for i in range(count):
        widest = max(widest, discs[i, 2])
    for i in range(count):
        for j in range(i + 1, count):
            # In the order of x, so none that follows can be near either.
            if discs[j, 0] - discs[i, 0] > discs[i, 2] + widest:
                break
            distance = math.hypot(discs[j, 0] - discs[i, 0], discs[j, 1] - discs[i, 1])
            if distance <= discs[i, 2] + discs[j, 2]:
                near[i] = near[j] = True
    return near


TOLERANCE = 1e-9
"""Two bodies nearer than the sum of their radii by no more than this (m) still only touch."""

_PATHS = types.Array(types.float64, 3, "C", readonly=True)
_RADII = types.Array(types.float64, 1, "C", readonly=True)
_FLAGS = types.Array(types.uint8, 1, "C")
_F = types.float64


@njit(types.boolean(_F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _bodies_meet(ax, ay, bx, by, limit):
    """Return True if a body comes nearer to another than `limit`, moving from (ax, ay) to (bx, by) relative to it, m.

    Two bodies that are nearer from the start meet unless they move apart.
    """
    dx, dy = bx - ax, by - ay
    along = ax * dx + ay * dy
    if ax * ax + ay * ay < limit * limit:
        # A body put too near another could otherwise never leave.
        return along <= 0.0
    square = dx * dx + dy * dy
    # Moving apart, or not at all relative to each other: never nearer than at the start.
    if along >= 0.0 or square == 0.0:
        return False
    # Where on the way it is nearest, but no farther than the end.
    part = min(-along / square, 1.0)
    nearest_x, nearest_y = ax + part * dx, ay + part * dy
    return nearest_x * nearest_x + nearest_y * nearest_y < limit * limit


@njit(types.void(_PATHS, _RADII, _FLAGS), cache=True, nogil=True, error_model="numpy")
def cancel_meeting(paths, radii, stands):
    """Stop every body that would meet another, repeatedly, until none would meet another.

    For example, of bodies that drive in a row, the second one stops where the first one stands, and then the third.

    All pairs are judged before any body is stopped, so the result does not depend on the order of the bodies.

    Args:
        paths: float64 (n, m + 1, 2), where each body would be at m + 1 equal steps of time, m, in the order of the
            first x.
        radii: float64 (n,), m.
        stands: uint8 (n,), 1 for a body that stays at the start of its path; changed in place.
    """
    count, places = paths.shape[0], paths.shape[1]
    spread = np.empty(count, dtype=np.float64)
    for i in range(count):
        farthest = 0.0
        for k in range(1, places):
            dx, dy = paths[i, k, 0] - paths[i, 0, 0], paths[i, k, 1] - paths[i, 0, 1]
            farthest = max(farthest, dx * dx + dy * dy)
        spread[i] = math.sqrt(farthest) + radii[i]
    widest = 0.0
    for i in range(count):
        widest = max(widest, spread[i])
    # Sorted along x, the bodies that can meet one lie near it: none farther away than two of the widest.
    stopped = np.zeros(count, dtype=np.uint8)
    while True:
        changed = False
        for i in range(count):
            for j in range(i + 1, count):
                if paths[j, 0, 0] - paths[i, 0, 0] > spread[i] + widest:
                    break
                # Two that stand do not meet, however near they are.
                if stands[i] != 0 and stands[j] != 0:
                    continue
                x, y = paths[i, 0, 0] - paths[j, 0, 0], paths[i, 0, 1] - paths[j, 0, 1]
                if math.hypot(x, y) > spread[i] + spread[j]:
                    continue
                limit = radii[i] + radii[j] - TOLERANCE
                for k in range(1, places):
                    ki, kj = (0 if stands[i] != 0 else k), (0 if stands[j] != 0 else k)
                    next_x, next_y = paths[i, ki, 0] - paths[j, kj, 0], paths[i, ki, 1] - paths[j, kj, 1]
                    if _bodies_meet(x, y, next_x, next_y, limit):
                        stopped[i] = stopped[j] = 1
                        changed = True
                        break
                    x, y = next_x, next_y
        if not changed:
            return
        for i in range(count):
            # Those who go on are judged again: a body that now stands may be in their way.
            stands[i] |= stopped[i]
