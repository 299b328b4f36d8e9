"""Kernel of first bends for large windows: as `agent.routes.kernels.bends`, row by row.

A point that is in sight of the start and no farther than unhindered is its own bend; any other has the bend of the
point before it on its path. Beside each other in a row lie mostly points whose paths come in the same direction. Such a
stretch of a row takes its bends from the row before or after it all at once or, when its paths come along the row, from
the point at its end. Rows are gone over downwards and upwards in turn until all stretches have their bends: as often as
paths turn back up or down.

This looks at all points of a box, but only once, and in the order in which they lie in memory. So it is faster than run
by run where paths fill a large box, and slower where they fill little of it, where stretches are short, or where paths
turn up and down many times. `estimate` tells of the first two, and after so many stretches `take_over` gives up.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

BENT = 7
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

EVERY = 17
"""Of so many rows, one is looked at for an estimate."""

CELLS = types.Array(types.uint32, 1, "C")
BENDS = types.Array(types.int32, 1, "C")
LIST = types.Array(types.uint32, 1, "C")
ROW = types.Array(types.uint8, 1, "C")
WORDS = types.Array(types.uint64, 1, "C")
MARK = types.Array(types.int64, 1, "C")
int64 = types.int64
index = types.uint64
"""As in `agent.routes.kernels.wave`."""


@njit("UniTuple(int64, 2)(uint32[::1], int64, int64, int64, int64, int64, int64, int64)", cache=True, nogil=True)
def estimate(cell, stride, beyond, limit, top, bottom, left, right):
    """About how many points of a box have paths of certain lengths, and how often directions change along its rows.

    Args:
        cell: See `take_over`.
        stride: Likewise.
        beyond: Paths count that are longer than this.
        limit: Longest path that counts.
        top: First row of the box.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.

    Returns:
        How many points, and to how many of them a path comes in another direction than to the point on the left.
    """
    points, changes = 0, 0
    least, lengths, direction = types.uint32(beyond + 1), types.uint32(limit - beyond), types.uint32(7 << 2)
    for row in range(top, bottom, EVERY):
        begin, end = row * stride + left, row * stride + right
        before, known = cell[index(begin) : index(end - 1)], cell[index(begin + 1) : index(end)]
        here, changed = types.uint32(0), types.uint32(0)
        for k in range(known.size):
            # What is nearer than the least becomes very large here.
            new = (known[k] >> types.uint32(5)) - least < lengths
            here += types.uint32(new)
            changed += types.uint32(new & ((known[k] ^ before[k]) & direction != 0))
        points += int(here)
        changes += int(changed)
    return EVERY * points, EVERY * changes


@njit(types.boolean(BENDS, LIST, LIST, int64, int64), cache=True, nogil=True)
def _take(bend, firsts, ends, at, stride):
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
    if before[0] < 0 and before[after.size - 1] < 0:
        return False
    least = types.int32(0)
    for k in range(after.size):
        after[k] = before[k]
        least = min(least, before[k])
    if least == 0:
        ends[index(at)] = 0
    return least == 0


@njit(types.int64(BENDS, LIST, LIST, int64, int64, int64, int64), cache=True, nogil=True)
def _go_over(bend, firsts, ends, begin, end, stride, down):
    """Let stretches take their bends in the order of their places, or in reverse.

    Those that still wait for bends are moved together, in the same order, to where this began.

    Args:
        bend: See `take_over`.
        firsts: uint32, the flat index of the first point of each stretch * 16 + its paths' direction.
        ends: uint32, the flat index of its end, exclusive; 0 where all bends are known.
        begin: The first stretch to go over.
        end: The end of the stretches to go over, exclusive.
        stride: See `take_over`.
        down: 1 to go in the order of their places, -1 for the reverse.

    Returns:
        How many stretches still wait.
    """
    against, waiting = LEFT if down > 0 else RIGHT, 0
    origin = begin if down > 0 else end - 1
    at = origin
    for _ in range(begin, end):
        if ends[index(at)] != 0:
            way, after = firsts[index(at)] & 15, at + down
            if way == against and begin <= after < end:
                _take(bend, firsts, ends, after, stride)
            # What comes from the row after could take its bends when the rows were last gone over the other way.
            if DOWN[way] == -down or not _take(bend, firsts, ends, at, stride):
                to = origin + waiting * down
                firsts[index(to)], ends[index(to)] = firsts[index(at)], ends[index(at)]
                waiting += 1
        at += down
    return waiting


@njit(types.int64(ROW, WORDS, LIST, LIST, int64, int64), cache=True, nogil=True)
def _cut(ways, words, firsts, ends, count, place):
    """Cut a row into stretches.

    Args:
        ways: uint8, the direction of the path to each point, or what stands in its place; END after the last one. What
            is behind that does not matter.
        words: The same, eight at a time: uint64.
        firsts: See `_go_over`; stretches are added.
        ends: Likewise.
        count: The number of stretches before.
        place: Flat index of the row's first point.

    Returns:
        The number of stretches after, or that of those for which there is room, if these are fewer.
    """
    k, room = 0, firsts.size
    while ways[index(k)] != END and count < room:
        first, way = k, ways[index(k)]
        alike = types.uint64(way) * types.uint64(0x0101010101010101)
        # Eight that are alike are in front of the END, whatever is behind it.
        while ways[index(k)] == way:
            k += 8 if k & 7 == 0 and words[index(k >> 3)] == alike else 1
        firsts[index(count)], ends[index(count)] = (place + first) << 4 | way, place + k
        count += 1 if way < ITSELF else 0
    return count


@njit(types.boolean(CELLS, BENDS, MARK, int64, int64, int64, int64, int64, int64, int64, int64), cache=True, nogil=True)
def take_over(cell, bend, mark, start, stride, limit, top, bottom, left, right, most):
    """Find the first bends of all paths that are at most ``limit`` long, if that takes little work.

    For the first call of a wave, the start's bend is itself. A later call with a larger limit continues from there, or
    from where `agent.routes.kernels.bends.follow` was in between.

    Args:
        cell: uint32, as `agent.routes.kernels.ties.decide` left it.
        bend: int32, where each path first bends; the point itself where no detour is needed. Filled in.
        mark: int64 (8,), see `agent.routes.kernels.wave.NOW`; changed in place.
        start: Flat index of the start.
        stride: Columns of the window.
        limit: Longest settled path.
        top: First row of a box around all points whose paths are settled.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
        most: Stretches to go over at most, each counted as often as it is gone over.

    Returns:
        Whether all bends were found. Otherwise `follow` has to find those of all paths that it has not followed.
    """
    firsts, ends = np.empty(most, dtype=np.uint32), np.empty(most, dtype=np.uint32)
    least, lengths = types.uint32(mark[BENT] + 1), types.uint32(limit - mark[BENT])
    start_row, start_col, width = start // stride, start % stride, right - left
    words = np.empty(width // 8 + 1, dtype=np.uint64)
    ways = words.view(np.uint8)
    along, aside = np.empty(width, dtype=np.int32), np.empty(width, dtype=np.int32)
    for k in range(width):
        # Of the columns in between: what they cost if the most steps are along the row, and what if up or down.
        along[k], aside[k] = 100 * abs(left + k - start_col), 41 * abs(left + k - start_col)
    waiting, count = 0, 0
    for row in range(top, bottom):
        up = abs(row - start_row)
        span = min((limit - 41 * up) // 100, (limit - 100 * up) // 41)
        first_col, end_col = max(left, start_col - span), min(right, start_col + span + 1)
        size, begin = max(0, end_col - first_col), row * stride + first_col
        known, turn = cell[index(begin) : index(begin + size)], bend[index(begin) : index(begin + size)]
        skip = first_col - left
        by_along, by_aside = along[index(skip) : index(skip + size)], aside[index(skip) : index(skip + size)]
        up_along, up_aside, place = types.int32(41 * up), types.int32(100 * up), types.int32(begin)
        for k in range(size):
            far = known[k] >> types.uint32(5)
            unhindered = types.uint32(max(by_along[k] + up_along, by_aside[k] + up_aside))
            new = far - least < lengths  # as in `estimate`
            itself = (known[k] & types.uint32(SEEN) != 0) & (far == unhindered)
            way = types.uint8(known[k] >> types.uint32(2) & types.uint32(7))
            ways[k] = (types.uint8(ITSELF) if itself else way) if new else types.uint8(KNOWN)
            turn[k] = (place + types.int32(k) if itself else types.int32(-1)) if new else turn[k]
        ways[size] = END
        # Stretches of the row above also ask for this row, so they had to wait until its bends were marked as unknown.
        most -= count - waiting
        waiting += _go_over(bend, firsts, ends, waiting, count, stride, 1)
        count = _cut(ways, words, firsts, ends, waiting, begin)
        if count - waiting >= most or count == firsts.size:
            return False
    begin, end, down = 0, count, -1
    while begin < end:
        # Every time takes from what is left of the work, so this ends even where cells hold no tree.
        most -= end - begin
        if most < 0:
            return False
        waiting = _go_over(bend, firsts, ends, begin, end, stride, down)
        begin, end = (begin, begin + waiting) if down > 0 else (end - waiting, end)
        down = -down
    mark[BENT] = limit
    return True
