"""Kernels of the tour: path lengths between places, and a short closed tour through them."""

from __future__ import annotations

import numpy as np
from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
PLACES = types.Array(types.int64, 1, "C", readonly=True)
LENGTHS = types.Array(types.int32, 2, "C")
KNOWN_LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
TOUR = types.Array(types.int64, 1, "C")
USED = types.Array(types.int64, 1, "C")
WORK = types.Array(types.int32, 1, "C")
QUEUE = types.Array(types.int32, 1, "C")

FAR = 2**31 - 1
"""The length of what no path leads to."""


@njit(
    types.void(GRID, types.int64, types.int64, types.int64, WORK, QUEUE, QUEUE, USED),
    cache=True,
    nogil=True,
)
def wave(is_open, start, stop, limit, length, straight, diagonal, used):
    """Shortest 8-connected paths from a point: steps cost 100 and 141, no path cuts a corner.

    Two first-in first-out queues, one per step cost, each stay sorted by length (see the wave of the robots' planning).

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be; its outermost points are 0.
        start: Flat index of an open point.
        stop: Flat index of a point whose length ends the wave, or -1: points that are farther may have none then.
        limit: The longest path, in hundredths of a point.
        length: int32 (h * w,), FAR everywhere; changed in place to the lengths in hundredths of a point.
        straight: int32 (2 * h * w + 2,), scratch.
        diagonal: int32 (2 * h * w + 2,), scratch.
        used: int64 (2,), overwritten with how much of the two queues was used, which `forget` needs.
    """
    ground = is_open.ravel()
    stride = is_open.shape[1]
    step = (1, stride, -1, -stride, stride + 1, stride - 1, -stride - 1, -stride + 1)
    side_a = (1, -1, -1, 1)
    side_b = (stride, stride, -stride, -stride)
    length[start] = 0
    straight[0], straight[1] = start, 0
    straight_head, straight_tail, diagonal_head, diagonal_tail = 0, 2, 0, 0
    # An entry is a point and its length; it is out of date when a shorter path has come since. Lengths come in
    # ascending order, so a point is entered into each queue once at most.
    while straight_head < straight_tail or diagonal_head < diagonal_tail:
        by_diagonal = straight_head >= straight_tail
        if not by_diagonal and diagonal_head < diagonal_tail:
            by_diagonal = diagonal[diagonal_head + 1] <= straight[straight_head + 1]
        if by_diagonal:
            here, far = diagonal[diagonal_head], diagonal[diagonal_head + 1]
            diagonal_head += 2
        else:
            here, far = straight[straight_head], straight[straight_head + 1]
            straight_head += 2
        if here == stop:
            break
        if far != length[here]:
            continue
        for way in range(8):
            there = here + step[way]
            cost = 100 if way < 4 else 141
            if ground[there] == 0 or far + cost >= length[there] or far + cost > limit:
                continue
            if way >= 4 and (ground[here + side_a[way - 4]] == 0 or ground[here + side_b[way - 4]] == 0):
                continue
            length[there] = far + cost
            if way < 4:
                straight[straight_tail], straight[straight_tail + 1] = there, far + cost
                straight_tail += 2
            else:
                diagonal[diagonal_tail], diagonal[diagonal_tail + 1] = there, far + cost
                diagonal_tail += 2
    used[0], used[1] = straight_tail, diagonal_tail


@njit(types.void(WORK, QUEUE, QUEUE, USED), cache=True, nogil=True)
def forget(length, straight, diagonal, used):
    """Set what a wave has reached back to FAR.

    Args:
        length: As for `wave`.
        straight: As `wave` left it.
        diagonal: As `wave` left it.
        used: As `wave` left it.
    """
    for entry in range(0, used[0], 2):
        length[straight[entry]] = FAR
    for entry in range(0, used[1], 2):
        length[diagonal[entry]] = FAR


@njit(types.int64(GRID, PLACES, LENGTHS, WORK, QUEUE, QUEUE, types.int64), cache=True, nogil=True)
def lengths_between(is_open, places, lengths, length, straight, diagonal, limit):
    """Lengths of the paths of `wave` between places.

    Paths up to the limit are exact. A longer one is the shortest that leads through other places (Floyd-Warshall).

    Args:
        is_open: uint8 (h, w), non-zero where a body's centre may be; its outermost points are 0.
        places: int64 (n,), flat indices of open points, all different.
        lengths: int32 (n, n), hundredths of a point; overwritten, FAR where no path was found.
        length: int32 (h * w,), FAR everywhere, before and after.
        straight: int32 (2 * h * w + 2,), scratch.
        diagonal: int32 (2 * h * w + 2,), scratch.
        limit: Of the paths that are searched for, in hundredths of a point.

    Returns:
        The number of ordered pairs of places without a path.
    """
    used = np.empty(2, np.int64)
    for first in range(places.size):
        wave(is_open, places[first], -1, limit, length, straight, diagonal, used)
        for other in range(places.size):
            lengths[first, other] = length[places[other]]
        forget(length, straight, diagonal, used)
    missing = 0
    for by in range(places.size):
        for first in range(places.size):
            to = lengths[first, by]
            if to == FAR:
                continue
            for last in range(places.size):
                if lengths[by, last] != FAR and to + lengths[by, last] < lengths[first, last]:
                    lengths[first, last] = to + lengths[by, last]
    for first in range(places.size):
        for last in range(places.size):
            missing += lengths[first, last] == FAR
    return missing


