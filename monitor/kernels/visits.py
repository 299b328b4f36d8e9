"""Kernels that add up the fog over time point by point, with work in proportion to the footprints."""

from __future__ import annotations

from numba import njit, types

SEEN = types.Array(types.int32, 2, "C", readonly=True)
TRACKED = types.Array(types.uint8, 2, "C", readonly=True)
VIEW = types.Array(types.uint8, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C")
SUMS = types.Array(types.int64, 2, "C")
GAPS = types.Array(types.int64, 1, "C")


@njit(
    types.void(SEEN, TRACKED, TICKS, SUMS, TICKS, TICKS, GAPS, VIEW, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def visit(last_seen, tracked, upto, sums, worst, looked, gaps, view, row0, col0, tick):
    """Account for the tracked points of a footprint before the fog observes it at ``tick``.

    Looks in consecutive ticks are one visit.

    Args:
        last_seen: int32 (h, w), of the fog before the observation.
        tracked: uint8 (h, w), 1 for points that count.
        upto: int32 (h, w), the last tick whose age is in ``sums``; changed in place.
        sums: int64 (h, w), sum of ages; changed in place.
        worst: int32 (h, w), the largest age so far; changed in place.
        looked: int32 (h, w), the tick of the last look, -1 before the first; changed in place.
        gaps: int64 (ticks + 1,), number of gaps between visits by length in ticks; changed in place.
        view: uint8 (m, m), the footprint; element (0, 0) lies over point (row0, col0).
        row0: First row of the footprint; may be negative.
        col0: First column of the footprint; may be negative.
        tick: The tick of the observation.
    """
    height, width = last_seen.shape
    for i in range(max(0, -row0), min(view.shape[0], height - row0)):
        r = row0 + i
        for j in range(max(0, -col0), min(view.shape[1], width - col0)):
            c = col0 + j
            if view[i, j] == 0 or tracked[r, c] == 0:
                continue
            before = looked[r, c]
            if before == tick:
                continue
            looked[r, c] = tick
            # A first look ends no gap.
            if before >= 0 and tick - before > 1:
                gaps[tick - before] += 1
            first = upto[r, c] + 1
            if first >= tick:
                continue
            since = max(last_seen[r, c], 0)
            if since == tick - 1:  # most points: seen in the last tick, up to which all is in the sums
                upto[r, c] = since
                continue
            # An arithmetic series: ages grow by one in each tick since the last look.
            sums[r, c] += (tick - first) * (first + tick - 1 - 2 * since) // 2
            worst[r, c] = max(worst[r, c], tick - 1 - since)
            upto[r, c] = tick - 1


@njit(types.void(SEEN, TRACKED, TICKS, SUMS, TICKS, types.int64), cache=True, nogil=True)
def settle(last_seen, tracked, upto, sums, worst, tick):
    """Add the ages of all tracked points up to and including ``tick``.

    For example, a point last seen at tick 2, up to which its ages are in ``sums``, gets 1 + 2 + 3 at tick 5.

    Args:
        last_seen: As in `visit`.
        tracked: As in `visit`.
        upto: As in `visit`; changed in place.
        sums: As in `visit`; changed in place.
        worst: As in `visit`; changed in place.
        tick: The last tick to add.
    """
    height, width = last_seen.shape
    for r in range(height):
        for c in range(width):
            first = upto[r, c] + 1
            if tracked[r, c] == 0 or first > tick:
                continue
            since = max(last_seen[r, c], 0)
            sums[r, c] += (tick + 1 - first) * (first + tick - 2 * since) // 2
            worst[r, c] = max(worst[r, c], tick - since)
            upto[r, c] = tick
