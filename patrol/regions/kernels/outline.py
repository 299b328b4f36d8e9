"""Kernels that draw the outline of a mask with few corners.

Coordinates are in points and corners lie between points: point (row, col) covers [col, col + 1) x [row, row + 1).
"""

from __future__ import annotations

import math

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
MARKS = types.Array(types.uint8, 2, "C")
PAIRS = types.Array(types.int32, 2, "C")
ENDS = types.Array(types.int32, 1, "C")
REALS = types.Array(types.float64, 1, "C", readonly=True)
SUMS = types.Array(types.float64, 2, "C")
LINE = types.Array(types.float64, 1, "C")
LINKS = types.Array(types.int64, 1, "C")
BANNED = types.Array(types.int64, 2, "C", readonly=True)
int64 = types.int64
float64 = types.float64
boolean = types.boolean


@njit(boolean(GRID, int64, int64), cache=True, nogil=True)
def _inside(mask, row, col):
    return 0 <= row < mask.shape[0] and 0 <= col < mask.shape[1] and mask[row, col] != 0


@njit(boolean(GRID, int64, int64, int64), cache=True, nogil=True)
def _borders(mask, x, y, way):
    """Return True if the unit step from (x, y) has the mask on its left and none on its right; ways: +x, +y, -x, -y."""
    if way == 0:
        return _inside(mask, y, x) and not _inside(mask, y - 1, x)
    if way == 1:
        return _inside(mask, y, x - 1) and not _inside(mask, y, x)
    if way == 2:
        return _inside(mask, y - 1, x - 1) and not _inside(mask, y, x - 1)
    return _inside(mask, y - 1, x) and not _inside(mask, y - 1, x - 1)


@njit(int64(GRID, MARKS, PAIRS, ENDS), cache=True, nogil=True)
def trace(mask, passed, corners, ends):
    """Follow the border of a mask, inside on the left: outer loops run counter-clockwise, holes clockwise.

    Points that touch at a corner only are not joined.

    Args:
        mask: uint8 (h, w).
        passed: uint8 (h + 1, w + 1), zeros on entry, scratch.
        corners: int32 (m, 2), overwritten with (x, y) loop after loop; m is the number of corners that four points
            around a place make.
        ends: int32, overwritten with where each loop ends; it must hold m / 4 of them.

    Returns:
        The number of loops.
    """
    loops = 0
    count = 0
    for first_y in range(mask.shape[0] + 1):
        for first_x in range(mask.shape[1]):
            if passed[first_y, first_x] != 0 or not _borders(mask, first_x, first_y, 0):
                continue
            # The leftmost unseen step to the right begins at a corner.
            x, y, way = int64(first_x), int64(first_y), int64(0)
            while True:
                if way == 0:
                    passed[y, x] = 1
                x += (way == 0) - (way == 2)
                y += (way == 1) - (way == 3)
                turn = (way + 1) % 4
                if not _borders(mask, x, y, turn):
                    turn = way if _borders(mask, x, y, way) else (way + 3) % 4
                if turn != way:
                    corners[count, 0] = x
                    corners[count, 1] = y
                    count += 1
                way = turn
                if way == 0 and x == first_x and y == first_y:
                    break
            ends[loops] = count
            loops += 1
    return loops


@njit(
    int64(REALS, REALS, int64, BANNED, float64, float64, SUMS, LINE, LINKS, LINKS),
    cache=True,
    nogil=True,
)
def fewest_corners(xs, ys, first, banned, fill, shave, sums, cost, link, chosen):
    """Replace a closed loop by the polygon with the fewest corners, of several the one nearest to the loop.

    The corners are some of the loop's own, `first` among them. All lengths are in points.

    Args:
        xs: float64 (n,).
        ys: float64 (n,).
        first: Index of a corner that stays.
        banned: int64 (k, 2), sides by their ends that must not be used.
        fill: How far a corner left out may lie on the left of the side that replaces it (so much is added outside the
            mask); it is larger than `shave`.
        shave: How far a corner left out may lie on the right of that side (so much of the mask is cut off).
        sums: float64 (2 n + 1, 5), scratch.
        cost: float64 (n + 1,), scratch.
        link: int64 (n + 1,), scratch.
        chosen: int64 (n,), its head is overwritten with the corners.

    Returns:
        The number of corners.
    """
    n = xs.shape[0]
    sums[0, :] = 0.0
    for k in range(2 * n):
        x, y = xs[(first + k) % n], ys[(first + k) % n]
        sums[k + 1, 0] = sums[k, 0] + x
        sums[k + 1, 1] = sums[k, 1] + y
        sums[k + 1, 2] = sums[k, 2] + x * x
        sums[k + 1, 3] = sums[k, 3] + x * y
        sums[k + 1, 4] = sums[k, 4] + y * y
    cost[:] = math.inf
    cost[0] = 0.0
    for i in range(n):
        ax, ay = xs[(first + i) % n], ys[(first + i) % n]
        low, high = -math.inf, math.inf
        base = 0.0
        farthest = 0.0
        for j in range(i + 1, n + 1):
            dx, dy = xs[(first + j) % n] - ax, ys[(first + j) % n] - ay
            away = math.sqrt(dx * dx + dy * dy)
            if away == 0.0:
                continue
            # Bearings are counted from that of the first corner beyond the tolerance, so that none wraps around.
            bearing = math.atan2(dy, dx)
            if high < math.inf:
                if bearing - base > math.pi:
                    bearing -= 2.0 * math.pi
                elif bearing - base < -math.pi:
                    bearing += 2.0 * math.pi
            whole = i == 0 and j == n
            if low - 1e-9 <= bearing <= high + 1e-9 and farthest <= away + shave and not whole:
                allowed = True
                for k in range(banned.shape[0]):
                    if banned[k, 0] == (first + i) % n and banned[k, 1] == (first + j) % n:
                        allowed = False
                # Mean square of the distances to the side, from the sums.
                c = j - i - 1
                sx, sy = sums[j, 0] - sums[i + 1, 0] - c * ax, sums[j, 1] - sums[i + 1, 1] - c * ay
                xx = sums[j, 2] - sums[i + 1, 2] - 2.0 * ax * sx - c * ax * ax
                yy = sums[j, 4] - sums[i + 1, 4] - 2.0 * ay * sy - c * ay * ay
                xy = sums[j, 3] - sums[i + 1, 3] - ax * sy - ay * sx - c * ax * ay
                spread = max((dx * dx * yy - 2.0 * dx * dy * xy + dy * dy * xx) / (away * away), 0.0)
                total = cost[i] + 1.0 + 0.01 * math.sqrt(spread / (c + 1)) / fill
                if allowed and total < cost[j] - 1e-12:
                    cost[j] = total
                    link[j] = i
            farthest = max(farthest, away)
            if away > shave:
                if high == math.inf:
                    base = bearing
                high = min(high, bearing + math.asin(shave / away))
            if away > fill:
                low = max(low, bearing - math.asin(fill / away))
            if low > high + 1e-9:
                break
    count = 0
    at = n
    while at > 0:
        at = link[at]
        chosen[count] = (first + at) % n
        count += 1
    for k in range(count // 2):
        chosen[k], chosen[count - 1 - k] = chosen[count - 1 - k], chosen[k]
    return count
