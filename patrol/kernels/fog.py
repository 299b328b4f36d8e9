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
    """Take the tracked points of a footprint in at ``tick``; return by how much the sum of last-seen ticks grew.

    last_seen: int32 (h, w). tracked: uint8 (h, w). view: uint8 (m, m), its element (0, 0) lies over point
    (row0, col0). quality: float64 (m, m) in [0, 1], laid over the points like ``view``, for a sensor that leaves
    floor(age * (1 - quality)) ticks of a point's age; None for one that leaves nothing. box: int64 (4,), the first and
    last row and column that changed (first > last: none did). A point already seen at ``tick`` or later stays as it is.
    """
    height, width = last_seen.shape
    box[0] = height
    box[1] = -1
    box[2] = width
    box[3] = -1
    gained = 0
    for i in range(max(0, -row0), min(view.shape[0], height - row0)):
        r = row0 + i
        for j in range(max(0, -col0), min(view.shape[1], width - col0)):
            c = col0 + j
            if view[i, j] == 0 or tracked[r, c] == 0:
                continue
            old = last_seen[r, c]
            if old >= tick:
                continue
            since = max(old, 0)
            new = tick
            if quality is not None:
                new -= int((tick - since) * (1.0 - quality[i, j]))
                if new <= old:
                    continue
            last_seen[r, c] = new
            histogram[old + 1] -= 1
            histogram[new + 1] += 1
            gained += new - since
            box[0] = min(box[0], r)
            box[1] = max(box[1], r)
            box[2] = min(box[2], c)
            box[3] = max(box[3], c)
    return gained
