"""Kernel of the wave: Lee's path lengths from one point to all others, nearest first (paper, "The wave").

Steps go to the eight neighbours and cost 100 along a row or column and 141 along a diagonal, so that equal lengths are
equal integers; a diagonal step needs both points beside it. Two first-in first-out queues, one per step cost, each stay
sorted by length, and their two heads make a priority queue without a heap.

Only neighbours that can lie on a new shortest path are tried: where all eight neighbours are open, a path that came
straight goes on straight, and one that came diagonally goes on diagonally or turns into either of its components.
Next to an obstacle all eight are tried. Lengths stay exact.
"""

from __future__ import annotations

from numba import njit, types

BYTES = types.Array(types.uint8, 1, "C")
SIGHT = types.Array(types.uint8, 1, "C", readonly=True)
INTS = types.Array(types.int32, 1, "C")
QUEUE = types.Array(types.int64, 1, "C")

BLOCKED = 0
OPEN = 1
QUEUED = 2
SETTLED = 3
STATUS = 3
HEMMED = 4
"""A point's state: its status in the two low bits, and HEMMED when one of its eight neighbours is blocked."""

BEGINNING = 8
"""The direction stored for the start of a wave, which no step leads to."""


@njit(
    types.int64(BYTES, SIGHT, INTS, INTS, QUEUE, QUEUE, QUEUE, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def advance(state, sight, length, bend, straight, diagonal, place, start, stride, limit):
    """Settle every point whose path is at most ``limit`` long.

    All grids are flat over a window of ``stride`` columns whose outermost points are blocked. A wave begins with the
    start's status QUEUED, its length 0, ``place`` zero except place[1] = 1, and straight[0] = start * 16 + BEGINNING. A
    later call with a larger limit continues from there. Several starts, each queued like this, give the length from the
    nearest of them; ``sight`` is then all 0.

    Args:
        state: uint8, see HEMMED; changed in place.
        sight: uint8, 1 where the straight line from the start is free.
        length: int32, path lengths in hundredths of a point; filled in.
        bend: int32, where each path first bends: the last point on it that is in sight of the start and no farther than
            without obstacles; the point itself where no detour is needed. Filled in.
        straight: int64, the queue of straight steps; an entry is length * 2**36 + index * 16 + direction of the last
            step.
        diagonal: int64, the queue of diagonal steps, likewise.
        place: int64 (4,), head and tail of the straight queue, then of the diagonal one; changed in place.
        start: Flat index of the start.
        stride: Columns of the window.
        limit: Longest path to settle, in hundredths of a point.

    Returns:
        The number of points that this call settled.
    """
    # Directions 0 to 3 run along rows and columns, 4 to 7 diagonally between side_a and side_b.
    step = (1, stride, -1, -stride, stride + 1, stride - 1, -stride - 1, -stride + 1)
    side_a = (0, 0, 0, 0, 0, 2, 2, 0)
    side_b = (0, 0, 0, 0, 1, 1, 3, 3)
    # A multiplication finds the row many times faster than a division; half a point keeps it off the rounding edge.
    rows_per_point = 1.0 / stride
    start_row = start // stride
    start_col = start % stride
    straight_head, straight_tail, diagonal_head, diagonal_tail = place[0], place[1], place[2], place[3]
    settled = 0
    beyond = (limit + 1) << 36
    while straight_head < straight_tail or diagonal_head < diagonal_tail:
        # On equal lengths the diagonal queue goes first: it then holds the entry that improved on the other's.
        if diagonal_head < diagonal_tail and (
            straight_head >= straight_tail or diagonal[diagonal_head] >> 36 <= straight[straight_head] >> 36
        ):
            entry = diagonal[diagonal_head]
            if entry >= beyond:
                break
            diagonal_head += 1
        else:
            entry = straight[straight_head]
            if entry >= beyond:
                break
            straight_head += 1
        here = (entry >> 4) & 0xFFFFFFFF
        came = entry & 15
        status = state[here]
        if status & 3 == 3:
            continue
        state[here] = status | 3
        settled += 1
        far = entry >> 36
        direct = False
        if sight[here] != 0:
            row = int((here + 0.5) * rows_per_point)
            up = abs(row - start_row)
            across = abs(here - row * stride - start_col)
            direct = far == 100 * abs(across - up) + 141 * min(across, up)
        bend[here] = here if direct or came == 8 else bend[here - step[came]]
        everywhere = status & 4 != 0 or came == 8
        if everywhere or came < 4:
            ways = (0, 4) if everywhere else (came, came + 1)
            for way in range(ways[0], ways[1]):
                there = here + step[way]
                known = state[there]
                if known & 3 == 1 or (known & 3 == 2 and far + 100 < length[there]):
                    state[there] = (known & 4) | 2
                    length[there] = far + 100
                    straight[straight_tail] = ((far + 100) << 36) | (there << 4) | way
                    straight_tail += 1
        else:
            for component in range(2):
                way = side_a[came] if component == 0 else side_b[came]
                there = here + step[way]
                known = state[there]
                if known & 3 == 1 or (known & 3 == 2 and far + 100 < length[there]):
                    state[there] = (known & 4) | 2
                    length[there] = far + 100
                    straight[straight_tail] = ((far + 100) << 36) | (there << 4) | way
                    straight_tail += 1
        if everywhere or came >= 4:
            ways = (4, 8) if everywhere else (came, came + 1)
            for way in range(ways[0], ways[1]):
                there = here + step[way]
                known = state[there]
                if known & 3 == 1 or (known & 3 == 2 and far + 141 < length[there]):
                    if everywhere and (
                        state[here + step[side_a[way]]] & 3 == 0 or state[here + step[side_b[way]]] & 3 == 0
                    ):
                        continue
                    state[there] = (known & 4) | 2
                    length[there] = far + 141
                    diagonal[diagonal_tail] = ((far + 141) << 36) | (there << 4) | way
                    diagonal_tail += 1
    place[0], place[1], place[2], place[3] = straight_head, straight_tail, diagonal_head, diagonal_tail
    return settled
