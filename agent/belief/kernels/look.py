"""Kernels of shared beliefs: looks that many minds take in, and the stalest point of a fog that is not counted."""

from __future__ import annotations

from numba import njit, types

_SEEN = types.Array(types.uint8, 2, "C", readonly=True)
_ROWS = types.Array(types.int64, 1, "C", readonly=True)
_GRID = types.Array(types.int32, 2, "C")
_FLAT = types.Array(types.int32, 1, "C", readonly=True)
_TRACKED = types.Array(types.uint8, 1, "C", readonly=True)
_MASKS = types.Array(types.uint8, 3, "C", readonly=True)
_CHOSEN = types.Array(types.uint8, 1, "C", readonly=True)
_I = types.int64


@njit(types.void(_GRID, _MASKS, _ROWS, _ROWS, _CHOSEN, _I), cache=True, nogil=True)
def look(last_seen, masks, rows, cols, chosen, tick):
    """Note what some of a tick's looks show.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen, at most `tick`; changed in place.
        masks: uint8 (f, m, m), 1 where a look shows a point that is tracked; 0 off the grid.
        rows: int64 (f,), the grid's row under a mask's row 0; may be negative.
        cols: int64 (f,), the grid's column under its column 0; may be negative.
        chosen: uint8 (f,), not 0 for the looks to take in.
        tick: Now.
    """
    height, width = last_seen.shape
    size = masks.shape[1]
    for number in range(chosen.size):
        if chosen[number] == 0:
            continue
        begin, end = max(0, -cols[number]), min(size, width - cols[number])
        if begin >= end:
            continue
        for i in range(max(0, -rows[number]), min(size, height - rows[number])):
            shown = masks[number, i, begin:end]
            seen = last_seen[rows[number] + i, cols[number] + begin : cols[number] + end]
            for j in range(shown.size):
                seen[j] = tick if shown[j] != 0 else seen[j]


@njit(types.void(types.Array(types.uint8, 3, "C"), _ROWS, _ROWS, _SEEN), cache=True, nogil=True)
def show(masks, rows, cols, tracked):
    """Leave in the masks of looks only the points that are tracked.

    Args:
        masks: uint8 (f, m, m), 1 where a look shows a point; changed in place.
        rows: int64 (f,), as of `look`.
        cols: int64 (f,), as of `look`.
        tracked: uint8 (h, w), 1 for the points that count.
    """
    height, width = tracked.shape
    for number in range(masks.shape[0]):
        for i in range(masks.shape[1]):
            row = rows[number] + i
            for j in range(masks.shape[2]):
                col = cols[number] + j
                if row < 0 or row >= height or col < 0 or col >= width or tracked[row, col] == 0:
                    masks[number, i, j] = 0


@njit(_I(_FLAT, _TRACKED, _I, _I), cache=True, nogil=True)
def stalest(last_seen, tracked, oldest, first):
    """The next tracked point that was last seen at `oldest`, or else one of those that nobody has seen for longest.

    Args:
        last_seen: int32 (n,), the tick at which each point was last seen, none below `oldest`.
        tracked: uint8 (n,), 1 for the points that count; there is one.
        oldest: A tick.
        first: Where to begin to look; the search goes round.

    Returns:
        Its index.
    """
    best, found = 2**62, -1
    for part in range(2):
        low, high = (first, last_seen.size) if part == 0 else (0, first)
        for index in range(low, high):
            if tracked[index] != 0 and last_seen[index] < best:
                best, found = last_seen[index], index
                if best == oldest:
                    return found
    return found
