"""Kernels that split ground into convex regions (`patrol.regions`): cuts, outlines, pieces.

A corner's cone holds the directions in which a cut leaves two convex angles: between the extensions of its two sides.
Corners are rows of float64 (n, 2), free ground on the left of the way from each to the next; lengths are in points.

Coordinates are in points and corners lie between points: point (row, col) covers [col, col + 1) x [row, row + 1).
"""

from __future__ import annotations

import math

from numba import njit, types

PLACES = types.Array(types.float64, 2, "C", readonly=True)
REALS = types.Array(types.float64, 1, "C", readonly=True)
INDICES = types.Array(types.int64, 1, "C", readonly=True)
FLAGS = types.Array(types.uint8, 1, "C")
WAYS = types.Array(types.float64, 2, "C")
int64 = types.int64
float64 = types.float64
boolean = types.boolean

FLAT = 1e-9


@njit(boolean(float64, float64, float64, float64, float64, float64, float64), cache=True, nogil=True)
def _in_cone(ax, ay, bx, by, dx, dy, slack):
    """Return True if a cut (dx, dy) leaves convex angles at a corner with sides (ax, ay) to it and (bx, by) from it.

    slack: how far, at the shorter of cut and side, the angle may lie beyond 180 degrees.
    """
    cut = math.sqrt(dx * dx + dy * dy)
    along = math.sqrt(bx * bx + by * by)
    back = math.sqrt(ax * ax + ay * ay)
    turn = bx * dy - by * dx
    right = ax * dy - ay * dx
    if turn < -min(slack * max(along, cut), 0.25 * along * cut) - FLAT:
        return False
    if right < -min(slack * max(back, cut), 0.25 * back * cut) - FLAT:
        return False
    # The slack must not turn the cut back along one of the sides.
    mx, my = ax / back - bx / along, ay / back - by / along
    return dx * mx + dy * my > 0.05 * cut * math.sqrt(mx * mx + my * my)


@njit(boolean(PLACES, INDICES, int64, int64, float64), cache=True, nogil=True)
def _in_sight(corners, after, v, w, margin):
    """Return True if the line between two corners crosses no side and keeps `margin` from all other corners."""
    vx, vy = corners[v, 0], corners[v, 1]
    dx, dy = corners[w, 0] - vx, corners[w, 1] - vy
    square = dx * dx + dy * dy
    for k in range(corners.shape[0]):
        px, py = corners[k, 0] - vx, corners[k, 1] - vy
        aside = dx * py - dy * px
        if k not in (v, w):
            along = dx * px + dy * py
            if 0.0 < along < square and aside * aside < margin * margin * square:
                return False
        m = after[k]
        if k in (v, w) or m in (v, w):
            continue
        qx, qy = corners[m, 0] - vx, corners[m, 1] - vy
        beyond = dx * qy - dy * qx
        if (aside > 0.0) == (beyond > 0.0) or aside == 0.0 or beyond == 0.0:
            continue
        sx, sy = qx - px, qy - py
        from_v = sy * px - sx * py
        from_w = sx * (dy - py) - sy * (dx - px)
        if (from_v > 0.0) != (from_w > 0.0):
            return False
    return True


@njit(
    types.void(PLACES, INDICES, INDICES, INDICES, REALS, int64, float64, float64, float64, FLAGS),
    cache=True,
    nogil=True,
)
def partners(corners, before, after, concave, reach, v, longest, slack, margin, found):
    """Mark the concave corners to which one cut from the concave corner v serves both.

    Args:
        corners: float64 (n, 2).
        before: int64 (n,), the neighbour before each corner.
        after: int64 (n,), the neighbour after each corner.
        concave: int64 (m,), indices of the concave corners.
        reach: float64 (n,), each corner's distance to the nearest line in its cone.
        v: The corner looked at.
        longest: a cut is at most this many times as long as both reaches together.
        slack: Tolerance of the cone's edges, as `_in_cone` has it.
        margin: Points that a cut keeps from other corners.
        found: uint8 (m,), overwritten.
    """
    for index in range(concave.shape[0]):
        w = concave[index]
        found[index] = 0
        # Each pair once, from its lower corner; neighbours are joined by a side already.
        if w <= v or w in (before[v], after[v]):
            continue
        dx, dy = corners[w, 0] - corners[v, 0], corners[w, 1] - corners[v, 1]
        if math.sqrt(dx * dx + dy * dy) > longest * (reach[v] + reach[w]) or dx * dx + dy * dy < FLAT:
            continue
        served = True
        for end in range(2):
            corner = v if end == 0 else w
            p, q = before[corner], after[corner]
            ax, ay = corners[corner, 0] - corners[p, 0], corners[corner, 1] - corners[p, 1]
            bx, by = corners[q, 0] - corners[corner, 0], corners[q, 1] - corners[corner, 1]
            # Seen from the other end, the cut leads the other way.
            turn = 1.0 if end == 0 else -1.0
            served = served and _in_cone(ax, ay, bx, by, turn * dx, turn * dy, slack)
        if served and _in_sight(corners, after, v, w, margin):
            found[index] = 1


