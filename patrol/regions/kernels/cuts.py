"""Kernels that find the cuts by which a polygon's concave corners vanish.

A corner's cone holds the directions in which a cut leaves two convex angles: between the extensions of its two sides.
Corners are rows of float64 (n, 2), free ground on the left of the way from each to the next; lengths are in points.
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
    left = bx * dy - by * dx
    right = ax * dy - ay * dx
    if left < -min(slack * max(along, cut), 0.25 * along * cut) - FLAT:
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
        if w <= v or w in (before[v], after[v]):
            continue
        dx, dy = corners[w, 0] - corners[v, 0], corners[w, 1] - corners[v, 1]
        if math.sqrt(dx * dx + dy * dy) > longest * (reach[v] + reach[w]) or dx * dx + dy * dy < FLAT:
            continue
        served = True
        for end in range(2):
            at = v if end == 0 else w
            p, q = before[at], after[at]
            ax, ay = corners[at, 0] - corners[p, 0], corners[at, 1] - corners[p, 1]
            bx, by = corners[q, 0] - corners[at, 0], corners[q, 1] - corners[at, 1]
            turn = 1.0 if end == 0 else -1.0
            served = served and _in_cone(ax, ay, bx, by, turn * dx, turn * dy, slack)
        if served and _in_sight(corners, after, v, w, margin):
            found[index] = 1


@njit(
    types.void(PLACES, INDICES, INDICES, INDICES, PLACES, PLACES, int64, WAYS),
    cache=True,
    nogil=True,
)
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
        at = concave[index]
        x, y = corners[at, 0], corners[at, 1]
        ax, ay = x - corners[before[at], 0], y - corners[before[at], 1]
        bx, by = corners[after[at], 0] - x, corners[after[at], 1] - y
        back, ahead = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        for k in range(begin.shape[0]):
            px, py = begin[k, 0] - x, begin[k, 1] - y
            qx, qy = end[k, 0] - x, end[k, 1] - y
            low, high = 0.0, 1.0
            for side in range(2):
                sx, sy = (ax / back, ay / back) if side == 0 else (bx / ahead, by / ahead)
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
            if 1e-6 < away < ways[at, 0]:
                ways[at, 0] = away
                ways[at, 1] = share
                ways[at, 2] = x + fx
                ways[at, 3] = y + fy
                ways[at, 4] = first + k
