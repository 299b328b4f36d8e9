"""Kernel of many listeners: takes in the frames that follow from what each has heard before without any doubt."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

_FLAGS = types.Array(types.uint8, 2, "C")
_ROWS = types.Array(types.int64, 1, "C", readonly=True)
_LONGS = types.Array(types.int64, 2, "C")
_BITS = types.Array(types.uint64, 2, "C")
_TIMES = types.Array(types.float64, 2, "C")
_F = types.float64
_I = types.int64

_NO_BITS = np.uint64(0)
_LATEST = np.uint64(1)

PLAIN = 1
"""A frame that was taken in."""

ODD = 2
"""A frame that has to be looked at by itself; nothing has changed."""


# fmt: off
@njit(
    types.boolean(
        _FLAGS, _ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _I, _F, _F, _F, _I,
        _FLAGS, _LONGS, _LONGS, _LONGS, _LONGS, _LONGS, _LONGS, _TIMES, _LONGS, _BITS, _LONGS, _BITS,
    ),
    cache=True, nogil=True, error_model="numpy",
)
def hear(
    reaches, listeners, senders, sequences, xs, ys, headings, times, tick, step, speed, rounding, span,
    odd, sequence, x, y, heading, time, at, start, newest, used, looked, looks,
):
    """Take in the frames that follow from the last one of their sender without any doubt.

    Such a frame is newer than all that was heard of its sender, and says a place that its sender can have reached since
    the last by a margin larger than any rounding. The rest are left to `patrol.radio.inbox.Inbox`, which decides on
    both kinds; this does the same for the first.

    Args:
        reaches: uint8 (m, f), 1 where a frame reaches a listener; overwritten with 0, `PLAIN` or `ODD`.
        listeners: int64 (m,), the listeners' rows in the tables below.
        senders: int64 (f,), the senders' columns there.
        sequences: int64 (f,), of the frames.
        xs: int64 (f,), cm.
        ys: int64 (f,), cm.
        headings: int64 (f,), mrad.
        times: int64 (f,), ms.
        tick: Now.
        step: s per tick.
        speed: Of the fastest robot, m/s.
        rounding: By how much two places may be farther apart than was driven, m.
        span: How many sequences a replay window holds.
        odd: uint8 (n, n), not 0 where the last frames of a sender were in doubt.
        sequence: int64 (n, n), of the last frame; -1 for none.
        x: int64 (n, n), cm.
        y: int64 (n, n), cm.
        heading: int64 (n, n), mrad.
        time: int64 (n, n), ms.
        at: int64 (n, n), the tick at which that frame was heard.
        start: float64 (n, n), when the quickest frame's sequence 0 would have come, s.
        newest: int64 (n, n), of the inbox's replay window.
        used: uint64 (n, n), its bits.
        looked: int64 (n, n), newest of the window of looks.
        looks: uint64 (n, n), its bits.

    Returns:
        Whether any frame is `ODD`.
    """
    now = tick * step
    in_doubt = False
    for row in range(listeners.size):
        own, reached = listeners[row], reaches[row]
        # Slices of the listener's rows and an unsigned column: nobody asks for each number whether it is negative.
        in_odd, in_sequence, in_at, in_start = odd[own], sequence[own], at[own], start[own]
        in_x, in_y, in_heading, in_time = x[own], y[own], heading[own], time[own]
        in_newest, in_used, in_looked, in_looks = newest[own], used[own], looked[own], looks[own]
        for frame in range(senders.size):
            if reached[frame] == 0:
                continue
            number, j = sequences[frame], np.uint64(senders[frame])
            last, looked_at = in_newest[j], in_looked[j]
            if own == senders[frame] or in_odd[j] != 0 or number <= last or number <= looked_at:
                reached[frame] = ODD
                in_doubt = True
                continue
            quickest = math.inf
            heard = in_sequence[j]
            if heard >= 0:
                quickest = in_start[j]
                before = in_at[j] * step
                elapsed = now - before
                late = min(max(before - heard * step - quickest, 0.0), span * step)
                held_up = min(max((number - heard) * step - elapsed, 0.0), late)
                reach = 100.0 * (1.0 - 1e-9) * (speed * (elapsed + held_up + step) + rounding)
                across, up = float(xs[frame] - in_x[j]), float(ys[frame] - in_y[j])
                if across * across + up * up > reach * reach:
                    reached[frame] = ODD
                    in_doubt = True
                    continue
            reached[frame] = PLAIN
            in_sequence[j], in_at[j], in_time[j] = number, tick, times[frame]
            in_x[j], in_y[j], in_heading[j] = xs[frame], ys[frame], headings[frame]
            in_start[j] = min(now - number * step, quickest)
            more = number - last
            in_used[j] = (in_used[j] << np.uint64(more) if more < span else _NO_BITS) | _LATEST
            in_newest[j] = number
            more = number - looked_at
            in_looks[j] = (in_looks[j] << np.uint64(more) if more < span else _NO_BITS) | _LATEST
            in_looked[j] = number
    return in_doubt


# fmt: on