@njit(types.boolean(GRID, types.int64, types.int64), cache=True, nogil=True)
def clear_line(is_open, first, last):
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
        if ground[here] == 0:
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


@njit(types.int64(GRID, types.int64, types.int64, WORK, QUEUE, QUEUE, WORK), cache=True, nogil=True)
def way_between(is_open, first, last, length, straight, diagonal, way):
    """A short way between two places: the straight line, else a shortest 8-connected path pulled taut.

    Args:
        is_open: As for `lengths_between`.
        first: Flat index of an open point.
        last: Flat index of an open point, connected with the first.
        length: As for `lengths_between`.
        straight: As for `lengths_between`.
        diagonal: As for `lengths_between`.
        way: int32 (h * w,), overwritten with the flat indices of the way's corners, from the first point to the last.

    Returns:
        The number of corners; between two of them the straight line is open.
    """
    way[0] = first
    if first == last:
        return 1
    if clear_line(is_open, first, last):
        way[1] = last
        return 2
    ground = is_open.ravel()
    stride = is_open.shape[1]
    step = (1, stride, -1, -stride, stride + 1, stride - 1, -stride - 1, -stride + 1)
    side_a = (1, -1, -1, 1)
    side_b = (stride, stride, -stride, -stride)
    used = np.empty(2, np.int64)
    wave(is_open, last, first, FAR, length, straight, diagonal, used)
    # Down the lengths, and a corner wherever the point before the last one goes out of sight.
    corners, here, before = 1, first, first
    while here != last:
        for turn in range(8):
            there = here + step[turn]
            cost = 100 if turn < 4 else 141
            if ground[there] == 0 or length[there] == FAR or length[there] + cost != length[here]:
                continue
            if turn >= 4 and (ground[here + side_a[turn - 4]] == 0 or ground[here + side_b[turn - 4]] == 0):
                continue
            before, here = here, there
            break
        if not clear_line(is_open, way[corners - 1], here):
            way[corners] = before
            corners += 1
    way[corners] = last
    forget(length, straight, diagonal, used)
    return corners + 1


@njit(types.int64(KNOWN_LENGTHS, TOUR), cache=True, nogil=True)
def shorten(lengths, tour):
    """Improve a closed tour in place until no move of 2-opt or Or-opt shortens it.

    2-opt (Croes 1958) reverses a part of the tour; Or-opt (Or 1976) moves one to three consecutive places to another
    edge, in either direction. Each pass makes every move that shortens the tour as soon as it is found.

    Args:
        lengths: int32 (n, n), symmetric.
        tour: int64 (n,), a permutation of 0 to n - 1; changed in place.

    Returns:
        The length of the tour.
    """
    n = tour.size
    better = n > 3
    moved = tour[:3].copy()
    while better:
        better = False
        for i in range(n - 2):
            for j in range(i + 2, n - (i == 0)):
                a, b, c, d = tour[i], tour[i + 1], tour[j], tour[(j + 1) % n]
                if lengths[a, c] + lengths[b, d] < lengths[a, b] + lengths[c, d]:
                    low, high = i + 1, j
                    while low < high:
                        tour[low], tour[high] = tour[high], tour[low]
                        low += 1
                        high -= 1
                    better = True
        for size in range(1, min(4, n - 2)):
            for i in range(n):
                before, after = tour[i - 1], tour[(i + size) % n]
                first, last = tour[i], tour[(i + size - 1) % n]
                gain = lengths[before, first] + lengths[last, after] - lengths[before, after]
                best, at, turned = 0, -1, False
                for k in range(size, n - 1):  # the edge from place i + k to the next
                    a, b = tour[(i + k) % n], tour[(i + k + 1) % n]
                    cut = gain + lengths[a, b]
                    if cut - lengths[a, first] - lengths[last, b] > best:
                        best, at, turned = cut - lengths[a, first] - lengths[last, b], k, False
                    if cut - lengths[a, last] - lengths[first, b] > best:
                        best, at, turned = cut - lengths[a, last] - lengths[first, b], k, True
                if at < 0:
                    continue
                for m in range(size):
                    moved[m] = tour[(i + m) % n]
                for m in range(size, at + 1):  # those between move back
                    tour[(i + m - size) % n] = tour[(i + m) % n]
                for m in range(size):
                    tour[(i + at + 1 - size + m) % n] = moved[size - 1 - m] if turned else moved[m]
                better = True
    total = 0
    for i in range(n):
        total += lengths[tour[i - 1], tour[i]]
    return total
