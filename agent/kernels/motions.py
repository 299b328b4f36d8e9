"""Kernel of keeping right: how other robots have moved since they were last heard, and which of them may be met."""

from __future__ import annotations

import math

import numpy as np
from numba import from_dtype, njit, types

MOTION = np.dtype(
    [
        ("sequence", np.int64),  # of its newest position
        ("tick", np.int64),  # of its place
        ("x", np.float64),  # where it is, m
        ("y", np.float64),
        ("right", np.float64),  # how far it moves in a tick, m; 0 for one heard once, or whose position was wrong
        ("up", np.float64),
        ("noted", np.int64),  # the note in which it was there last
    ],
    align=True,
)
"""Another robot's place and movement, as far as they were heard."""

_F, _I = types.float64, types.int64
_INTEGERS, _FLOATS = types.Array(_I, 1, "C", readonly=True), types.Array(_F, 1, "C", readonly=True)
_PLACES = types.Array(_F, 2, "C", readonly=True)
_MOTION = from_dtype(MOTION)
_MOTIONS = types.Array(_MOTION, 1, "C")
_FOUND = types.Array(_I, 1, "C")


@njit(types.void(_MOTION, _I, _F, _F, _F, _I), cache=True, nogil=True)
def _go_on(motion, sequence, x, y, fastest, note):
    """Bring one motion up to date.

    For example, a robot at x = 1.0 m in tick 10 and at 1.6 m in tick 12 moves by 0.3 m in a tick to the right.
    """
    if motion.noted != note - 1:
        motion.sequence = motion.tick = sequence
        motion.x, motion.y, motion.right, motion.up = x, y, 0.0, 0.0
    elif motion.sequence != sequence or motion.x != x or motion.y != y:
        # A place that was predicted moves the tick on without a new sequence, so a frame that comes then may lie
        # behind it.
        tick = motion.tick + 1 if sequence == motion.sequence else max(sequence, motion.tick + 1)
        right, up = (x - motion.x) / (tick - motion.tick), (y - motion.y) / (tick - motion.tick)
        # Squares are faster than a length; the length decides where rounding might.
        is_true = right * right + up * up < 0.99 * fastest * fastest or math.hypot(right, up) <= fastest
        motion.right, motion.up = (right, up) if is_true else (0.0, 0.0)
        motion.sequence, motion.tick, motion.x, motion.y = sequence, tick, x, y
    motion.noted = note


@njit(
    _I(_INTEGERS, _INTEGERS, _INTEGERS, _PLACES, _FLOATS, _FLOATS, _I, _I, _F, _F, _I, _MOTIONS, _FOUND),
    cache=True,
    nogil=True,
)
def note_motions(numbers, sequences, ticks, places, fastest, reach, own, now, x, y, note, motions, found):
    """Bring motions up to date with what was heard, and find the robots that may be met.

    Args:
        numbers: int64 (n,), of the robots that are heard.
        sequences: int64 (n,), of the newest position of each.
        ticks: int64 (n,), when that was heard.
        places: float64 (n, 2), x and y of the place heard, or of the one predicted for now, m.
        fastest: float64 (m,), by number: the longest movement in a tick that can be true, m.
        reach: float64 (m,), by number: robots farther away than this cannot be met, m.
        own: The robot's own number, which is found last.
        now: The tick.
        x: Where the robot itself is, m.
        y: Likewise.
        note: Which call this is, counting up from 2: a robot that was not there in the one before is new.
        motions: MOTION (m,), by number, changed in place; zeros before the first call.
        found: int64 (m,), filled in: the numbers of those that may be met, or were heard late, in the given order.

    Returns:
        How many numbers are in `found`.
    """
    count = 0
    for i in range(numbers.size):
        number = numbers[i]
        _go_on(motions[number], sequences[i], places[i, 0], places[i, 1], fastest[number], note)
        # A sequence runs behind its arrival's tick when the frame was late; where that robot is now is uncertain.
        across, along = places[i, 0] - x, places[i, 1] - y
        if ticks[i] > sequences[i] or across * across + along * along <= reach[number] * reach[number]:
            found[count] = number
            count += 1
    _go_on(motions[own], now, x, y, fastest[own], note)
    found[count] = own
    return count + 1