@njit(types.void(PLACES, INDICES, INDICES, INDICES, PLACES, PLACES, int64, WAYS), cache=True, nogil=True)
def shorten(corners, before, after, concave, begin, end, first, ways):
    """Keep for each concave corner the shortest way within its cone to any of some straight lines.

    Args:
        corners: float64 (n, 2).
        before: int64 (n,), the neighbour before each corner.
        after: int64 (n,), the neighbour after each corner.
        concave: int64 (m,), the corners looked at.
        begin: float64 (k, 2), where the lines begin.
        end: float64 (k, 2), where the lines end.
        first: The first line's number.
        ways: float64 (n, 5), by corner: length, share of the way along the line, x, y and the line's number; shorter
            ways replace what is there.
    """
    for index in range(concave.shape[0]):
        corner = concave[index]
        x, y = corners[corner, 0], corners[corner, 1]
        ax, ay = x - corners[before[corner], 0], y - corners[before[corner], 1]
        bx, by = corners[after[corner], 0] - x, corners[after[corner], 1] - y
        back, ahead = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        for k in range(begin.shape[0]):
            px, py = begin[k, 0] - x, begin[k, 1] - y
            qx, qy = end[k, 0] - x, end[k, 1] - y
            low, high = 0.0, 1.0
            for side in range(2):
                sx, sy = (ax / back, ay / back) if side == 0 else (bx / ahead, by / ahead)
                # A line is cut to its part inside the cone, on the inner side of both extensions.
                near = sx * py - sy * px
                far = sx * qy - sy * qx
                if near < -FLAT and far < -FLAT:
                    high = -1.0
                elif near < -FLAT:
                    low = max(low, near / (near - far))
                elif far < -FLAT:
                    high = min(high, near / (near - far))
            if low > high:
                continue
            dx, dy = qx - px, qy - py
            square = dx * dx + dy * dy
            share = -(px * dx + py * dy) / square if square > 0.0 else 0.0
            share = min(max(share, low), high)
            fx, fy = px + share * dx, py + share * dy
            away = math.sqrt(fx * fx + fy * fy)
            # Lines that begin at the corner itself are no way away from it.
            if 1e-6 < away < ways[corner, 0]:
                ways[corner, 0] = away
                ways[corner, 1] = share
                ways[corner, 2] = x + fx
                ways[corner, 3] = y + fy
                ways[corner, 4] = first + k


GRID = types.Array(types.uint8, 2, "C", readonly=True)
MARKS = types.Array(types.uint8, 2, "C")
PAIRS = types.Array(types.int32, 2, "C")
ENDS = types.Array(types.int32, 1, "C")
SUMS = types.Array(types.float64, 2, "C")
LINE = types.Array(types.float64, 1, "C")
LINKS = types.Array(types.int64, 1, "C")
BANNED = types.Array(types.int64, 2, "C", readonly=True)


@njit(boolean(GRID, int64, int64), cache=True, nogil=True)
def _is_inside(mask, row, col):
    return 0 <= row < mask.shape[0] and 0 <= col < mask.shape[1] and mask[row, col] != 0


@njit(boolean(GRID, int64, int64, int64), cache=True, nogil=True)
def _is_border(mask, x, y, way):
    """Return True if the unit step from (x, y) has the mask on its left and none on its right; ways: +x, +y, -x, -y."""
    if way == 0:
        return _is_inside(mask, y, x) and not _is_inside(mask, y - 1, x)
    if way == 1:
        return _is_inside(mask, y, x - 1) and not _is_inside(mask, y, x)
    if way == 2:
        return _is_inside(mask, y - 1, x - 1) and not _is_inside(mask, y, x - 1)
    return _is_inside(mask, y - 1, x) and not _is_inside(mask, y - 1, x - 1)


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
            if passed[first_y, first_x] != 0 or not _is_border(mask, first_x, first_y, 0):
                continue
            # The leftmost unseen step to the right begins at a corner.
            x, y, way = int64(first_x), int64(first_y), int64(0)
            while True:
                if way == 0:
                    passed[y, x] = 1
                x += (way == 0) - (way == 2)
                y += (way == 1) - (way == 3)
                # Left first, so that points which touch at a corner only stay apart.
                turn = (way + 1) % 4
                if not _is_border(mask, x, y, turn):
                    turn = way if _is_border(mask, x, y, way) else (way + 3) % 4
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


