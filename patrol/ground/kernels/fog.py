"""Kernels of the fog: observations, at the cost of a footprint.

``last_seen`` holds the tick at which each point was last seen, -1 where it never was. A point never seen counts as
seen at tick 0, so both have the age k. ``histogram[last_seen + 1]`` counts the tracked points with that value; the
oldest bin that is not empty gives the MFoW.
"""

from __future__ import annotations

from numba import njit, types

TRACKED = types.Array(types.uint8, 2, "C", readonly=True)
SEEN = types.Array(types.int32, 2, "C")
HISTOGRAM = types.Array(types.int64, 1, "C")
VIEW = types.Array(types.uint8, 2, "C", readonly=True)
QUALITY = types.Array(types.float64, 2, "C", readonly=True)
BOX = types.Array(types.int64, 1, "C")
int64 = types.int64


@njit(
    [
        int64(SEEN, TRACKED, HISTOGRAM, VIEW, quality, int64, int64, int64, BOX)
        for quality in (types.none, QUALITY)  # each compiled by itself: without qualities it costs a tenth less
    ],
    cache=True,
    nogil=True,
)
def observe(last_seen, tracked, histogram, view, quality, row0, col0, tick, box):
    """Take in the tracked points of a footprint. A point already seen at `tick` or later stays as it is.

    Args:
        last_seen: int32 (h, w).
        tracked: uint8 (h, w).
        histogram: Counts of tracked points by last_seen + 1.
        view: uint8 (m, m), its element (0, 0) lies over point (row0, col0).
        quality: float64 (m, m) in [0, 1], laid over the points like `view`, for a sensor that leaves floor(age * (1 -
            quality)) ticks of a point's age; None for one that leaves nothing.
        row0: Of the grid, under the view's row 0.
        col0: Of the grid, under the view's column 0.
        tick: Now.
        box: int64 (4,), overwritten with the first and last row and column that changed (first > last: none did).

    Returns:
        The increase of the sum of last-seen ticks.
    """
    height, width = last_seen.shape
    box[0] = height
    box[1] = -1
    box[2] = width
    box[3] = -1
    gained = 0
    taken = 0
    # Neighbours were mostly seen in the same tick: they leave its bin together.
    leaving, left = -1, 0
    begin, end = max(0, -col0), min(view.shape[1], width - col0)
    if begin >= end:
        return 0
    for i in range(max(0, -row0), min(view.shape[0], height - row0)):
        r = row0 + i
        # Slices, for an index into one of them cannot be below zero, which would have to be asked of each point.
        in_view, counts = view[i, begin:end], tracked[r, col0 + begin : col0 + end]
        seen = last_seen[r, col0 + begin : col0 + end]
        first, last = width, -1
        for j in range(in_view.size):
            if in_view[j] == 0 or counts[j] == 0:
                continue
            old = seen[j]
            if old >= tick:
                continue
            since = max(old, 0)
            new = tick
            if quality is not None:
                new -= int((tick - since) * (1.0 - quality[i, begin + j]))
                if new <= old:
                    continue
                histogram[new + 1] += 1
            seen[j] = new
            if old != leaving:
                histogram[leaving + 1] -= left
                leaving, left = old, 0
            left += 1
            taken += 1
            gained += new - since
            first = min(first, j)
            last = j
        if last >= 0:
            box[0] = min(box[0], r)
            box[1] = r
            box[2] = min(box[2], col0 + begin + first)
            box[3] = max(box[3], col0 + begin + last)
    histogram[leaving + 1] -= left
    if quality is None:
        histogram[tick + 1] += taken
    return gained


@njit(int64(SEEN, TRACKED, int64, int64), cache=True, nogil=True)
def find(last_seen, tracked, tick, begin):
    """The first tracked point that was last seen at a tick, row by row.

    Args:
        last_seen: int32 (h, w).
        tracked: uint8 (h, w).
        tick: The tick.
        begin: Flat index of the point to begin with.

    Returns:
        Its flat index, or -1 where there is none.
    """
    seen, counts = last_seen.ravel(), tracked.ravel()
    for at in range(max(begin, 0), seen.size):
        if seen[at] == tick and counts[at] != 0:
            return at
    return -1
