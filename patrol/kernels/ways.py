"""Kernels of ways: their lengths, and their corners.

A way is a row of steps to the eight neighbours. Step w leads in the direction of w times 45 degrees. It costs 100 where
it is straight and 141 where it is diagonal, and a diagonal step needs both points beside it.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush

import numpy as np
from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
PLACES = types.Array(types.int64, 1, "C", readonly=True)
LENGTHS = types.Array(types.int32, 2, "C")
KNOWN_LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
QUEUES = types.Array(types.int32, 3, "C")
USED = types.UniTuple(types.int64, 2)  # type: ignore[no-untyped-call]
WAY = types.Array(types.int32, 1, "C")
int64 = types.int64
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""

FAR = 2**31 - 1
"""The length at a point that no way leads to."""


@njit(USED(GRID, PLACES, int64, int64, LENGTHS, QUEUES), cache=True, nogil=True)
def wave(is_open, starts, stop, limit, length, queues):
    """Find the lengths of the shortest ways from the nearest of several points.

    For example, a point two columns and one row away on open ground has the length 241: one straight step and one
    diagonal.

    Two first-in first-out queues, one per step cost, each stay sorted by length (see the wave of the robots' planning).

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be; its outermost points are 0.
        starts: int64 (n,), flat indices of open points, all different.
        stop: Flat index of a point whose length ends the search, or -1: points that are farther may have none then.
        limit: The longest way, in hundredths of a point.
        length: int32 (h, w), FAR everywhere; changed in place to the lengths in hundredths of a point.
        queues: int32 (2, h * w, 2), overwritten: straight and diagonal steps, each the point that it leads to and the
            length up to there.

    Returns:
        The number of steps in each queue, which `forget` needs.
    """
    ground, lengths = is_open.ravel(), length.ravel()
    straight, diagonal = queues[0], queues[1]
    stride = is_open.shape[1]
    step = (1, stride + 1, stride, stride - 1, -1, -stride - 1, -stride, -stride + 1)
    straight_head, straight_tail, diagonal_head, diagonal_tail = 0, starts.size, 0, 0
    for number in range(starts.size):
        lengths[starts[number]] = 0
        straight[number, 0], straight[number, 1] = starts[number], 0
    # An entry is out of date when a shorter way has come since. Lengths come in ascending order, so a point is entered
    # into each queue once at most.
    while straight_head < straight_tail or diagonal_head < diagonal_tail:
        by_diagonal = straight_head >= straight_tail
        if not by_diagonal and diagonal_head < diagonal_tail:
            # At equal lengths either may come first: lengths do not depend on it.
            by_diagonal = diagonal[diagonal_head, 1] <= straight[straight_head, 1]
        if by_diagonal:
            here, far = diagonal[diagonal_head, 0], diagonal[diagonal_head, 1]
            diagonal_head += 1
        else:
            here, far = straight[straight_head, 0], straight[straight_head, 1]
            straight_head += 1
        if here == stop:
            break
        if far != lengths[here]:
            continue
        for way in range(8):
            ahead = here + step[way]
            away = far + (141 if way & 1 else 100)
            if ground[index(ahead)] == 0 or away >= lengths[index(ahead)] or away > limit:
                continue
            if way & 1 and (ground[index(here + step[way - 1])] == 0 or ground[index(here + step[(way + 1) & 7])] == 0):
                continue
            lengths[index(ahead)] = away
            if way & 1:
                diagonal[diagonal_tail, 0], diagonal[diagonal_tail, 1] = ahead, away
                diagonal_tail += 1
            else:
                straight[straight_tail, 0], straight[straight_tail, 1] = ahead, away
                straight_tail += 1
    return straight_tail, diagonal_tail


@njit(types.void(LENGTHS, QUEUES, USED), cache=True, nogil=True)
def forget(length, queues, used):
    """Set the lengths that a wave has found back to FAR.

    Args:
        length: As for `wave`.
        queues: As `wave` left them.
        used: As `wave` returned it.
    """
    lengths = length.ravel()
    for entry in range(used[0]):
        # Only what was entered: far faster than the whole grid where a wave stopped early.
        lengths[queues[0, entry, 0]] = FAR
    for entry in range(used[1]):
        lengths[queues[1, entry, 0]] = FAR


@njit(int64(GRID, PLACES, int64, LENGTHS), cache=True, nogil=True)
def lengths_between(is_open, places, limit, lengths):
    """Find the lengths of the ways between places.

    For example, 282 between two places that are two diagonal steps apart.

    Ways up to the limit are exact. A longer one is the shortest that leads through other places (Dijkstra).

    Args:
        is_open: As for `wave`.
        places: int64 (n,), flat indices of open points, all different.
        limit: Of the ways that are searched for, in hundredths of a point.
        lengths: int32 (n, n), hundredths of a point; overwritten, FAR where no way was found.

    Returns:
        The number of ordered pairs of places without a way.
    """
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    queues = np.empty((2, is_open.size, 2), dtype=np.int32)
    for first in range(places.size):
        used = wave(is_open, places[first : first + 1], -1, limit, length, queues)
        for second in range(places.size):
            lengths[first, second] = length.ravel()[places[second]]
        forget(length, queues, used)
    begins = np.zeros(places.size + 1, dtype=np.int64)
    for first in range(places.size):
        begins[first + 1] = begins[first] + np.count_nonzero(lengths[first] != FAR)
    pairs = begins[places.size]
    near, steps = np.empty(pairs, dtype=np.int64), np.empty(pairs, dtype=np.int64)
    for first in range(places.size):
        near[begins[first] : begins[first + 1]] = np.flatnonzero(lengths[first] != FAR)
        steps[begins[first] : begins[first + 1]] = lengths[first][lengths[first] != FAR]
    missing = 0
    for first in range(places.size):
        if begins[first + 1] - begins[first] == places.size:
            continue  # all are exact
        away = lengths[first]
        heap = [(steps[k], near[k]) for k in range(begins[first], begins[first + 1])]
        heapify(heap)
        while heap:
            far, here = heappop(heap)
            # An entry is out of date when a shorter way has come since.
            if far > away[here]:
                continue
            for k in range(begins[here], begins[here + 1]):
                if far + steps[k] < away[near[k]]:
                    away[near[k]] = far + steps[k]
                    heappush(heap, (far + steps[k], near[k]))
        missing += int(np.count_nonzero(away == FAR))
    return missing


@njit(types.boolean(GRID, int64, int64), cache=True, nogil=True)
def is_clear(is_open, first, last):
    """Return True if the straight line between two points' centres crosses open points only.

    A line through the corner of four points needs all four of them.

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be.
        first: Flat index of a point.
        last: Flat index of another one.
    """
    ground = is_open.ravel()
    stride = is_open.shape[1]
    row, col = first // stride, first % stride
    up, across = last // stride - row, last % stride - col
    step_row, step_col = (stride if up > 0 else -stride), (1 if across > 0 else -1)
    up, across = abs(up), abs(across)
    here = first
    # How far the line has come across borders of rows and of columns; both are over 2 * up * across.
    next_row, next_col = across, up
    while here != last:
        if ground[index(here)] == 0:
            return False
        if up == 0 or (across != 0 and next_col < next_row):
            here += step_col
            next_col += 2 * up
        elif across == 0 or next_row < next_col:
            here += step_row
            next_row += 2 * across
        else:
            if ground[index(here + step_row)] == 0 or ground[index(here + step_col)] == 0:
                return False
            here += step_row + step_col
            next_row += 2 * across
            next_col += 2 * up
    return ground[last] != 0


@njit(int64(GRID, int64, int64, KNOWN_LENGTHS, WAY), cache=True, nogil=True)
def corners(is_open, first, last, length, way):
    """Follow a way down the lengths, pulled taut: a corner wherever the one before goes out of sight.

    Args:
        is_open: As for `wave`.
        first: Flat index of a point from which a way leads to the last one.
        last: Flat index of a point.
        length: int32 (h, w), lengths of the ways to the last point, as `wave` finds them.
        way: int32 (n,), overwritten with the flat indices of the way's corners, from the first point on, as many as
            there is room for.

    Returns:
        The number of corners.
    """
    ground, lengths = is_open.ravel(), length.ravel()
    stride = is_open.shape[1]
    step = (1, stride + 1, stride, stride - 1, -1, -stride - 1, -stride, -stride + 1)
    # The order decides between equally long ways, so traces depend on it.
    order = (0, 2, 4, 6, 1, 3, 5, 7)
    way[0] = first
    count, here, before = 1, first, first
    while here != last and count < way.size:
        for turn in order:
            ahead = here + step[turn]
            cost = 141 if turn & 1 else 100
            if ground[ahead] == 0 or lengths[ahead] == FAR or lengths[ahead] + cost != lengths[here]:
                continue
            if turn & 1 and (ground[here + step[turn - 1]] == 0 or ground[here + step[(turn + 1) & 7]] == 0):
                continue
            before, here = here, ahead
            break
        # The point before is the last that the corner before still sees.
        if not is_clear(is_open, way[count - 1], here):
            way[count] = before
            count += 1
    if count < way.size and first != last:
        way[count] = last
        count += 1
    return count


@njit(int64(GRID, int64, int64, LENGTHS, QUEUES, WAY), cache=True, nogil=True)
def way_between(is_open, first, last, length, queues, way):
    """Find a short way between two points: the straight line, else the shortest way pulled taut.

    Args:
        is_open: As for `wave`.
        first: Flat index of an open point.
        last: Flat index of an open point.
        length: int32 (h, w), FAR everywhere, before and after.
        queues: As for `wave`.
        way: int32 (h * w,), overwritten with the flat indices of the way's corners, with both ends. Straight lines
            between them are open.

    Returns:
        The number of corners; 0 where no way leads from the first point to the last.
    """
    way[0], way[1] = first, last
    if is_clear(is_open, first, last):
        return 2
    # From the end, since `corners` follows falling lengths and then gives the way in driving order.
    used = wave(is_open, np.array([last]), first, FAR, length, queues)
    count = 0
    if length.ravel()[first] != FAR:
        count = corners(is_open, first, last, length, way)
    forget(length, queues, used)
    return count
