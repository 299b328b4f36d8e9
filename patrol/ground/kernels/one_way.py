"""Kernels of ways over ground with one-way zones: their lengths, and their corners.

Steps to the eight neighbours cost 100 and 141, and no way cuts a corner, as on other ground. Steps that lead against a
zone are not taken. Step w leads in the direction of w times 45 degrees.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
PLACES = types.Array(types.int64, 1, "C", readonly=True)
LENGTHS = types.Array(types.int32, 2, "C")
KNOWN_LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
WAY = types.Array(types.int64, 1, "C")
int64 = types.int64

FAR = 2**31 - 1
"""The length of what no way leads to."""


@njit(types.void(GRID, GRID, PLACES, types.boolean, int64, int64, LENGTHS), cache=True, nogil=True)
def measure(is_open, against, starts, back, stop, limit, length):
    """Find the lengths of the shortest ways from the nearest of several points, or to it.

    Two first-in first-out queues, one per step cost, each stay sorted by length, as in `patrol.ground.kernels.tour`.

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be; its outermost points are 0.
        against: uint8 (h, w), bit w is set where step w leads against a zone.
        starts: int64 (n,), flat indices of open points, all different.
        back: Find the ways to the starts instead of those from them.
        stop: Flat index of a point whose length ends the search, or -1: points that are farther may have none then.
        limit: The longest way, in hundredths of a point.
        length: int32 (h, w), FAR everywhere; changed in place to the lengths in hundredths of a point.
    """
    ground, steps, lengths = is_open.ravel(), against.ravel(), length.ravel()
    stride = is_open.shape[1]
    step = (1, stride + 1, stride, stride - 1, -1, -stride - 1, -stride, -stride + 1)
    # A point is entered into each queue once at most, as lengths come in ascending order.
    straight = np.empty((ground.size, 2), dtype=np.int32)
    diagonal = np.empty((ground.size, 2), dtype=np.int32)
    straight_head, straight_tail, diagonal_head, diagonal_tail = 0, starts.size, 0, 0
    for place in range(starts.size):
        lengths[starts[place]] = 0
        straight[place, 0], straight[place, 1] = starts[place], 0
    while straight_head < straight_tail or diagonal_head < diagonal_tail:
        by_diagonal = straight_head >= straight_tail
        if not by_diagonal and diagonal_head < diagonal_tail:
            by_diagonal = diagonal[diagonal_head, 1] <= straight[straight_head, 1]
        if by_diagonal:
            here, far = int64(diagonal[diagonal_head, 0]), int64(diagonal[diagonal_head, 1])
            diagonal_head += 1
        else:
            here, far = int64(straight[straight_head, 0]), int64(straight[straight_head, 1])
            straight_head += 1
        if here == stop:
            break
        if far != lengths[here]:
            continue
        for way in range(8):
            there = here + step[way]
            away = far + (141 if way & 1 else 100)
            if ground[there] == 0 or away >= lengths[there] or away > limit:
                continue
            if way & 1 and (ground[here + step[way - 1]] == 0 or ground[here + step[(way + 1) & 7]] == 0):
                continue
            if (steps[there] >> ((way + 4) & 7) if back else steps[here] >> way) & 1:
                continue
            lengths[there] = away
            if way & 1:
                diagonal[diagonal_tail, 0], diagonal[diagonal_tail, 1] = there, away
                diagonal_tail += 1
            else:
                straight[straight_tail, 0], straight[straight_tail, 1] = there, away
                straight_tail += 1


@njit(types.boolean(GRID, GRID, int64, int64), cache=True, nogil=True)
def is_clear(is_open, against, first, last):
    """Return True if the straight line between two points' centres crosses open points only, and against no zone.

    A line through the corner of four points needs all four of them. A line between the directions of two steps leads
    against a zone where one of the two does.

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be.
        against: uint8 (h, w), see `measure`.
        first: Flat index of a point.
        last: Flat index of another one.
    """
    ground, steps = is_open.ravel(), against.ravel()
    stride = is_open.shape[1]
    row, col = first // stride, first % stride
    up, across = last // stride - row, last % stride - col
    step_row, step_col = (stride if up > 0 else -stride), (1 if across > 0 else -1)
    straight_row, straight_col = (2 if up > 0 else 6), (0 if across > 0 else 4)
    aslant = ((1 if across > 0 else 3) if up > 0 else (7 if across > 0 else 5)) if up != 0 and across != 0 else -1
    up, across = abs(up), abs(across)
    taken = 0
    if aslant >= 0:
        taken |= 1 << aslant
    if across > up:
        taken |= 1 << straight_col
    if up > across:
        taken |= 1 << straight_row
    here = first
    # How far the line has come across borders of rows and of columns; both are over 2 * up * across.
    next_row, next_col = across, up
    while here != last:
        if ground[here] == 0 or steps[here] & taken:
            return False
        if up == 0 or (across != 0 and next_col < next_row):
            here += step_col
            next_col += 2 * up
        elif across == 0 or next_row < next_col:
            here += step_row
            next_row += 2 * across
        else:
            if ground[here + step_row] == 0 or ground[here + step_col] == 0:
                return False
            here += step_row + step_col
            next_row += 2 * across
            next_col += 2 * up
    return ground[last] != 0


@njit(int64(GRID, GRID, int64, int64, KNOWN_LENGTHS, WAY), cache=True, nogil=True)
def corners(is_open, against, first, last, length, way):
    """Follow a way down the lengths, pulled taut: a corner wherever the one before goes out of sight.

    Args:
        is_open: As for `measure`.
        against: As for `measure`.
        first: Flat index of a point from which a way leads to the last one.
        last: Flat index of a point.
        length: int32 (h, w), lengths of the ways to the last point, as `measure` finds them.
        way: int64 (n,), overwritten with the flat indices of the way's corners, from the first point on, as many as
            there is room for.

    Returns:
        The number of corners.
    """
    ground, steps, lengths = is_open.ravel(), against.ravel(), length.ravel()
    stride = is_open.shape[1]
    step = (1, stride + 1, stride, stride - 1, -1, -stride - 1, -stride, -stride + 1)
    way[0] = first
    count, here, before = 1, first, first
    while here != last and count < way.size:
        for turn in range(8):
            there = here + step[turn]
            cost = 141 if turn & 1 else 100
            if ground[there] == 0 or lengths[there] == FAR or lengths[there] + cost != lengths[here]:
                continue
            if turn & 1 and (ground[here + step[turn - 1]] == 0 or ground[here + step[(turn + 1) & 7]] == 0):
                continue
            if steps[here] >> turn & 1:
                continue
            before, here = here, there
            break
        if not is_clear(is_open, against, way[count - 1], here):
            way[count] = before
            count += 1
    if count < way.size and first != last:
        way[count] = last
        count += 1
    return count
