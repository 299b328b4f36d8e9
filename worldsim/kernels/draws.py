"""Kernels of draws: the same hashes as `patrol.random.draw` and `gauss`, for many links at once."""

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
    """Return the draw of a hash, in [0, 1)."""
    return float(state >> np.uint64(11)) * 2.0**-53


@njit(_OUT(_STATES, _NUMBERS, _NUMBERS, _RATES), cache=True, nogil=True)
def below(states, receivers, sequences, rates):
    """For each frame and receiver, whether the draw of (frame, receiver, sequence) is below a rate.

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
            radius = math.sqrt(-2.0 * math.log(1.0 - _draw_share(_mix_state(state, np.uint64(0)))))
            drawn[sender, receiver] = radius * math.cos(2.0 * math.pi * _draw_share(_mix_state(state, np.uint64(1))))
    return drawn
