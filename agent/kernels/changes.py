"""Kernels that find the blocks in which the dilatation has to be computed anew.

They keep book by blocks of `SIDE` x `SIDE` points. Last-seen ticks only grow, so the dilated tick of a point, the least
in its window, stays as it is unless a point of the window that had this very tick has changed.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C")
FLAGS = types.Array(types.uint8, 2, "C")
ROWS = types.Array(types.int32, 2, "C", readonly=True)
ENDS = types.Array(types.int64, 1, "C", readonly=True)
BOXES = types.Array(types.int64, 2, "C")
int64 = types.int64

SIDE = 16
"""Side of a block, in points."""

WIDEST = 256
"""Longest side of a box that is dilated at once, in points: what it takes has to fit into the processor's cache."""

NOTHING = 2**31 - 1
"""The oldest tick where there is none."""

POST = 2
"""Marks a point of the ground that is a post; 1 marks every other point of the ground."""


# fmt: off
@njit(
    types.void(TICKS, MASK, TICKS, TICKS, int64, int64, int64, int64), cache=True, nogil=True
)
def note(last_seen, ground, carried, outdated, first_row, last_row, first_col, last_col):
    """Carry over the changed points in a box of the fog, all but the posts.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen, -1 for never.
        ground: uint8 (h, w), 0 for points without dilatation, `POST` for posts, 1 for all others.
        carried: int32 (h, w), the same ticks as far as they were taken over, those of posts carried; changed in place.
        outdated: int32 by block, the oldest tick that a point had before it changed; lowered in place.
        first_row: First row of the box.
        last_row: Last row of the box, inclusive.
        first_col: First column of the box.
        last_col: Last column of the box, inclusive.
    """
    height, width = last_seen.shape
    begin, end = first_col // SIDE * SIDE, min((last_col // SIDE + 1) * SIDE, width)
    # Along whole rows of the box, not of one block, so that many points are taken at a time.
    before = np.empty(end - begin, dtype=np.int32)
    for up in range(first_row // SIDE, last_row // SIDE + 1):
        before[:] = NOTHING
        for row in range(up * SIDE, min((up + 1) * SIDE, height)):
            ticks, kind, stored = last_seen[row, begin:end], ground[row, begin:end], carried[row, begin:end]
            for k in range(before.size):
                had = stored[k]
                # Posts keep their tick: only `carry` knows those of the points that are seen from them.
                # Never seen counts as tick 0, so a first look at tick 0 changes nothing.
                has = max(ticks[k], np.int32(0)) if kind[k] == 1 else had
                before[k] = min(before[k], had if has != had else np.int32(NOTHING))
                stored[k] = has
        for across in range(begin // SIDE, last_col // SIDE + 1):
            low, high = across * SIDE - begin, min((across + 1) * SIDE, width) - begin
            outdated[up, across] = min(outdated[up, across], before[low:high].min())


@njit(
    types.void(ROWS, ENDS, TICKS, TICKS, TICKS, int64, int64, int64, int64), cache=True, nogil=True
)
def carry(posts, ends, last_seen, carried, outdated, first_row, last_row, first_col, last_col):
    """Update the tick of posts: the oldest of their own and those of the points seen from them.

    Args:
        posts: int32 (n, 4), row and column of a point and of its post, sorted by the block of the post, row by row;
            entries of the same post are adjacent.
        ends: int64 (m n + 1,), for each block, row by row, which of ``posts`` is its first; that of the next one is its
            end.
        last_seen: int32 (h, w), the tick at which each point was last seen.
        carried: int32 (h, w), the ticks with those of the posts; changed in place.
        outdated: As in `note`.
        first_row: First row of the blocks whose posts are updated.
        last_row: Last row of them, inclusive.
        first_col: First column of them.
        last_col: Last column of them, inclusive.
    """
    cols = outdated.shape[1]
    for up in range(first_row, last_row + 1):
        for across in range(first_col, last_col + 1):
            post, end = ends[up * cols + across], ends[up * cols + across + 1]
            before = outdated[up, across]
            while post < end:
                row, col = posts[post, 2], posts[post, 3]
                when = last_seen[row, col]
                while post < end and posts[post, 2] == row and posts[post, 3] == col:
                    when = min(when, last_seen[posts[post, 0], posts[post, 1]])
                    post += 1
                # Only after the least of all was taken: -1 of one point must win over the ticks of the others.
                when = max(when, 0)
                had = carried[row, col]
                if had != when:
                    carried[row, col] = when
                    before = min(before, had)
            outdated[up, across] = before


@njit(
    types.void(TICKS, TICKS, FLAGS, int64, int64, int64, int64, int64), cache=True, nogil=True
)
def fall_due(outdated, freshest, due, first_row, last_row, first_col, last_col, reach):
    """Mark the blocks in which a dilated tick may have changed, and forget the changes.

    For example, if a point last seen at tick 40 is seen again, a block whose freshest dilated tick is 35 stays as it
    is: none of its points had 40 as its oldest.

    Args:
        outdated: As in `note`; all of it is `NOTHING` afterwards.
        freshest: int32 by block, the greatest dilated tick of its ground; -1 where there is none.
        due: uint8 by block, set to 1 for those blocks.
        first_row: First row of blocks in which something has changed.
        last_row: Last row of them, inclusive.
        first_col: First column of them.
        last_col: Last column of them, inclusive.
        reach: Half-width of the dilatation's window in blocks, rounded up.
    """
    rows, cols = due.shape
    for row in range(first_row, last_row + 1):
        for col in range(first_col, last_col + 1):
            when = outdated[row, col]
            if when == NOTHING:
                continue
            outdated[row, col] = NOTHING
            # Staleness spreads by the window's half-width, so only blocks within that of the change can have noticed
            # it.
            for up in range(max(0, row - reach), min(rows, row + reach + 1)):
                for across in range(max(0, col - reach), min(cols, col + reach + 1)):
                    # No window of a block whose dilated ticks are all older has had it as its oldest.
                    if when <= freshest[up, across]:
                        due[up, across] = 1


@njit(
    types.void(TICKS, MASK, TICKS, ROWS, ENDS, TICKS, TICKS, FLAGS, BOXES, int64, int64),
    cache=True,
    nogil=True,
)
def take_in(
    last_seen, ground, carried, posts, ends, outdated, freshest, due, boxes, gap, reach
):
    """Take in the changes in some boxes of the fog: `note`, `carry` and `fall_due`.

    Args:
        last_seen: As in `note`.
        ground: As in `note`.
        carried: As in `note`.
        posts: As in `carry`.
        ends: As in `carry`.
        outdated: As in `note`; all of it is `NOTHING` afterwards.
        freshest: As in `fall_due`.
        due: As in `fall_due`.
        boxes: int64 (n, 4), on the grid: first row, last row, first column, last column of points.
        gap: The largest number of rows, or of columns, between a point and its post.
        reach: As in `fall_due`.
    """
    rows, cols = due.shape
    around = np.empty_like(boxes)
    # The posts of changed points may lie up to `gap` beyond the box.
    for box in range(boxes.shape[0]):
        top, bottom, left, right = boxes[box]
        around[box, 0], around[box, 1] = max(0, (top - gap) // SIDE), min(rows - 1, (bottom + gap) // SIDE)
        around[box, 2], around[box, 3] = max(0, (left - gap) // SIDE), min(cols - 1, (right + gap) // SIDE)
        note(last_seen, ground, carried, outdated, top, bottom, left, right)
        top, bottom, left, right = around[box]
        carry(posts, ends, last_seen, carried, outdated, top, bottom, left, right)
    # After all boxes: several may change the same block, and `fall_due` forgets each block that it has looked at.
    for box in range(boxes.shape[0]):
        top, bottom, left, right = around[box]
        fall_due(outdated, freshest, due, top, bottom, left, right, reach)


@njit(
    int64(FLAGS, MASK, int64, int64, int64, int64, int64, int64, int64, BOXES), cache=True, nogil=True
)
def boxes_due(due, clear, height, width, first_row, last_row, first_col, last_col, reach, boxes):
    """Put the blocks that are due into few boxes, which may hold others too.

    All points up to ``reach`` around a box are read to dilate it. So a block is added to the box for which the fewest
    more points are then read, unless it is better off alone: with a reach of 50, two blocks side by side are read by
    132 x 116 points as one box, and as two by twice 116 x 116. Boxes of clear blocks are dilated far faster, so these
    do not get into boxes with others.

    Args:
        due: uint8 by block; 0 for the blocks of the range afterwards.
        clear: uint8 by block, 1 if staleness spreads over all points around it.
        height: Rows of points of the ground.
        width: Columns of points of the ground.
        first_row: First row of the range of blocks.
        last_row: Last row of the range, inclusive.
        first_col: First column of the range.
        last_col: Last column of the range, inclusive.
        reach: Half-width of the dilatation's window, in points.
        boxes: int64 (n, 4), filled in: first row, last row, first column, last column of points; n at least the number
            of blocks of the range.

    Returns:
        The number of boxes.
    """
    count, around = 0, 2 * reach + 1
    for kind in range(2):
        first = count
        for row in range(first_row, last_row + 1):
            for col in range(first_col, last_col + 1):
                if due[row, col] == 0 or clear[row, col] != kind:
                    continue
                due[row, col] = 0
                top, bottom = row * SIDE, min((row + 1) * SIDE, height) - 1
                left, right = col * SIDE, min((col + 1) * SIDE, width) - 1
                boxes[count] = top, bottom, left, right
                # To be beaten: what a box of its own would read.
                best, fewest = count, (SIDE + 2 * reach) ** 2
                for box in range(count):
                    up, down = min(boxes[box, 0], top), max(boxes[box, 1], bottom)
                    begin, end = min(boxes[box, 2], left), max(boxes[box, 3], right)
                    tall, wide = boxes[box, 1] - boxes[box, 0] + around, boxes[box, 3] - boxes[box, 2] + around
                    more = (down - up + around) * (end - begin + around) - tall * wide
                    if more >= fewest or down - up >= WIDEST or end - begin >= WIDEST:
                        continue
                    blocks = clear[up // SIDE : down // SIDE + 1, begin // SIDE : end // SIDE + 1]
                    # A block that lies inside a box already costs nothing more there, whatever its kind.
                    if more == 0 or (box >= first and (kind == 0 or blocks.all())):
                        best, fewest = box, more
                boxes[best, 0], boxes[best, 1] = min(boxes[best, 0], top), max(boxes[best, 1], bottom)
                boxes[best, 2], boxes[best, 3] = min(boxes[best, 2], left), max(boxes[best, 3], right)
                count += best == count
    return count


@njit(
    types.void(MASK, TICKS, TICKS, BOXES), cache=True, nogil=True
)
def note_freshest(ground, dilated, freshest, boxes):
    """Note the greatest dilated tick of each block in some boxes.

    Args:
        ground: As in `note`.
        dilated: int32 (h, w), the dilated ticks.
        freshest: As in `fall_due`; filled in.
        boxes: int64 (n, 4), as `boxes_due` gives them.
    """
    height, width = ground.shape
    for box in range(boxes.shape[0]):
        for up in range(boxes[box, 0] // SIDE, boxes[box, 1] // SIDE + 1):
            for across in range(boxes[box, 2] // SIDE, boxes[box, 3] // SIDE + 1):
                # Below all ticks, so that a block without ground never falls due.
                greatest_tick = -1
                left, right = across * SIDE, min((across + 1) * SIDE, width)
                for row in range(up * SIDE, min((up + 1) * SIDE, height)):
                    kind, when = ground[row, left:right], dilated[row, left:right]
                    for col in range(when.size):
                        greatest_tick = max(greatest_tick, when[col] if kind[col] != 0 else -1)
                freshest[up, across] = greatest_tick


# fmt: on
