"""Kernels of the radio, for many links at once: draws, and the walls between two places, which block waves and sight.

Draws are the same hashes as `patrol.random.draw` and `gauss`.

For walls, a line is cut into columns of the grid, or into rows where it is steeper than its diagonals. A wall is an
unbroken stretch of these in which the line touches a set point, so a wall counts once however thick it is:

    . . # . . # # # .
    a . # . . # # # b     2 walls
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

_STATES = types.Array(types.uint64, 1, "C", readonly=True)
_NUMBERS = types.Array(types.int64, 1, "C", readonly=True)
_RATES = types.Array(types.float64, 2, "A", readonly=True)
_OUT = types.Array(types.uint8, 2, "C")
_NORMALS = types.Array(types.float64, 2, "C")


@njit(types.uint64(types.uint64, types.uint64), cache=True, nogil=True)
def _mix_state(state, value):
    """Return the next state of the hash; see `patrol.random`."""
    z = (state ^ value) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(types.float64(types.uint64), cache=True, nogil=True)
def _draw_share(state):
    """Return the draw of a hash, in [0, 1).

    For example, 0.5 for a state of 2^63.
    """
    # 53 bits, as many as a float's fraction holds, so that 1 is never reached by rounding.
    return float(state >> np.uint64(11)) * 2.0**-53


@njit(_OUT(_STATES, _NUMBERS, _NUMBERS, _RATES), cache=True, nogil=True)
def below(states, receivers, sequences, rates):
    """For each frame and receiver, whether the draw of (frame, receiver, sequence) is below a rate.

    For example, a rate of 0 never gives 1 and a rate of 1 always does, since draws lie in [0, 1).

    Args:
        states: uint64 (f,), the hashes of what comes before the receiver, by frame.
        receivers: int64 (r,), their numbers.
        sequences: int64 (f,), of the frames.
        rates: float64 (f, r), in [0, 1].

    Returns:
        uint8 (f, r), 1 where it is.
    """
    hit = np.empty((states.size, receivers.size), dtype=np.uint8)
    for frame in range(states.size):
        state, sequence = states[frame], np.uint64(sequences[frame])
        row = hit[frame]
        for receiver in range(receivers.size):
            mixed = _mix_state(_mix_state(state, np.uint64(receivers[receiver])), sequence)
            row[receiver] = _draw_share(mixed) < rates[frame, receiver]
    return hit


@njit(_NORMALS(_STATES, _NUMBERS), cache=True, nogil=True)
def normals(states, receivers):
    """For each sender and receiver, a draw from the standard normal distribution (Box and Muller).

    Args:
        states: uint64 (s,), the hashes of what comes before the receiver, by sender.
        receivers: int64 (r,), their numbers.

    Returns:
        float64 (s, r).
    """
    drawn = np.empty((states.size, receivers.size))
    for sender in range(states.size):
        for receiver in range(receivers.size):
            state = _mix_state(states[sender], np.uint64(receivers[receiver]))
            # 1 less the draw is above 0, so that the logarithm is finite.
            radius = math.sqrt(-2.0 * math.log(1.0 - _draw_share(_mix_state(state, np.uint64(0)))))
            drawn[sender, receiver] = radius * math.cos(2.0 * math.pi * _draw_share(_mix_state(state, np.uint64(1))))
    return drawn


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
            # No early end: columns have few rows here, since the line is no steeper than a diagonal.
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
        # Each pair once: a wall between two places is in the way in both directions.
        for j in range(i):
            x0, y0, x1, y1 = places[i, 0], places[i, 1], places[j, 0], places[j, 1]
            walls[i, j] = walls[j, i] = walls_on_line(mask, point, ox, oy, x0, y0, x1, y1, margin)
    return walls
