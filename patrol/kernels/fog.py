"""Kernels of the fog: observations, at the cost of a footprint, and the points that were not seen for longest.

``last_seen`` holds the tick at which each point was last seen, -1 where it never was. A point never seen counts as
seen at tick 0, so both have the age k. Last-seen ticks only grow.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

TRACKED = types.Array(types.uint8, 2, "C", readonly=True)
SEEN = types.Array(types.int32, 2, "C")
VIEW = types.Array(types.uint8, 2, "C", readonly=True)
VIEWS = types.Array(types.uint8, 3, "C", readonly=True)
MASKS = types.Array(types.uint8, 3, "C")
QUALITY = types.Array(types.float64, 2, "C", readonly=True)
NUMBERS = types.Array(types.int64, 1, "C", readonly=True)
CHOSEN = types.Array(types.uint8, 1, "C", readonly=True)
OLDEST = types.Array(types.int32, 1, "C")
int64 = types.int64
GAINS = types.UniTuple(int64, 2)  # type: ignore[no-untyped-call]

_ZERO, _LATEST = np.int32(0), np.int32(2**31 - 1)


@njit(
    [GAINS(SEEN, TRACKED, VIEW, quality, int64, int64, int64) for quality in (types.none, QUALITY)],
    cache=True,
    nogil=True,
)
def observe(last_seen, tracked, view, quality, row0, col0, tick):
    """Take in the tracked points of a footprint. A point already seen at `tick` or later stays as it is.

    For example, three points last seen at -1, 4 and -1 that are seen at tick 9 give the increase 23 and 2 first times.

    Args:
        last_seen: int32 (h, w); changed in place.
        tracked: uint8 (h, w), 1 for the points that count.
        view: uint8 (m, m), 1 where a point is seen; its element (0, 0) lies over point (row0, col0).
        quality: float64 (m, m) in [0, 1], laid over the points like `view`, for a sensor that leaves floor(age * (1 -
            quality)) ticks of a point's age; None for one that leaves nothing.
        row0: Of the grid, under the view's row 0; may be negative.
        col0: Of the grid, under the view's column 0; may be negative.
        tick: Of the observation.

    Returns:
        The increase of the sum of last-seen ticks, and how many points were seen for the first time.
    """
    height, width = last_seen.shape
    gained, first = 0, 0
    now = np.int32(tick)
    # So few columns at a time that what they gain fits into the 32 bits that vector instructions add up.
    piece = 2**31 // (tick + 1)
    for i in range(max(0, -row0), min(view.shape[0], height - row0)):
        # Cut to the grid before, so neither `r` nor a column is negative.
        r = row0 + i
        for begin in range(max(0, -col0), min(view.shape[1], width - col0), piece):
            end = min(begin + piece, view.shape[1], width - col0)
            # Slices, for an index into one of them cannot be below zero, which would have to be asked of each point.
            in_view, counts = view[i, begin:end], tracked[r, col0 + begin : col0 + end]
            ticks = last_seen[r, col0 + begin : col0 + end]
            gain, new_points = np.int32(0), np.int32(0)
            for j in range(in_view.size):
                seen_before = ticks[j]
                seen_after = now
                if quality is not None:
                    seen_after = np.int32(tick - int((tick - max(seen_before, _ZERO)) * (1.0 - quality[i, begin + j])))
                # A selection without a branch, which the compiler can turn into vector code.
                seen_after = max(seen_before, seen_after) if in_view[j] & counts[j] != 0 else seen_before
                ticks[j] = seen_after
                gain = np.int32(gain + np.int32(max(seen_after, _ZERO) - max(seen_before, _ZERO)))
                # A shift gives the sign, -1 or 0, so the difference is 1 where a point is first seen.
                new_points = np.int32(new_points + np.int32(np.int32(seen_after >> 31) - np.int32(seen_before >> 31)))
            gained += int(gain)
            first += int(new_points)
    return gained, first


@njit(types.void(MASKS, TRACKED, NUMBERS, NUMBERS), cache=True, nogil=True)
def keep_tracked(views, tracked, rows, cols):
    """Leave the points that do not count out of many footprints.

    Args:
        views: uint8 (f, m, m), each as of `observe`; changed in place.
        tracked: uint8 (h, w), 1 for the points that count.
        rows: int64 (f,), the grid's row under each view's row 0.
        cols: int64 (f,), the grid's column under its column 0.
    """
    height, width = tracked.shape
    for k in range(views.shape[0]):
        # A view that lies beside the grid gives an empty range and not a negative one.
        begin = max(0, -cols[k])
        end = max(begin, min(views.shape[2], width - cols[k]))
        for i in range(max(0, -rows[k]), min(views.shape[1], height - rows[k])):
            view, counts = views[k, i, begin:end], tracked[rows[k] + i, cols[k] + begin : cols[k] + end]
            for j in range(view.size):
                view[j] &= counts[j]


@njit(types.void(SEEN, VIEWS, NUMBERS, NUMBERS, NUMBERS, CHOSEN), cache=True, nogil=True)
def observe_each(last_seen, views, rows, cols, ticks, chosen):
    """Take in some of many footprints of a sensor that leaves nothing of a point's age, and count nothing.

    Args:
        last_seen: int32 (h, w); changed in place.
        views: uint8 (f, m, m), each as of `observe`, of points that count alone.
        rows: int64 (f,), the grid's row under each view's row 0.
        cols: int64 (f,), the grid's column under its column 0.
        ticks: int64 (f,), of the observations.
        chosen: uint8 (f,), not 0 for the footprints to take in.
    """
    height, width = last_seen.shape
    size = views.shape[1]
    for k in range(chosen.size):
        begin, end = max(0, -cols[k]), min(size, width - cols[k])
        if chosen[k] == 0 or begin >= end:
            continue
        now = np.int32(ticks[k])
        for i in range(max(0, -rows[k]), min(size, height - rows[k])):
            r = rows[k] + i
            in_view, row_ticks = views[k, i, begin:end], last_seen[r, cols[k] + begin : cols[k] + end]
            for j in range(in_view.size):
                row_ticks[j] = max(row_ticks[j], now) if in_view[j] != 0 else row_ticks[j]


@njit(int64(SEEN, TRACKED, OLDEST), cache=True, nogil=True)
def stalest_row(last_seen, tracked, oldest):
    """Find a row that holds one of the tracked points that were not seen for longest.

    For example, with bounds 3, 5 and 4, row 0 is read first. If its stalest point was seen at 6, its bound becomes 6
    and row 2 is next.

    Only a row that might hold one is looked at: most others are known to have been seen later.

    Args:
        last_seen: int32 (h, w).
        tracked: uint8 (h, w), 1 for the points that count.
        oldest: int32 (h,), a tick before which no point of each row was last seen; changed in place.

    Returns:
        The row; its element of `oldest` is the tick at which its stalest point was last seen.
    """
    while True:
        row = np.uint64(oldest.argmin())
        ticks, counts = last_seen[row], tracked[row]
        earliest = _LATEST
        for j in range(ticks.size):
            earliest = min(earliest, ticks[j] if counts[j] != 0 else _LATEST)
        # The least bound of all is exact, so no other row can hold an older point.
        if earliest == oldest[row]:
            return row
        # Bounds only rise, up to the stalest point of their row, so the search ends.
        oldest[row] = earliest
