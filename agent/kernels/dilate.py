"""Kernel of the dilatation: staleness spreads over a geodesic window.

The window of a point holds the points that can be reached from it in at most ``reach`` rounds. A round is one step
along the row and one along the column (odd rounds the other way about), through passable points only. Without obstacles
that is the paper's square of half-width ``reach``; with them staleness never crosses a wall.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C")
LONG = 64
"""Rounds after which a wide window is checked for having spread everywhere."""

FRAME = 2
"""Rows of zeros around the scratch, so that two steps at once need no checks of bounds."""

SCRATCH = types.Array(types.uint16, 2, "C")
FLAT = types.Array(types.uint16, 1, "C")
BOXES = types.Array(types.int64, 2, "C", readonly=True)
int64 = types.int64


@njit(types.void(FLAT, FLAT, FLAT, int64, int64, int64), cache=True, nogil=True)
def _one_step(value, open_, out, first, end, by):
    """One step along rows (``by`` 1) or columns (``by`` the row's length), for the elements from first to end."""
    before, here, after = value[first - by : end - by], value[first:end], value[first + by : end + by]
    mask, target = open_[first:end], out[first:end]
    for j in range(target.size):
        # The mask has all bits set or none, which takes no branch.
        target[j] = max(max(before[j], here[j]), after[j]) & mask[j]


@njit(types.void(FLAT, FLAT, FLAT, int64, int64, int64), cache=True, nogil=True)
def _two_steps(value, open_, out, first, end, by):
    """Take two such steps at once: an element two steps away counts where the one between is open."""
    before, here, after = value[first - by : end - by], value[first:end], value[first + by : end + by]
    far_before, far_after = value[first - 2 * by : end - 2 * by], value[first + 2 * by : end + 2 * by]
    mask_before, mask, mask_after = open_[first - by : end - by], open_[first:end], open_[first + by : end + by]
    target = out[first:end]
    for j in range(target.size):
        near = max(max(before[j], here[j]), after[j])
        target[j] = max(near, max(far_before[j] & mask_before[j], far_after[j] & mask_after[j])) & mask[j]


@njit(types.boolean(SCRATCH, SCRATCH, SCRATCH, int64, int64, int64), cache=True, nogil=True)
def _spread(value, open_, other, first_row, end_row, reach):
    """Spread the largest values by ``reach`` rounds, through open elements.

    Neighbouring rounds begin with the direction in which the one before ended, so these two steps are done at once.

    Args:
        value: uint16 (m, n) with a frame of `FRAME` zeros; changed in place.
        open_: uint16 (m, n), 65535 where open, 0 elsewhere and in the frame.
        other: uint16 (m, n), scratch, all 0.
        first_row: First row of the result; rows farther from it are computed only while they can still count.
        end_row: End row of the result, exclusive.
        reach: Rounds, at least 1.

    Returns:
        Whether the result is in ``other`` and not in ``value``.
    """
    rows, stride = value.shape
    now, after, mask = value.ravel(), other.ravel(), open_.ravel()
    swapped = False
    settled = np.zeros(0, dtype=np.uint16) if reach <= LONG else now.copy()
    remaining = reach  # steps along columns still to come
    for turn in range(reach + 1):
        across = turn % 2 == 0
        # The first and the last step have no neighbour in the same direction to be done with.
        single = turn in (0, reach)
        if not across:
            remaining -= 1 if single else 2
        # The comparison that ends the rounds early needs all rows to be right.
        margin = remaining if reach <= LONG else rows
        first = max(FRAME, first_row - margin) * stride
        end = min(rows - FRAME, end_row + margin) * stride
        if single:
            _one_step(now, mask, after, first, end, 1 if across else stride)
        else:
            _two_steps(now, mask, after, first, end, 1 if across else stride)
        now, after = after, now
        swapped = not swapped
        if reach > LONG and turn % LONG == 0 and turn > 0:
            # A window wider than the ground soon changes nothing any more.
            if np.array_equal(now, settled):
                break
            settled[:] = now
    return swapped


@njit(types.boolean(FLAT, FLAT, int64, int64, int64, int64), cache=True, nogil=True)
def _largest_along(value, other, first, end, by, reach):
    """Find the largest value at most ``reach`` elements away, along rows (``by`` 1) or columns (the row's length).

    Runs of ``size`` elements are built by doubling; two runs that overlap cover a window.

    Returns:
        Whether the result is in ``other`` and not in ``value``; both are overwritten.
    """
    now, after = value, other
    swapped = False
    size = 1
    low, high = first - reach * by, end + reach * by
    while 2 * size <= 2 * reach + 1:
        high -= size * by
        here, ahead, target = now[low:high], now[low + size * by : high + size * by], after[low:high]
        for j in range(target.size):
            target[j] = max(here[j], ahead[j])
        now, after = after, now
        swapped = not swapped
        # After k turns each element is the largest of 2**k, so a window of 101 takes 6 turns and not 50.
        size *= 2
    # The two runs overlap unless they just fit; a maximum may take an element twice.
    behind, ahead = now[low : end - reach * by], now[first + (reach - size + 1) * by : end + (reach - size + 1) * by]
    target = after[first:end]
    for j in range(target.size):
        target[j] = max(behind[j], ahead[j])
    return not swapped


@njit(types.void(TICKS, MASK, MASK, TICKS, int64, int64, int64, int64, int64, int64, FLAT), cache=True, nogil=True)
def dilate(last_seen, source, passable, dilated, first_row, last_row, first_col, last_col, reach, tick, scratch):
    """Recompute ``dilated`` over a box: the oldest last-seen tick within each passable point's window.

    For example, a row of points last seen at 9, 2, 7 and 8 becomes 2, 2, 2 and 7 with a reach of 1.

    Ages above 65534 ticks count as 65534.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen, -1 for never.
        source: uint8 (h, w), not 0 for the points whose age counts.
        passable: uint8 (h, w), not 0 for the points over which staleness spreads.
        dilated: int32 (h, w), filled in at the passable points of the box; 2**31 - 1 where the window holds no source.
        first_row: First row of the box.
        last_row: Last row of the box, inclusive.
        first_col: First column of the box.
        last_col: Last column of the box, inclusive.
        reach: Half-width of the window, in points.
        tick: Now.
        scratch: uint16, overwritten; the kernel allocates its own where this is too small.
    """
    height, width = last_seen.shape
    first_row, last_row = max(0, first_row), min(height - 1, last_row)
    first_col, last_col = max(0, first_col), min(width - 1, last_col)
    if first_row > last_row or first_col > last_col:
        return
    # The scratch goes beyond the edge of the ground, where nothing is, unless the window is wider than need be.
    beyond = reach if reach <= LONG else 0
    top = max(-beyond, first_row - reach)
    bottom = min(height - 1 + beyond, last_row + reach)
    left = max(-beyond, first_col - reach)
    right = min(width - 1 + beyond, last_col + reach)
    rows = bottom - top + 1
    cols = right - left + 1
    # Age plus one, so that 0 is "nothing here".
    shape = (rows + 2 * FRAME, cols + 2 * FRAME)
    size = shape[0] * shape[1]
    if scratch.size < 3 * size:
        scratch = np.empty(3 * size, dtype=np.uint16)
    # The frame must be 0 too, and what an earlier call left there is not.
    scratch[: 3 * size] = 0
    age = scratch[:size].reshape(shape)
    spare = scratch[size : 2 * size].reshape(shape)
    open_ = scratch[2 * size : 3 * size].reshape(shape)
    now = np.int32(tick)
    low_row, end_row, low_col, end_col = max(0, top), min(height, bottom + 1), max(0, left), min(width, right + 1)
    passed = 0
    for r in range(low_row, end_row):
        when, counts, may = last_seen[r, low_col:end_col], source[r, low_col:end_col], passable[r, low_col:end_col]
        ages, mask = age[r - top + FRAME, low_col - left + FRAME :], open_[r - top + FRAME, low_col - left + FRAME :]
        for j in range(when.size):
            mask[j] = 65535 if may[j] != 0 else 0
            # Counted here, where each point is read anyway.
            passed += may[j] != 0
            # Casts to int32, since a literal would widen the sum to 64 bits and halve what a vector holds.
            old = min(now - max(when[j], np.int32(0)), np.int32(65534)) + np.int32(1)
            ages[j] = old if may[j] != 0 and counts[j] != 0 else 0
    first, end = first_row - top + FRAME, last_row - top + FRAME + 1
    # Without obstacles the window is a square: rows and columns apart, and by doubling instead of step by step.
    if passed == (end_row - low_row) * (end_col - low_col) and 0 < reach <= LONG:
        stride = cols + 2 * FRAME
        begin, stop = FRAME * stride + FRAME + reach, (FRAME + rows) * stride - FRAME - reach
        flat, spare_flat = age.ravel(), spare.ravel()
        if _largest_along(flat, spare_flat, begin, stop, 1, reach):
            age, flat, spare_flat = spare, spare_flat, flat
        if _largest_along(flat, spare_flat, first * stride, end * stride, stride, reach):
            age = spare_flat.reshape(age.shape)
    elif reach > 0 and _spread(age, open_, spare, first, end, reach):
        age = spare
    span = last_col - first_col + 1
    begin = first_col - left + FRAME
    for r in range(first_row, last_row + 1):
        ages, may = age[r - top + FRAME, begin : begin + span], passable[r, first_col : last_col + 1]
        target = dilated[r, first_col : last_col + 1]
        for j in range(span):
            oldest = np.int32(ages[j])
            since = np.int32(2147483647) if oldest == 0 else now + np.int32(1) - oldest
            # Assigned in any case: the compiler turns a selection into vector code, but no branch.
            target[j] = since if may[j] != 0 else target[j]


@njit(types.void(TICKS, MASK, MASK, TICKS, BOXES, int64, int64, FLAT), cache=True, nogil=True)
def dilate_all(last_seen, source, passable, dilated, boxes, reach, tick, scratch):
    """Recompute ``dilated`` over some boxes, one after the other, as `dilate` does.

    Args:
        last_seen: As in `dilate`.
        source: As in `dilate`.
        passable: As in `dilate`.
        dilated: As in `dilate`.
        boxes: int64 (n, 4), first row, last row, first column, last column of points.
        reach: As in `dilate`.
        tick: As in `dilate`.
        scratch: As in `dilate`.
    """
    for box in range(boxes.shape[0]):
        top, bottom, left, right = boxes[box]
        dilate(last_seen, source, passable, dilated, top, bottom, left, right, reach, tick, scratch)