@njit(int64(REALS, REALS, int64, BANNED, float64, float64, SUMS, LINE, LINKS, LINKS), cache=True, nogil=True)
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
            # The polygon of one side that is no side at all.
            is_whole = i == 0 and j == n
            if low - 1e-9 <= bearing <= high + 1e-9 and farthest <= away + shave and not is_whole:
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
                # The fewest corners count first; closeness only decides between as many.
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
    corner = n
    while corner > 0:
        corner = link[corner]
        chosen[count] = (first + corner) % n
        count += 1
    for k in range(count // 2):
        # The links lead from the end to the beginning.
        chosen[k], chosen[count - 1 - k] = chosen[count - 1 - k], chosen[k]
    return count


MASK = types.Array(types.uint8, 2, "C", readonly=True)
LABELS = types.Array(types.int32, 2, "C")
FIXED = types.Array(types.int32, 2, "C", readonly=True)
LIST = types.Array(types.int32, 1, "C")
int32 = types.int32

EDGE = 1e-6
"""A centre so far (points) outside a polygon still lies on its edge."""


@njit(types.void(PLACES, int64, MASK, LABELS), cache=True, nogil=True)
def fill(polygon, number, mask, labels):
    """Number the points whose centres lie in or on a convex polygon and that have no number yet.

    Args:
        polygon: float64 (k, 2), in points.
        number: To give.
        mask: uint8 (h, w), only its points are numbered.
        labels: int32 (h, w), -1 where there is no number.
    """
    corners = polygon.shape[0]
    low, high = polygon[0, 1], polygon[0, 1]
    for k in range(corners):
        low, high = min(low, polygon[k, 1]), max(high, polygon[k, 1])
    first = int64(max(math.ceil(low - 0.5 - EDGE), 0))
    last = int64(min(math.floor(high - 0.5 + EDGE), mask.shape[0] - 1))
    for row in range(first, last + 1):
        # Within the polygon, where a row's centre lies outside by rounding.
        y = min(max(row + 0.5, low), high)
        left, right = math.inf, -math.inf
        for k in range(corners):
            m = k + 1 if k + 1 < corners else 0
            x0, y0, x1, y1 = polygon[k, 0], polygon[k, 1], polygon[m, 0], polygon[m, 1]
            if min(y0, y1) <= y <= max(y0, y1):
                share = (y - y0) / (y1 - y0) if y1 != y0 else 0.0
                x = x0 + share * (x1 - x0)
                left, right = min(left, x), max(right, x)
        begin = int64(max(math.ceil(left - 0.5 - EDGE), 0))
        end = int64(min(math.floor(right - 0.5 + EDGE), mask.shape[1] - 1))
        for col in range(begin, end + 1):
            if mask[row, col] != 0 and labels[row, col] < 0:
                labels[row, col] = number


@njit(int64(MASK, int64, LABELS, LIST), cache=True, nogil=True)
def spread(mask, rounds, labels, work):
    """Give points of the mask without a number that of a neighbour (of four), nearest first.

    Args:
        mask: uint8 (h, w).
        rounds: How often numbers spread to neighbours.
        labels: int32 (h, w), -1 where there is no number.
        work: int32 (h * w,), scratch.

    Returns:
        How many points got a number.
    """
    height, width = mask.shape
    begin, end = int64(0), int64(0)
    for row in range(height):
        for col in range(width):
            if labels[row, col] < 0:
                continue
            for side in range(4):
                r = row + (side == 0) - (side == 1)
                c = col + (side == 2) - (side == 3)
                if 0 <= r < height and 0 <= c < width and mask[r, c] != 0 and labels[r, c] < 0:
                    # Only points with a neighbour to number begin to spread.
                    work[end] = row * width + col
                    end += 1
                    break
    numbered = int64(0)
    for _ in range(rounds):
        if begin == end:
            break
        # A round ends with the points that it began with, so all numbers spread equally fast.
        stop = end
        while begin < stop:
            row, col = work[begin] // width, work[begin] % width
            begin += 1
            for side in range(4):
                r = row + (side == 0) - (side == 1)
                c = col + (side == 2) - (side == 3)
                if 0 <= r < height and 0 <= c < width and mask[r, c] != 0 and labels[r, c] < 0:
                    labels[r, c] = labels[row, col]
                    work[end] = r * width + c
                    end += 1
                    numbered += 1
    return numbered


@njit(int64(MASK, FIXED, LABELS, LIST), cache=True, nogil=True)
def split_parts(body, labels, parts, work):
    """Number the connected parts (4 neighbours) of each region's points that are in a mask, by first points.

    Args:
        body: uint8 (h, w), the mask.
        labels: int32 (h, w), regions, -1 none.
        parts: int32 (h, w), overwritten, -1 elsewhere.
        work: int32 (h * w,), scratch.

    Returns:
        The number of parts.
    """
    height, width = body.shape
    parts[:, :] = -1
    count = int64(0)
    for first_row in range(height):
        for first_col in range(width):
            if body[first_row, first_col] == 0 or labels[first_row, first_col] < 0 or parts[first_row, first_col] >= 0:
                continue
            parts[first_row, first_col] = count
            work[0] = first_row * width + first_col
            waiting = 1
            while waiting > 0:
                waiting -= 1
                row, col = work[waiting] // width, work[waiting] % width
                for side in range(4):
                    r = row + (side == 0) - (side == 1)
                    c = col + (side == 2) - (side == 3)
                    if r < 0 or r >= height or c < 0 or c >= width or body[r, c] == 0 or parts[r, c] >= 0:
                        continue
                    if labels[r, c] == labels[row, col]:
                        parts[r, c] = count
                        work[waiting] = r * width + c
                        waiting += 1
            count += 1
    return count
