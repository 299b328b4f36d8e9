"""Kernels of maps as a page shows them: the stalest point of a fog, and the parts that changed, in square tiles."""

from __future__ import annotations

from numba import njit, types


@njit(
    # As text, because a type with several results has no typed constructor. Both arrays may be read-only.
    "UniTuple(i8, 4)(Array(i4, 2, 'C', True, aligned=True), Array(u1, 2, 'C', True, aligned=True))",
    cache=True,
    nogil=True,
)
def stalest(last_seen, patrolled):
    """Find the patrolled point that was last seen longest ago.

    Args:
        last_seen: int32 (h, w), ticks; negative for points not seen yet.
        patrolled: uint8 (h, w), 1 for points that count.

    Returns:
        Row and column of the point, of several the one nearest to their centre; the number of points that count and
        have been seen; and the number of points that count. Row and column are -1 if none counts.
    """
    height, width = last_seen.shape
    points = count = ties = rows = cols = 0
    oldest = 2**31 - 1
    for r in range(height):
        for c in range(width):
            if patrolled[r, c] == 0:
                continue
            points += 1
            tick = last_seen[r, c]
            count += tick >= 0
            if tick > oldest:
                continue
            if tick < oldest:
                oldest = tick
                ties = rows = cols = 0
            ties += 1
            rows += r
            cols += c
    row = col = -1
    if points == 0:
        return row, col, count, points
    middle_row, middle_col = rows / ties, cols / ties
    # Farther than any point is from the middle.
    nearest = float(height) * height + float(width) * width
    for r in range(height):
        # No point of this row can be nearer.
        if (r - middle_row) ** 2 >= nearest:
            continue
        for c in range(width):
            if patrolled[r, c] and last_seen[r, c] == oldest:
                distance = (r - middle_row) ** 2 + (c - middle_col) ** 2
                if distance < nearest:
                    row, col, nearest = r, c, distance
    return row, col, count, points


KEEP = -(2**31)
"""The value of a run of points that do not change."""


@njit(
    # As text, because a type with two results has no typed constructor. The first array is read-only.
    "UniTuple(i8, 2)(Array(i4, 2, 'C', True, aligned=True), i4[:,::1], i4[::1], i8, i8,"
    "i4[::1], i4[::1], i4[::1], u2[::1])",
    cache=True,
    nogil=True,
)
def take_over(now, shown, versions, side, version, tiles, counts, values, lengths):
    """Update ``shown`` to ``now`` and write the difference as runs of equal values, in square tiles.

    For example, a tile of four points of which only the second changes, to 5, is written as the values `KEEP`, 5,
    `KEEP` with the lengths 1, 1, 2.

    Args:
        now: int32 (h, w), the new map.
        shown: int32 (h, w), the old map; changed in place.
        versions: int32 (tiles,), row by row; changed in place, a tile that changes gets ``version``.
        side: Points along a tile's side.
        version: Number of the new version.
        tiles: int32 (tiles,), out: numbers of the tiles that changed.
        counts: int32 (tiles,), out: runs of each of them.
        values: int32 (h * w,), out: value of each run, row by row within each tile; `KEEP` where nothing changed.
        lengths: uint16 (h * w,), out: points of each run.

    Returns:
        The number of tiles that changed, and the number of runs.
    """
    height, width = now.shape
    across = (width + side - 1) // side
    changed = runs = 0
    for tile in range(versions.size):
        row, col = tile // across * side, tile % across * side
        end = min(col + side, width)
        first = runs
        # A run of nothing: it is written only once it has a length.
        run, length = types.int32(KEEP), 0
        for r in range(row, min(row + side, height)):
            fresh, old = now[r, col:end], shown[r, col:end]
            differs = types.int32(0)
            for c in range(fresh.size):
                differs |= fresh[c] ^ old[c]
            if differs == 0 and run == KEEP:
                length += fresh.size
                continue
            for c in range(fresh.size):
                fresh_value = fresh[c]
                if fresh_value == old[c]:
                    fresh_value = types.int32(KEEP)
                if fresh_value == run:
                    length += 1
                    continue
                if length > 0:
                    values[runs] = run
                    lengths[runs] = length
                    runs += 1
                run, length = fresh_value, 1
            for c in range(fresh.size):  # an assignment to the slice takes four times as long to compile
                old[c] = fresh[c]
        if runs == first and run == KEEP:  # nothing changed
            continue
        values[runs] = run
        lengths[runs] = length
        runs += 1
        versions[tile] = version
        tiles[changed] = tile
        counts[changed] = runs - first
        changed += 1
    return changed, runs
