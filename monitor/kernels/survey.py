"""The kernel that finds the stalest point of a fog."""

from __future__ import annotations

from numba import njit


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
    nearest = float(height) * height + float(width) * width
    for r in range(height):
        if (r - middle_row) ** 2 >= nearest:
            continue
        for c in range(width):
            if patrolled[r, c] and last_seen[r, c] == oldest:
                distance = (r - middle_row) ** 2 + (c - middle_col) ** 2
                if distance < nearest:
                    row, col, nearest = r, c, distance
    return row, col, count, points
