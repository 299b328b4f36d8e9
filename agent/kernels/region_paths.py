"""Kernels of the region method: paths are straight within a region and pass to the next one at connections.

Regions are given by their parts (see `patrol.regions.split.RegionSplit`): within a part a body can go straight from
any point to any other, and each connection joins two parts. Places are rows and columns of the terrain's points.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
GRID = types.Array(types.int32, 2, "C")
FIXED = types.Array(types.int32, 2, "C", readonly=True)
INTS = types.Array(types.int32, 1, "C")
INDICES = types.Array(types.int32, 1, "C", readonly=True)
REALS = types.Array(types.float64, 1, "C")
float64 = types.float64
int64 = types.int64
void = types.void


@njit(void(INTS, INTS, REALS, int64, int64), cache=True, nogil=True)
def _rise(heap, at, away, slot, connection):
    """Move a connection up a heap from a slot: nearer ones are above, and among equals the lower numbers."""
    while slot > 0:
        above = (slot - 1) // 2
        upper = heap[above]
        if away[upper] < away[connection] or (away[upper] == away[connection] and upper < connection):
            break
        heap[slot] = upper
        at[upper] = slot
        slot = above
    heap[slot] = connection
    at[connection] = slot


@njit(int64(INTS, INTS, REALS, int64), cache=True, nogil=True)
def _pop(heap, at, away, size):
    """Remove and return the nearest connection of a heap of `size`."""
    nearest = heap[0]
    last = heap[size - 1]
    slot = 0
    while 2 * slot + 1 < size - 1:
        below = 2 * slot + 1
        if below + 1 < size - 1:
            first, second = heap[below], heap[below + 1]
            if away[second] < away[first] or (away[second] == away[first] and second < first):
                below += 1
        lower = heap[below]
        if away[last] < away[lower] or (away[last] == away[lower] and last < lower):
            break
        heap[slot] = lower
        at[lower] = slot
        slot = below
    heap[slot] = last
    at[last] = slot
    # -2 and not -1: settled, so that no way puts it into the heap again.
    at[nearest] = -2
    return nearest


# fmt: off
@njit(
    int64(
        INDICES, INDICES, INDICES, FIXED, FIXED, INDICES, INDICES, float64,
        REALS, INTS, INTS, INTS, INTS, INTS, INTS, INTS, REALS, INTS,
    ),
    cache=True,
    nogil=True,
)
def route(
    start_row, start_col, start_part, places, joined, first, members, limit,
    away, lead, came, heap, at, begin, source_row, source_col, source_away, source_lead,
):
    """Shortest ways from the nearest of some starts to all connections, and where the last legs of paths begin.

    Args:
        start_row: int32 (k,), the starts' rows; a start in several parts appears once for each.
        start_col: int32 (k,), their columns.
        start_part: int32 (k,), a part that contains each start.
        places: int32 (n, 2), row and column of each connection.
        joined: int32 (n, 2), the parts that each connection joins.
        first: int32 (p + 1,), where each part's entries in ``members`` begin.
        members: int32 (2 n,); members[first[i] : first[i + 1]] are the connections of part i.
        limit: Longest way to follow, in points.
        away: float64 (n,), scratch: length of the way to each connection, in points.
        lead: int32 (n,), scratch: first connection of each way.
        came: int32 (n,), scratch: part of the last leg of each way.
        heap: int32 (n,), scratch: a heap of connections.
        at: int32 (n,), scratch: where in the heap each connection is.
        begin: int32 (p + 1,), overwritten: sources begin[i] to begin[i + 1] belong to part i. A source is a place where
            a path's last leg may begin.
        source_row: int32 (2 n + k,), the first entries overwritten: the sources' rows.
        source_col: int32 (2 n + k,), likewise: their columns.
        source_away: float64 (2 n + k,), likewise: lengths of the ways to them, in points.
        source_lead: int32 (2 n + k,), likewise: first connection of the path, or -1 where the source is a start.

    Returns:
        The number of sources.
    """
    away[:] = math.inf
    at[:] = -1
    size = 0
    for k in range(start_row.shape[0]):
        part = start_part[k]
        for index in range(first[part], first[part + 1]):
            link = members[index]
            far = math.hypot(places[link, 0] - start_row[k], places[link, 1] - start_col[k])
            # A start on a connection is in both its parts and needs no way to it.
            if far == 0.0 or far > limit or far >= away[link]:
                continue
            away[link], lead[link], came[link] = far, link, part
            if at[link] < 0:
                at[link] = size
                size += 1
            _rise(heap, at, away, at[link], link)
    while size > 0:
        link = _pop(heap, at, away, size)
        size -= 1
        # Go on in the other part: within the same part the direct way is never longer.
        part = joined[link, 0] + joined[link, 1] - came[link]
        for index in range(first[part], first[part + 1]):
            onward = members[index]
            if at[onward] == -2:
                continue
            far = away[link] + math.hypot(places[onward, 0] - places[link, 0], places[onward, 1] - places[link, 1])
            if far > limit or far >= away[onward]:
                continue
            away[onward], lead[onward], came[onward] = far, lead[link], part
            if at[onward] < 0:
                at[onward] = size
                size += 1
            _rise(heap, at, away, at[onward], onward)
    count = 0
    for part in range(first.shape[0] - 1):
        begin[part] = count
        for k in range(start_row.shape[0]):
            if start_part[k] == part:
                source_row[count], source_col[count] = start_row[k], start_col[k]
                source_away[count], source_lead[count] = 0.0, -1
                count += 1
        for index in range(first[part], first[part + 1]):
            link = members[index]
            # A path that came through this part would have gone straight to the point.
            if away[link] < math.inf and came[link] != part:
                source_row[count], source_col[count] = places[link, 0], places[link, 1]
                source_away[count], source_lead[count] = away[link], lead[link]
                count += 1
    begin[first.shape[0] - 1] = count
    return count


@njit(
    void(
        STATE, GRID, GRID, FIXED, FIXED, int64, int64, int64, int64, int64, int64, int64,
        INTS, INTS, INTS, REALS, INTS,
    ),
    cache=True,
    nogil=True,
)
def last_legs(
    state, length, bend, parts, places, row0, col0, top, bottom, left, right, limit,
    begin, source_row, source_col, source_away, source_lead,
):
    """Settle every open point in a box of the window whose path is short enough.

    Of equally long paths the one through the first source is taken.

    Args:
        state: uint8 (m, n), see `agent.kernels.wave.HEMMED`; changed in place.
        length: int32 (m, n), path lengths rounded to the nearest hundredth of a point; filled in.
        bend: int32 (m, n), flat index into the window of each path's first bend; filled in.
        parts: int32 (h, w), each point's part, -1 for none.
        places: int32 (n, 2), as in `route`.
        row0: Row of the terrain's point under element (0, 0) of the window.
        col0: Column of the same point.
        top: First row of the box in the window.
        bottom: End row of the box, exclusive.
        left: First column of the box.
        right: End column of the box, exclusive.
        limit: Longest path to settle, in hundredths of a point.
        begin: As `route` left it, like all that follow.
        source_row: See `route`.
        source_col: See `route`.
        source_away: See `route`.
        source_lead: See `route`.
    """
    cols = state.shape[1]
    shortest = np.empty(cols)
    leads = np.empty(cols, dtype=np.int32)
    for row in range(max(top, -row0), min(bottom, parts.shape[0] - row0)):
        stop = max(left, -col0)
        while stop < min(right, parts.shape[1] - col0):
            # One run of points of the same part at a time keeps the inner loops simple enough to be vectorised.
            start = stop
            part = parts[row0 + row, col0 + start]
            while stop < min(right, parts.shape[1] - col0) and parts[row0 + row, col0 + stop] == part:
                stop += 1
            if part < 0 or begin[part] == begin[part + 1]:
                continue
            for k in range(begin[part], begin[part + 1]):
                up = float64(row0 + row - source_row[k])
                offset = float64(col0 - source_col[k])
                base, lead = source_away[k], source_lead[k]
                if k == begin[part]:
                    for col in range(start, stop):
                        shortest[col] = base + math.sqrt(up * up + (offset + col) * (offset + col))
                        leads[col] = lead
                else:
                    for col in range(start, stop):
                        far = base + math.sqrt(up * up + (offset + col) * (offset + col))
                        nearer = far < shortest[col]
                        shortest[col] = far if nearer else shortest[col]
                        leads[col] = lead if nearer else leads[col]
            for col in range(start, stop):
                length_cm = int64(100.0 * shortest[col] + 0.5)
                if length_cm <= limit and state[row, col] & 3 != 0:
                    state[row, col] |= 3
                    length[row, col] = length_cm
                    bend[row, col] = row * cols + col
                    if leads[col] >= 0:
                        bend[row, col] = (places[leads[col], 0] - row0) * cols + places[leads[col], 1] - col0


# fmt: on
