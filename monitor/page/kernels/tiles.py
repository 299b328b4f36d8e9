"""Kernels that find and pack the parts of a map that changed, in square tiles."""

from __future__ import annotations

from numba import njit, types

TICKS_IN = types.Array(types.int32, 2, "C", readonly=True)
TILES_IN = types.Array(types.int32, 1, "C", readonly=True)
VALUES = types.Array(types.int32, 1, "C")
LENGTHS = types.Array(types.uint16, 1, "C")

KEEP = -(2**31)
"""The value of a run of points that stay as they are."""


@njit(
    # As text, for a type of two results has no typed constructor; the first array is read alone.
    "UniTuple(i8, 2)(Array(i4, 2, 'C', True, aligned=True), i4[:,::1], i4[::1], i8, i8,"
    "i4[::1], i4[::1], i4[::1], u2[::1])",
    cache=True,
    nogil=True,
)
def take_over(now, shown, versions, side, version, tiles, counts, values, lengths):
    """Bring ``shown`` to ``now`` and write the difference, in tiles of side x side points; how many tiles, and runs.

    now, shown: int32 (h, w). versions: int32 (tiles,), row by row; a tile that changes gets ``version``. tiles, counts:
    out, room for each tile: those that changed, and the runs of each. values, lengths: out, room for a run of each
    point: runs of equal values, row by row within each tile, `KEEP` where nothing changed.
    """
    height, width = now.shape
    across = (width + side - 1) // side
    changed = runs = 0
    for tile in range(versions.size):
        row, col = tile // across * side, tile % across * side
        end = min(col + side, width)
        first = runs
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
                value = fresh[c]
                if value == old[c]:
                    value = types.int32(KEEP)
                if value == run:
                    length += 1
                    continue
                if length > 0:
                    values[runs] = run
                    lengths[runs] = length
                    runs += 1
                run, length = value, 1
            old[:] = fresh
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


@njit(types.int64(TICKS_IN, TILES_IN, types.int64, VALUES, VALUES, LENGTHS), cache=True, nogil=True)
def pack(shown, tiles, side, counts, values, lengths):
    """Write the tiles as runs of equal values, row by row within each tile; the number of all runs.

    shown: int32 (h, w). tiles: int32 (m,). counts: int32 (m,), out: the runs of each. values, lengths: out, room for a
    run of each point.
    """
    height, width = shown.shape
    across = (width + side - 1) // side
    runs = 0
    for i in range(tiles.size):
        row, col = tiles[i] // across * side, tiles[i] % across * side
        first = runs
        run, length = shown[row, col], 0
        for r in range(row, min(row + side, height)):
            for c in range(col, min(col + side, width)):
                value = shown[r, c]
                if value == run:
                    length += 1
                    continue
                values[runs] = run
                lengths[runs] = length
                runs += 1
                run, length = value, 1
        values[runs] = run
        lengths[runs] = length
        runs += 1
        counts[i] = runs - first
    return runs
