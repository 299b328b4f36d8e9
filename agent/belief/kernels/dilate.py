"""Kernel of the dilatation: staleness spreads over a geodesic window.

Before it spreads, the staleness of points on which no body fits is carried to their posts, the places that see them.

The window of a point is what can be reached from it in at most ``reach`` rounds, a round being one step along the row
and one along the column (odd rounds the other way about), through passable points only. Without obstacles that is the
paper's square of half-width ``reach``; with them staleness never crosses a wall.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C")
ROWS = types.Array(types.int32, 2, "C", readonly=True)
BOX = types.Array(types.int64, 1, "C")
LONG = 64
"""Rounds after which a wide window is checked for having spread everywhere."""

SCRATCH = types.Array(types.uint16, 2, "C")


@njit(types.void(SCRATCH, SCRATCH, SCRATCH, types.int64, types.int64), cache=True, nogil=True)
def _along_rows(value, open_, out, rows, cols):
    for i in range(1, rows + 1):
        here = value[i]
        mask = open_[i]
        there = out[i]
        for j in range(1, cols + 1):
            there[j] = max(max(here[j - 1], here[j]), here[j + 1]) & mask[j]


@njit(types.void(SCRATCH, SCRATCH, SCRATCH, types.int64, types.int64), cache=True, nogil=True)
def _along_cols(value, open_, out, rows, cols):
    for i in range(1, rows + 1):
        below = value[i - 1]
        here = value[i]
        above = value[i + 1]
        mask = open_[i]
        there = out[i]
        for j in range(1, cols + 1):
            there[j] = max(max(below[j], here[j]), above[j]) & mask[j]


@njit(types.void(SCRATCH, SCRATCH, types.int64, types.int64, types.int64), cache=True, nogil=True)
def _slide(value, scratch, rows, cols, reach):
    """Replace each element by the largest within the square of half-width ``reach``.

    Runs of ``size`` elements, the largest power of two up to reach + 1, are built by doubling; two overlapping runs
    cover what lies before an element and two what lies after, none of them leaving its window.
    """
    size = 1
    while 2 * size <= reach + 1:
        for i in range(1, rows + 1):
            line = value[i]
            for j in range(1, cols + 1 - size):
                line[j] = max(line[j], line[j + size])
        size *= 2
    for i in range(1, rows + 1):
        line = value[i]
        spare = scratch[i]
        for j in range(1, cols + 1):
            low = max(1, j - reach)
            high = max(j, min(cols, j + reach) - size + 1)
            spare[j] = max(max(line[low], line[max(low, j - size + 1)]), max(line[j], line[high]))
    size = 1
    while 2 * size <= reach + 1:
        for i in range(1, rows + 1 - size):
            line = scratch[i]
            other = scratch[i + size]
            for j in range(1, cols + 1):
                line[j] = max(line[j], other[j])
        size *= 2
    for i in range(1, rows + 1):
        low = max(1, i - reach)
        first = scratch[low]
        second = scratch[max(low, i - size + 1)]
        third = scratch[i]
        fourth = scratch[max(i, min(rows, i + reach) - size + 1)]
        there = value[i]
        for j in range(1, cols + 1):
            there[j] = max(max(first[j], second[j]), max(third[j], fourth[j]))


@njit(
    types.void(TICKS, MASK, MASK, TICKS, types.int64, types.int64, types.int64, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def dilate(last_seen, source, passable, dilated, first_row, last_row, first_col, last_col, reach, tick):
    """Recompute ``dilated`` over a box: the oldest last-seen tick within each passable point's window.

    Ages above 65534 ticks count as 65534.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen, -1 for never.
        source: uint8 (h, w), 1 for the points whose age counts.
        passable: uint8 (h, w), 1 for the points over which staleness spreads.
        dilated: int32 (h, w), filled in at the passable points of the box; 2**31 - 1 where the window holds no source.
        first_row: First row of the box.
        last_row: Last row of the box, inclusive.
        first_col: First column of the box.
        last_col: Last column of the box, inclusive.
        reach: Half-width of the window, in points.
        tick: Now.
    """
    height, width = last_seen.shape
    top = max(0, first_row - reach)
    bottom = min(height - 1, last_row + reach)
    left = max(0, first_col - reach)
    right = min(width - 1, last_col + reach)
    rows = bottom - top + 1
    cols = right - left + 1
    # Age plus one, so that 0 is "nothing here"; a frame of zeros spares the bounds checks.
    age = np.zeros((rows + 2, cols + 2), dtype=np.uint16)
    spread = np.zeros((rows + 2, cols + 2), dtype=np.uint16)
    open_ = np.zeros((rows + 2, cols + 2), dtype=np.uint16)
    walls = 0
    for i in range(rows):
        for j in range(cols):
            r = top + i
            c = left + j
            if passable[r, c] != 0:
                open_[i + 1, j + 1] = 65535
                if source[r, c] != 0:
                    age[i + 1, j + 1] = min(tick - max(last_seen[r, c], 0), 65534) + 1
            else:
                walls += 1
    if walls == 0:
        _slide(age, spread, rows, cols, reach)
    else:
        settled = np.zeros((1, 1), dtype=np.uint16) if reach <= LONG else age.copy()
        for step in range(reach):
            if step % 2 == 0:
                _along_rows(age, open_, spread, rows, cols)
                _along_cols(spread, open_, age, rows, cols)
            else:
                _along_cols(age, open_, spread, rows, cols)
                _along_rows(spread, open_, age, rows, cols)
            if reach > LONG and step % LONG == LONG - 1:
                # A window wider than the ground soon changes nothing any more.
                if np.array_equal(age, settled):
                    break
                settled[:, :] = age
    for r in range(max(0, first_row), min(height - 1, last_row) + 1):
        for c in range(max(0, first_col), min(width - 1, last_col) + 1):
            if passable[r, c] != 0:
                oldest = np.int64(age[r - top + 1, c - left + 1])
                dilated[r, c] = 2147483647 if oldest == 0 else tick + 1 - oldest


@njit(types.void(ROWS, TICKS, TICKS, BOX), cache=True, nogil=True)
def carry(posts, last_seen, carried, box):
    """Update the tick of each post: the oldest of its own and those of the points seen from it.

    Args:
        posts: int32 (n, 4), row and column of a point and of its post, all or a part of the entries of
            `agent.belief.posts.Posts`; entries of the same post are adjacent.
        last_seen: int32 (h, w), the tick at which each point was last seen.
        carried: int32 (h, w), the ticks with those of the posts; changed in place.
        box: int64 (4,), first and last row, first and last column (inclusive) of what has changed; extended in place to
            hold the posts that changed.
    """
    index = 0
    while index < posts.shape[0]:
        row = posts[index, 2]
        col = posts[index, 3]
        oldest = last_seen[row, col]
        while index < posts.shape[0] and posts[index, 2] == row and posts[index, 3] == col:
            oldest = min(oldest, last_seen[posts[index, 0], posts[index, 1]])
            index += 1
        if carried[row, col] != oldest:
            carried[row, col] = oldest
            box[0] = min(box[0], row)
            box[1] = max(box[1], row)
            box[2] = min(box[2], col)
            box[3] = max(box[3], col)
