"""Kernels of the patrolled area: the points that can be seen from the places that a body can reach.

Sight is symmetric shadow casting between the centres of points, as the footprint has it: of two points each sees the
other or neither does; an impassable point blocks the full width of its own row (or, sideways, column).
"""

from __future__ import annotations

import math

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
INDEX = types.Array(types.int32, 2, "C")
LIST = types.Array(types.int32, 1, "C")
WEDGES = types.Array(types.int64, 2, "C")
int64 = types.int64
float64 = types.float64


@njit(types.boolean(GRID, int64, int64), cache=True, nogil=True)
def _is_frontier(reach, row, col):
    """Return True if a reached point has a neighbour, of 8, that is not."""
    height, width = reach.shape
    for r in range(max(row - 1, 0), min(row + 2, height)):
        for c in range(max(col - 1, 0), min(col + 2, width)):
            if reach[r, c] == 0:
                return True
    return False


@njit(int64(GRID, GRID, int64, int64, int64, int64, int64, WEDGES, WEDGES, INDEX, INDEX), cache=True, nogil=True)
def _cast_quadrant(passable, reach, row, col, quadrant, limit, outward, now, after, proxy, square):
    """Cast one quadrant from (row, col).

    limit: square of the range in points. now, after: scratch for the wedges still open on this line and the next, each
    start and end slope as numerator and denominator, so that nothing is rounded.

    outward = 1: (row, col) is reached; points beyond another reached point are left to that one. Every unreached
    point in sight gets (row, col) into `proxy` and the squared distance into `square` where that is less.
    outward = 0: (row, col) is not reached; returns the flat index of the nearest reached point in sight, the lowest of
    several, where it is nearer than square[row, col], which then takes its squared distance; otherwise -1.
    """
    height, width = passable.shape
    nearest = int64(-1)
    # The quadrant reaches from slope -1 to slope 1; its borders belong to two quadrants, which does no harm.
    now[0, 0], now[0, 1], now[0, 2], now[0, 3] = -1, 1, 1, 1
    wedges = 1
    depth = 1
    while wedges > 0 and depth * depth <= limit and (outward == 1 or depth * depth <= square[row, col]):
        # One more, so that a root that is rounded down loses no point; `away` decides exactly.
        widest = int(math.sqrt(limit - depth * depth)) + 1
        coming = 0
        for wedge in range(wedges):
            start_up, start_down = now[wedge, 0], now[wedge, 1]
            end_up, end_down = now[wedge, 2], now[wedge, 3]
            first = max((2 * depth * start_up + start_down) // (2 * start_down), -widest)
            last = min(-((end_down - 2 * depth * end_up) // (2 * end_down)), widest)
            before = -1
            for across in range(first, last + 1):
                if quadrant == 0:
                    r, c = row + depth, col + across
                elif quadrant == 1:
                    r, c = row - depth, col + across
                elif quadrant == 2:
                    r, c = row + across, col + depth
                else:
                    r, c = row + across, col - depth
                inside = 0 <= r < height and 0 <= c < width
                is_open = 1 if inside and passable[r, c] != 0 else 0
                reached = is_open == 1 and reach[r, c] != 0
                # It casts on its own, so that each cast stays short.
                if outward == 1 and reached:
                    is_open = 0
                if is_open == 1:
                    if before == 0:
                        start_up = 2 * across - 1
                        start_down = 2 * depth
                    away = depth * depth + across * across
                    if (
                        away <= limit
                        and across * start_down >= depth * start_up
                        and across * end_down <= depth * end_up
                    ):
                        if outward == 1:
                            # Points are cast from in the order of their index, so that of equally near ones the
                            # lowest stays.
                            if away < square[r, c]:
                                square[r, c] = away
                                proxy[r, c] = row * width + col
                        elif reached:
                            cell = r * width + c
                            if away < square[row, col] or (away == square[row, col] and cell < nearest):
                                square[row, col] = away
                                nearest = cell
                elif before == 1:
                    after[coming, 0], after[coming, 1] = start_up, start_down
                    after[coming, 2], after[coming, 3] = 2 * across - 1, 2 * depth
                    coming += 1
                before = is_open
            if before == 1:
                after[coming, 0], after[coming, 1] = start_up, start_down
                after[coming, 2], after[coming, 3] = end_up, end_down
                coming += 1
        now, after = after, now
        wedges = coming
        depth += 1
    return nearest


@njit(types.void(GRID, GRID, int64, WEDGES, WEDGES, INDEX, INDEX), cache=True, nogil=True)
def see_from_reach(passable, reach, limit, now, after, proxy, square):
    """Find, for the passable points that no body reaches, a reached point that sees each.

    Casts outward from the frontier of the reach, each cast ending at the next reached point, so the cost grows with the
    walls and not with the area. The few points on the edges of shadows that only a line through the reach sees are left
    out here; see `see_back`.

    Args:
        passable: uint8 (h, w).
        reach: uint8 (h, w).
        limit: Square of the range in points.
        now: int64 (n, 4), scratch with n at least 2 * range + 4.
        after: Like `now`.
        proxy: int32 (h, w), -1 on entry, flat index of the nearest frontier point that sees the point on return.
        square: int32 (h, w), limit + 1 on entry, its squared distance in points on return.
    """
    height, width = passable.shape
    for row in range(height):
        for col in range(width):
            if reach[row, col] != 0 and _is_frontier(reach, row, col):
                for quadrant in range(4):
                    _cast_quadrant(passable, reach, row, col, quadrant, limit, 1, now, after, proxy, square)


@njit(int64(GRID, GRID, int64, WEDGES, WEDGES, LIST, INDEX, INDEX), cache=True, nogil=True)
def see_back(passable, reach, limit, now, after, work, proxy, square):
    """Extend the result of `see_from_reach` to all points that the reach sees and that touch it.

    Looks back from each unseen point beside a seen one, and from its unseen neighbours in turn where it does see the
    reach. A point that sees nothing of the reach has -2 in `proxy` on return.

    Args:
        passable: uint8 (h, w).
        reach: uint8 (h, w).
        limit: Square of the range in points.
        now: int64 (n, 4), scratch, as in `see_from_reach`.
        after: Like `now`.
        work: int32 (h * w,), scratch.
        proxy: int32 (h, w), as in `see_from_reach`.
        square: int32 (h, w), as in `see_from_reach`.

    Returns:
        The number of points added.
    """
    height, width = passable.shape
    waiting = 0
    for row in range(height):
        for col in range(width):
            # Points that touch no seen one are not looked at, nor are their neighbours.
            if proxy[row, col] >= 0:
                work[waiting] = row * width + col
                waiting += 1
    added = 0
    while waiting > 0:
        waiting -= 1
        row = work[waiting] // width
        col = work[waiting] - row * width
        for r in range(max(row - 1, 0), min(row + 2, height)):
            for c in range(max(col - 1, 0), min(col + 2, width)):
                if passable[r, c] == 0 or reach[r, c] != 0 or proxy[r, c] != -1:
                    continue
                for quadrant in range(4):
                    nearest = _cast_quadrant(passable, reach, r, c, quadrant, limit, 0, now, after, proxy, square)
                    if nearest >= 0:
                        proxy[r, c] = nearest
                # -2 and not -1: looked at, so that it is not looked at again from another neighbour.
                if proxy[r, c] < 0:
                    proxy[r, c] = -2
                else:
                    added += 1
                    work[waiting] = r * width + c
                    waiting += 1
    return added
