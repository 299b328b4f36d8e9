"""Kernel of what may still come: upper bounds of the forces along paths longer than some lengths.

They need no path. A path is at least as long as one without obstacles, and within a block of points, no point is older
than the oldest one that may lend it its age.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

TICKS = types.Array(types.int32, 2, "C", readonly=True)
TABLE = types.Array(types.float64, 1, "C", readonly=True)
LENGTHS = types.Array(types.int64, 1, "C", readonly=True)
BOUNDS = types.Array(types.float64, 2, "C")
int64 = types.int64
index = types.uint64
"""Of what is sure not to be negative: a negative index would have to be asked for and counted from the end."""


# fmt: off
@njit(
    types.void(
        TICKS, TICKS, int64, int64, int64, int64, int64, types.boolean, TABLE, TABLE, LENGTHS, BOUNDS,
    ),
    cache=True,
    nogil=True,
)
def beyond(oldest, count, side, reach, row, col, tick, straight, pull, decay, lengths, bounds):
    """Bound the forces of the points whose path is longer than a length, for several lengths.

    Args:
        oldest: int32 (m, n) by block, a tick at which none of its points had been last seen before, undilated.
        count: int32 (m, n) by block, how many points pull from it.
        side: Of a block, in points.
        reach: Half-width of the dilatation's window in blocks, rounded up.
        row: The robot's row in the terrain.
        col: The robot's column in the terrain.
        tick: Now.
        straight: Whether paths are straight lines, in all directions instead of eight.
        pull: float64 (mfow + 1,), f by age in ticks, not falling.
        decay: float64 (limit + 1,), g by length in hundredths of a point, not rising from 1 on; longer paths exert
            nothing.
        lengths: int64 (k,), ascending, at least 1 and less than limit.
        bounds: float64 (2, k), filled in for each length: a bound of the sum of all these forces, and of the greatest.
    """
    rows, cols = oldest.shape
    limit, eldest = decay.size - 1, pull.size - 1
    within = limit // (100 * side) + 1
    top, bottom = max(0, row // side - within), min(rows, row // side + within + 1)
    left, right = max(0, col // side - within), min(cols, col // side + within + 1)
    # For each number of lengths that a block is sure to lie beyond: sums and greatest with and without decay.
    tally = np.zeros((4, lengths.size + 1))
    least = np.zeros(cols, dtype=np.int32)
    for up in range(top, bottom):
        least[:] = oldest[up]
        for other in range(max(0, up - reach), min(rows, up + reach + 1)):
            line = oldest[other]
            for across in range(cols):
                least[across] = min(least[across], line[across])
        rise = max(0, up * side - row, row - (up + 1) * side + 1)
        for across in range(left, right):
            if count[index(up), index(across)] == 0:
                continue
            when = tick
            for other in range(max(0, across - reach), min(cols, across + reach + 1)):
                when = min(when, int64(least[index(other)]))
            run = max(0, across * side - col, col - (across + 1) * side + 1)
            if straight:
                far = int(100.0 * math.sqrt(run * run + rise * rise) + 0.5)
            else:
                far = 100 * abs(run - rise) + 141 * min(run, rise)
            if far > limit:
                continue
            force = pull[index(min(tick - max(when, 0), eldest))]
            place = 0
            while place < lengths.size and far > lengths[index(place)]:
                place += 1
            all_ = force * count[index(up), index(across)]
            tally[0, place] += all_
            tally[1, place] = max(tally[1, place], force)
            if far > 0:
                tally[2, place] += all_ * decay[index(far)]
                tally[3, place] = max(tally[3, place], force * decay[index(far)])
    for k in range(lengths.size):
        nearest = decay[index(lengths[index(k)] + 1)]
        total, most = 0.0, 0.0
        for place in range(lengths.size + 1):
            if place <= k:
                total += tally[0, place] * nearest
                most = max(most, tally[1, place] * nearest)
            else:
                total += tally[2, place]
                most = max(most, tally[3, place])
        bounds[0, k], bounds[1, k] = total, most


# fmt: on
