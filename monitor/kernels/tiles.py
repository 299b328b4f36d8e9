"""Kernels that find and pack the parts of a map that changed, in square tiles."""

from __future__ import annotations

from numba import njit, types

TICKS_IN = types.Array(types.int32, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C")
VERSIONS = types.Array(types.int32, 1, "C")
TILES_IN = types.Array(types.int32, 1, "C", readonly=True)
VALUES = types.Array(types.int32, 1, "C")
LENGTHS = types.Array(types.uint16, 1, "C")

KEEP = -(2**31)
"""The value of a run of points that stay as they are."""


@njit(types.int64(TICKS_IN, TICKS_IN, VERSIONS, types.int64, types.int64), cache=True, nogil=True)
def compare(now, shown, versions, side, version):
    """Give ``version`` to each tile of side x side points in which ``now`` differs from ``shown``; how many do.

    now, shown: int32 (h, w). versions: int32 (tiles,), row by row.
    """
    height, width = now.shape
    across = (width + side - 1) // side
    changed = 0
    for tile in range(versions.size):
        row, col = tile // across * side, tile % across * side
        for r in range(row, min(row + side, height)):
            same = True
            for c in range(col, min(col + side, width)):
                same &= now[r, c] == shown[r, c]
            if not same:
                versions[tile] = version
                changed += 1
                break
    return changed


@njit(
    types.int64(TICKS_IN, TICKS_IN, types.boolean, TILES_IN, types.int64, VALUES, VALUES, LENGTHS),
    cache=True,
    nogil=True,
)
def pack(now, shown, whole, tiles, side, counts, values, lengths):
    """Write the tiles as runs of equal values, row by row within each tile; the number of all runs.

    now, shown: int32 (h, w). whole: write every point, not `KEEP` where ``now`` is as ``shown``. tiles: int32 (m,).
    counts: int32 (m,), out: the runs of each. values, lengths: out, room for a run of each point.
    """
    height, width = now.shape
    across = (width + side - 1) // side
    runs = 0
    for i in range(tiles.size):
        row, col = tiles[i] // across * side, tiles[i] % across * side
        first = runs
        for r in range(row, min(row + side, height)):
            for c in range(col, min(col + side, width)):
                value = now[r, c]
                if not whole and value == shown[r, c]:
                    value = KEEP
                if runs > first and values[runs - 1] == value:
                    lengths[runs - 1] += 1
                else:
                    values[runs] = value
                    lengths[runs] = 1
                    runs += 1
        counts[i] = runs - first
    return runs


@njit(types.void(TICKS_IN, TICKS, VERSIONS, types.int64, types.int64), cache=True, nogil=True)
def take_over(now, shown, versions, side, version):
    """Copy the tiles of this version from ``now`` to ``shown``; the arrays are those of `compare`."""
    height, width = now.shape
    across = (width + side - 1) // side
    for tile in range(versions.size):
        if versions[tile] == version:
            row, col = tile // across * side, tile % across * side
            for r in range(row, min(row + side, height)):
                for c in range(col, min(col + side, width)):
                    shown[r, c] = now[r, c]
