"""Kernel of first bends for large windows: as `agent.routes.kernels.bends`, row by row.

A point that is in sight of the start and no farther than unhindered is its own bend; any other has the bend of the
point before it on its path. Beside each other in a row lie mostly points whose paths come in the same direction. Such a
stretch of a row takes its bends from the row before or after it all at once or, when its paths come along the row, from
the point at its end. Rows are gone over downwards and upwards in turn until all stretches have their bends: as often as
paths turn back up or down.

This looks at all points of a box, but only once, and in the order in which they lie in memory. Paths that fill a large
window are followed twice as fast as run by run, short paths among many obstacles are not.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

BENT = 7
FULL = 4
SEEN = 2
"""As in `agent.routes.kernels.wave`."""

DOWN = (1, 1, -1, -1, 0, 1, 0, -1)
ACROSS = (1, -1, -1, 1, 1, 0, -1, 0)
"""Rows and columns of a step in each direction."""

RIGHT = 4
LEFT = 6
"""Directions of paths along a row."""

ITSELF = 8
"""In place of a direction: the point is its own bend."""

KNOWN = 9
"""In place of a direction: the point's bend is known, or it has no path."""

END = 10
"""In place of a direction: the end of the row."""

CELLS = types.Array(types.uint32, 1, "C")
BENDS = types.Array(types.int32, 1, "C")
LIST = types.Array(types.uint32, 1, "C")
LISTS = types.Array(types.uint32, 2, "C")
MARK = types.Array(types.int64, 1, "C")
int64 = types.int64
index = types.uint64
"""As in `agent.routes.kernels.wave`."""


@njit(types.boolean(BENDS, LIST, LIST, int64, int64, types.boolean), cache=True, nogil=True)
def _take(bend, firsts, ends, at, stride, thorough):
    """Let a stretch take its bends from the points before, see `_go_over`; returns whether all of them are known."""
    first, end, way = int64(firsts[index(at)] >> 4), int64(ends[index(at)]), firsts[index(at)] & 15
    if end == 0:
        return True
    if way in (RIGHT, LEFT):
        known = bend[index(first - 1 if way == RIGHT else end)]
        if known < 0:
            return False
        bend[index(first) : index(end)] = known
        ends[index(at)] = 0
        return True
    step = DOWN[way] * stride + ACROSS[way]
    before, after = bend[index(first - step) : index(end - step)], bend[index(first) : index(end)]
    if before[0] < 0 and before[after.size - 1] < 0 and not thorough:
        return False
    least = types.int32(0)
    for k in range(after.size):
        after[k] = before[k]
        least = min(least, before[k])
    if least == 0:
        ends[index(at)] = 0
    return least == 0


@njit(types.int64(BENDS, LIST, LIST, int64, int64, int64, int64, types.boolean), cache=True, nogil=True)
def _go_over(bend, firsts, ends, begin, count, stride, down, thorough):
    """Let stretches take their bends in the order of their places, or in reverse.

    Args:
        bend: See `take_over`.
        firsts: uint32, the flat index of the first point of each stretch * 16 + its paths' direction.
        ends: uint32, the flat index of its end, exclusive; set to 0 where all bends are known.
        begin: The first stretch to go over.
        count: Number of all stretches.
        stride: See `take_over`.
        down: 1 to go in the order of their places, -1 for the reverse.
        thorough: Whether to look at a stretch even if nothing is known of the points before its first and last ones.

    Returns:
        How many stretches still wait for bends.
    """
    waiting, against = 0, LEFT if down > 0 else RIGHT
    at, after = (begin, begin) if down > 0 else (count - 1, count - 1)
    for _ in range(begin, count):
        at, after = after, after + down
        if ends[index(at)] == 0:
            continue
        way = firsts[index(at)] & 15
        if way == against and begin <= after < count:
            _take(bend, firsts, ends, after, stride, thorough)
        # What comes from the row after could take its bends when the rows were last gone over the other way.
        if DOWN[way] == -down or not _take(bend, firsts, ends, at, stride, thorough):
            waiting += 1
    return waiting


@njit(types.void(CELLS, BENDS, LISTS, MARK, int64, int64, int64, int64, int64, int64, int64), cache=True, nogil=True)
def take_over(cell, bend, lists, mark, start, stride, limit, top, bottom, left, right):
    """Find the first bends of all paths that are at most ``limit`` long.

    For the first call of a wave, the start's bend is itself. A later call with a larger limit continues from there.

    Args:
        cell: uint32, as `agent.routes.kernels.ties.decide` left it.
        bend: int32, where each path first bends; the point itself where no detour is needed. Filled in.
        lists: uint32 (5, k), see `agent.routes.kernels.wave.settle`; its last two rows are working memory.
        mark: int64 (8,), see `agent.routes.kernels.wave.NOW`; changed in place.
        start: Flat index of the start.
        stride: Columns of the window.
        limit: Longest settled path.
        top: First row of a box around all points whose paths are settled.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
    """
    if mark[FULL] != 0:
        return
    firsts, ends, room = lists[3], lists[4], lists.shape[1]
    since, more = types.uint32(mark[BENT] + 1), types.uint32(limit - mark[BENT])
    above, here, count = 0, 0, 0
    start_row, start_col = start // stride, start % stride
    eights = np.empty((right - left) // 8 + 1, dtype=np.uint64)
    ways, away = eights.view(np.uint8), np.empty((2, right - left), dtype=np.int32)
    for k in range(right - left):
        away[0, k], away[1, k] = 100 * abs(left + k - start_col), 41 * abs(left + k - start_col)
    for row in range(top, bottom):
        up = abs(row - start_row)
        span = min((limit - 41 * up) // 100, (limit - 100 * up) // 41)
        begin, end = max(left, start_col - span), min(right, start_col + span + 1)
        size, begin = max(0, end - begin), row * stride + begin
        known, turn = cell[index(begin) : index(begin + size)], bend[index(begin) : index(begin + size)]
        skip = begin - row * stride - left
        mostly, partly = away[0, index(skip) : index(skip + size)], away[1, index(skip) : index(skip + size)]
        up_mostly, up_partly, place = types.int32(100 * up), types.int32(41 * up), types.int32(begin)
        for k in range(size):
            far = known[k] >> types.uint32(5)
            unhindered = types.uint32(max(mostly[k] + up_partly, partly[k] + up_mostly))
            found = far - since < more
            itself = (known[k] & types.uint32(SEEN) != 0) & (far == unhindered)
            way = types.uint8(known[k] >> types.uint32(2) & types.uint32(7))
            ways[k] = (types.uint8(ITSELF) if itself else way) if found else types.uint8(KNOWN)
            turn[k] = (place + types.int32(k) if itself else types.int32(-1)) if found else turn[k]
        ways[size] = END
        above, here, k = here, count, 0
        while k < size and count < room:
            first, way = k, ways[index(k)]
            eight = types.uint64(way) * types.uint64(0x0101010101010101)
            while ways[index(k)] == way:
                k += 8 if k & 7 == 0 and eights[index(k >> 3)] == eight else 1
            firsts[index(count)], ends[index(count)] = (begin + first) << 4 | way, begin + k
            count += 1 if way < ITSELF else 0
        # Stretches also ask for the row below, so they wait until it has been looked at.
        _go_over(bend, firsts, ends, above, here, stride, 1, False)
    if count == room:
        mark[FULL] = 1
        return
    down, waiting, before = -1, count, 0
    while waiting > 0:
        before, waiting = waiting, _go_over(bend, firsts, ends, 0, count, stride, down, waiting == before)
        down = -down
    mark[BENT] = limit
