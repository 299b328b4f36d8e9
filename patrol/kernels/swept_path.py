"""Exact swept motion of a disc against the terrain: the world moves bodies by it and minds predict by it.

All lengths are metres, angles radians. `blocked` is (height, width) uint8, row 0 at the lowest y, 1 where a
body may not be; point (row, col) covers [ox + col * point, ox + (col + 1) * point) by the same in y.
Everything off the grid is blocked. A disc touching a square is free: only a centre nearer than radius -
TOLERANCE to a blocked square overlaps it. A disc that already overlaps a square may only move away from it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

TOLERANCE = 1e-9
"""Rounding allowed in the distance (m) of a disc that only touches a square."""

WIDEST = 1e6
"""Radius in m of the widest circle whose centre is computed."""

SAGITTA = 1e-4
"""Largest distance (m) of a chord from the arc that it stands for."""

_MASK = types.Array(types.uint8, 2, "C", readonly=True)
_PATH = types.Array(types.float64, 2, "C")
_F = types.float64


@njit("UniTuple(float64, 3)(float64, float64, float64, float64, float64)", cache=True, nogil=True, error_model="numpy")
def arc_end(x, y, heading, distance, turn):
    """Pose after driving along an arc.

    For example, a quarter circle of 1 m to the left from (0, 0) with heading 0 ends at (0.64, 0.64, 1.57).

    Exact: the chord has length distance * sin(u) / u and bearing heading + u, u = turn / 2, which is well-conditioned
    from a straight line to a turn on the spot.

    Args:
        x: m.
        y: m.
        heading: rad.
        distance: m, negative: backwards.
        turn: Change of the heading, rad, positive: left.

    Returns:
        (x, y, heading), the heading in (-pi, pi].
    """
    half = 0.5 * turn
    # sin(u) / u is 0 / 0 on a straight line; two terms of its series are exact to the last bit for such small u.
    chord = distance * (math.sin(half) / half if abs(half) > 1e-5 else 1.0 - half * half / 6.0)
    turned = heading + 2.0 * half
    # Wrapped only where need be, so that a heading within bounds keeps all of its bits.
    if turned > math.pi or turned <= -math.pi:
        turned -= 2.0 * math.pi * math.ceil((turned - math.pi) / (2.0 * math.pi))
    return x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), turned


@njit(_F(_F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _squared_distance(x, y, left, low, right, high):
    """Squared distance (m^2) from a place to a closed rectangle."""
    dx = max(left - x, 0.0, x - right)
    dy = max(low - y, 0.0, y - high)
    return dx * dx + dy * dy


@njit(_F(_F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _entry_into_box(x0, y0, dx, dy, left, low, right, high):
    """Fraction in [0, 1] at which the move (dx, dy) from (x0, y0) enters the open rectangle; 2 for never.

    For example, 0.25 for a move of 4 m towards a rectangle 1 m ahead.
    """
    first, last = 0.0, 1.0
    if dx != 0.0:
        a, b = (left - x0) / dx, (right - x0) / dx
        first, last = max(first, min(a, b)), min(last, max(a, b))
    elif x0 <= left or x0 >= right:
        return 2.0
    if dy != 0.0:
        a, b = (low - y0) / dy, (high - y0) / dy
        first, last = max(first, min(a, b)), min(last, max(a, b))
    elif y0 <= low or y0 >= high:
        return 2.0
    return first if first < last else 2.0


@njit(_F(_F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _entry_into_circle(x0, y0, dx, dy, cx, cy, radius):
    """Fraction in [0, 1] at which the move (dx, dy) from (x0, y0) enters the open circle; 2 for never.

    For example, 0.5 for a move of 4 m towards the centre of a circle of 1 m that is 3 m ahead.
    """
    a = dx * dx + dy * dy
    b = (x0 - cx) * dx + (y0 - cy) * dy
    c = (x0 - cx) ** 2 + (y0 - cy) ** 2 - radius * radius
    root = b * b - a * c
    # A line that only touches the circle has a root of 0 and does not enter it.
    if a == 0.0 or root <= 0.0:
        return 2.0
    root = math.sqrt(root)
    first, last = max((-b - root) / a, 0.0), min((-b + root) / a, 1.0)
    return first if first < last else 2.0


@njit(_F(_F, _F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _entry_fraction(x0, y0, dx, dy, left, low, right, high, radius):
    """Fraction in [0, 1] at which a centre comes nearer than `radius` to the square; 2 for never."""
    # A square grown by a disc is two rectangles and four circles.
    first = min(
        _entry_into_box(x0, y0, dx, dy, left - radius, low, right + radius, high),
        _entry_into_box(x0, y0, dx, dy, left, low - radius, right, high + radius),
    )
    for cx in (left, right):
        for cy in (low, high):
            first = min(first, _entry_into_circle(x0, y0, dx, dy, cx, cy, radius))
    return first


@njit(_F(_F, _F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _free_of_square(x0, y0, dx, dy, left, low, right, high, radius):
    """Largest fraction in [0, 1] of the move (dx, dy) that keeps a disc at (x0, y0) off one square.

    Whether it hits is judged at radius - TOLERANCE, where it stops at radius: a disc stopped by a square
    touches it and is free to slide along it.
    """
    inner = max(radius - TOLERANCE, 0.0)
    if _squared_distance(x0, y0, left, low, right, high) < inner * inner:
        # It overlaps already. Any move away is free, or a body put there could never leave.
        away_x = x0 - min(max(x0, left), right)
        away_y = y0 - min(max(y0, low), high)
        return 1.0 if away_x * dx + away_y * dy > 0.0 else 0.0
    if _entry_fraction(x0, y0, dx, dy, left, low, right, high, inner) > 1.0:
        return 1.0
    return min(_entry_fraction(x0, y0, dx, dy, left, low, right, high, radius), 1.0)


@njit(_F(_F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _free_of_edge(a0, da, lowest, highest):
    """Largest fraction in [0, 1] of a move by `da` from `a0` that stays in [lowest, highest] on one axis.

    For example, 0.5 for a move by -2 m from 1 m, with the lowest at 0 m.
    """
    if da < 0.0 and a0 + da < lowest - TOLERANCE:
        return max((lowest - a0) / da, 0.0)
    if da > 0.0 and a0 + da > highest + TOLERANCE:
        return max((highest - a0) / da, 0.0)
    # A body outside that does not move along this axis is stuck unless it moves inwards along it.
    if da == 0.0 and (a0 < lowest - TOLERANCE or a0 > highest + TOLERANCE):
        return 0.0
    return 1.0


@njit(_F(_MASK, _F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def free_fraction_line(blocked, point, ox, oy, x0, y0, x1, y1, radius):
    """Largest fraction in [0, 1] of a straight move along which a disc stays free.

    For example, a disc of 0.5 m that moves from x = 1 to 3 m, to a wall at 3 m, gets to 2.5 m: the fraction is 0.75.

    Each point of the swept capsule's rows and columns is looked at once. All arguments must be finite.

    Args:
        blocked: uint8 (h, w), 1 where a body may not be.
        point: Side of one point, m.
        ox: x of the grid's origin, m.
        oy: y of the grid's origin, m.
        x0: Of the move's beginning, m.
        y0: Of the move's beginning, m.
        x1: Of the move's end, m.
        y1: Of the move's end, m.
        radius: Of the disc, m.
    """
    height, width = blocked.shape
    dx, dy = x1 - x0, y1 - y0
    free = min(
        _free_of_edge(x0, dx, ox + radius, ox + width * point - radius),
        _free_of_edge(y0, dy, oy + radius, oy + height * point - radius),
    )
    length = math.hypot(dx, dy)
    # A little more, so that rounding leaves out no row or column that matters.
    reach = radius + 1e-6
    low_row = max(math.floor((min(y0, y1) - reach - oy) / point), 0)
    high_row = min(math.floor((max(y0, y1) + reach - oy) / point), height - 1)
    for row in range(low_row, high_row + 1):
        low = oy + row * point
        high = low + point
        first, last = 0.0, 1.0
        if dy != 0.0:
            a, b = (low - reach - y0) / dy, (high + reach - y0) / dy
            # The part of the move during which the disc touches this row; only columns near that part are looked at.
            first = min(max(min(a, b), 0.0), 1.0)
            last = min(max(max(a, b), 0.0), 1.0)
        xa, xb = x0 + first * dx, x0 + last * dx
        low_col = max(math.floor((min(xa, xb) - reach - ox) / point), 0)
        high_col = min(math.floor((max(xa, xb) + reach - ox) / point), width - 1)
        for col in range(low_col, high_col + 1):
            if blocked[row, col] != 0:
                left = ox + col * point
                near = radius + free * length
                # A square beyond the way that is still free cannot shorten it.
                if _squared_distance(x0, y0, left, low, left + point, high) > near * near:
                    continue
                free = min(free, _free_of_square(x0, y0, dx, dy, left, low, left + point, high, radius))
                if free <= 0.0:
                    return 0.0
    return free


@njit(types.int64(_F, _F, _F), cache=True, nogil=True, error_model="numpy")
def chord_count(distance, turn, longest):
    """Count the equal chords that stand for an arc: within SAGITTA of it and at most `longest`; 1 for a line.

    For example, 112 for an arc of 10 m that turns by 1 rad.

    A chord of length L that turns by u lies within L * u / 8 of its arc. No chord turns by more than half a circle.

    Args:
        distance: Along the arc, m.
        turn: Change of the heading, rad.
        longest: Of a chord, m.
    """
    if turn == 0.0 or distance == 0.0:
        return 1
    # n chords of length L / n turn by u / n each, so that their error falls with the square of n.
    near = math.ceil(math.sqrt(abs(distance) * abs(turn) / (8.0 * SAGITTA)))
    return max(near, math.ceil(abs(distance) / longest), math.ceil(abs(turn) / math.pi), 1)


@njit(types.void(_PATH, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def arc_points(path, x, y, heading, distance, turn):
    """Fill `path` with the ends of n equal chords of an arc; the last is `arc_end`'s.

    Args:
        path: float64 (n + 1, 2), overwritten.
        x: m.
        y: m.
        heading: rad.
        distance: m, negative: backwards.
        turn: Change of the heading, rad, positive: left.
    """
    count = path.shape[0] - 1
    path[0, 0], path[0, 1] = x, y
    for i in range(1, count + 1):
        path[i, 0], path[i, 1], _ = arc_end(x, y, heading, distance * (i / count), turn * (i / count))


@njit(types.boolean(_PATH, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _path_hits(path, left, low, right, high, radius):
    """Return True if a disc swept along the chords of `path` hits one square."""
    for i in range(path.shape[0] - 1):
        x0, y0 = path[i, 0], path[i, 1]
        dx, dy = path[i + 1, 0] - x0, path[i + 1, 1] - y0
        # An upper bound of the chord's length that needs no root.
        near = radius + abs(dx) + abs(dy)
        if _squared_distance(x0, y0, left, low, right, high) >= near * near:
            continue
        if _free_of_square(x0, y0, dx, dy, left, low, right, high, radius) < 1.0:
            return True
    return False


@njit(types.boolean(_PATH, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _path_leaves(path, left, low, right, high, radius):
    """Return True if a disc swept along the chords of `path` leaves the rectangle."""
    for i in range(path.shape[0] - 1):
        x0, y0 = path[i, 0], path[i, 1]
        if _free_of_edge(x0, path[i + 1, 0] - x0, left + radius, right - radius) < 1.0:
            return True
        if _free_of_edge(y0, path[i + 1, 1] - y0, low + radius, high - radius) < 1.0:
            return True
    return False


@njit(types.uint8(_MASK, _F, _F, _F, _F, _F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def free_arc(blocked, point, ox, oy, x, y, heading, distance, turn, radius):
    """Return True if a disc can drive a whole arc.

    The arc is swept as chords of at most half a point that lie within SAGITTA of it. A blocked square is compared with
    them only if the ring that the disc sweeps on the whole circle reaches it; of a circle beyond WIDEST that is not
    asked, for its centre is so far off that nothing is left of the difference. All arguments must be finite.

    Args:
        blocked: uint8 (h, w), 1 where a body may not be.
        point: Side of one point, m.
        ox: x of the grid's origin, m.
        oy: y of the grid's origin, m.
        x: m.
        y: m.
        heading: rad.
        distance: m, negative: backwards.
        turn: Change of the heading, rad, positive: left.
        radius: Of the disc, m.

    Returns:
        1 when the way is free, else 0.
    """
    height, width = blocked.shape
    path = np.empty((chord_count(distance, turn, 0.5 * point) + 1, 2), dtype=np.float64)
    arc_points(path, x, y, heading, distance, turn)
    if _path_leaves(path, ox, oy, ox + width * point, oy + height * point, radius):
        return 0
    ring = distance / turn if abs(turn) * WIDEST > abs(distance) else 0.0
    cx, cy = x - ring * math.sin(heading), y + ring * math.cos(heading)
    # Half a square's diagonal turns its centre's distance into bounds on its nearest place's.
    reach = radius + SAGITTA + 0.7072 * point
    x_min, x_max, y_min, y_max = x, x, y, y
    for i in range(1, path.shape[0]):
        # The box of the chords' ends, since an arc may bulge beyond the box of its two ends.
        x_min, x_max = min(x_min, path[i, 0]), max(x_max, path[i, 0])
        y_min, y_max = min(y_min, path[i, 1]), max(y_max, path[i, 1])
    low_row = max(math.floor((y_min - radius - oy) / point), 0)
    high_row = min(math.floor((y_max + radius - oy) / point), height - 1)
    low_col = max(math.floor((x_min - radius - ox) / point), 0)
    high_col = min(math.floor((x_max + radius - ox) / point), width - 1)
    for row in range(low_row, high_row + 1):
        low = oy + row * point
        for col in range(low_col, high_col + 1):
            if blocked[row, col] == 0:
                continue
            left = ox + col * point
            if ring != 0.0:
                away = math.hypot(left + 0.5 * point - cx, low + 0.5 * point - cy)
                if abs(away - abs(ring)) > reach:
                    continue
            if _path_hits(path, left, low, left + point, low + point, radius):
                return 0
    return 1
