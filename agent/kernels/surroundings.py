"""Kernels that fill in the observations of a robot around itself: by points, and by eight directions."""

from __future__ import annotations

import numpy as np
from numba import njit, types

float64 = types.float64
int64 = types.int64
OPEN = types.Array(types.boolean, 2, "A", readonly=True)
RAYS = types.Array(types.int64, 3, "C", readonly=True)
WAYS = types.Array(types.int64, 1, "C")
PLACES = types.Array(types.float64, 2, "C")
WINDOW = types.Array(types.float32, 3, "C")
TICKS = types.Array(types.int64, 1, "C")
FEATURES = types.Array(types.float32, 2, "C")
SEEN = types.Array(types.int32, 2, "C", readonly=True)
PATROLLED = types.Array(types.boolean, 2, "C", readonly=True)
SUMS = types.Array(types.int64, 2, "C")

NARROW = np.sqrt(2.0) - 1.0
"""The tangent of half a sector, 22.5 degrees."""


@njit(types.void(SEEN, PATROLLED, OPEN, int64, int64, int64, int64, WINDOW), cache=True, nogil=True)
def fill_window(last_seen, patrolled, is_open, row, col, tick, stalest, window):
    """Fill in the window around a point.

    For example, a point last seen 30 ticks ago gives 0.5 if the stalest age is 60.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen; below 0 counts as tick 0.
        patrolled: bool (h, w), the points that have an age.
        is_open: bool (h, w), the points on which the robot's centre may be.
        row: Of the point.
        col: Of the point.
        tick: Now.
        stalest: The age by which the others are divided, at least 1.
        window: float32 (2, n, n), n odd, filled: ages, and 1 for open points; 0 off the grid.
    """
    height, width = last_seen.shape
    half = window.shape[1] // 2
    window[:] = 0.0
    for r in range(max(row - half, 0), min(row + half + 1, height)):
        for c in range(max(col - half, 0), min(col + half + 1, width)):
            if patrolled[r, c]:
                window[0, r - row + half, c - col + half] = (tick - max(last_seen[r, c], 0)) / stalest
            if is_open[r, c]:
                window[1, r - row + half, c - col + half] = 1.0


@njit(types.void(OPEN, int64, int64, RAYS, WAYS), cache=True, nogil=True)
def count_free(is_open, row, col, rays, ways):
    """Count the open points along each of some rays, from a point to the first that is closed or off the grid.

    For example, a ray over an open, an open and a closed point gives 2.

    Args:
        is_open: bool (h, w).
        row: Of the point.
        col: Of the point.
        rays: int64 (n, k, 2), rows and columns of the points of each ray, from the point.
        ways: int64 (n,), filled: 0 to k.
    """
    height, width = is_open.shape
    for ray in range(rays.shape[0]):
        ways[ray] = rays.shape[1]
        for k in range(rays.shape[1]):
            r, c = row + rays[ray, k, 0], col + rays[ray, k, 1]
            if r < 0 or r >= height or c < 0 or c >= width or not is_open[r, c]:
                ways[ray] = k
                break


@njit(types.void(PLACES, TICKS, float64, float64, float64, int64, float64, FEATURES), cache=True, nogil=True)
def fill_heard(places, ticks, x, y, longest, tick, oldest, heard):
    """Fill in the nearest of the robots heard, the nearest first; of equal ones the first.

    For example, on a terrain of 50 m, a robot 5 m to the right that was heard 10 ticks ago, of at most 100, gives 1,
    0.1, 0 and 0.1.

    Args:
        places: float64 (n, 2), x and y of each, m.
        ticks: int64 (n,), when each was heard; changed.
        x: Of the robot itself, m.
        y: Of the robot itself, m.
        longest: Side of the terrain by which distances are divided, m.
        tick: Now.
        oldest: Ticks after which a position counts as old as any.
        heard: float32 (k, 4), filled: 1, x and y from the robot, and how long ago; 0 where there are no more.
    """
    heard[:] = 0.0
    for slot in range(heard.shape[0]):
        # One search for each slot: there are few slots, and a sort would need memory.
        nearest, nearest_square = -1, np.inf
        for k in range(ticks.size):
            dx, dy = places[k, 0] - x, places[k, 1] - y
            square = dx * dx + dy * dy
            if ticks[k] >= 0 and square < nearest_square:
                nearest, nearest_square = k, square
        if nearest < 0:
            break
        heard[slot, 0] = 1.0
        heard[slot, 1] = min(max((places[nearest, 0] - x) / longest, -1.0), 1.0)
        heard[slot, 2] = min(max((places[nearest, 1] - y) / longest, -1.0), 1.0)
        heard[slot, 3] = min((tick - ticks[nearest]) / oldest, 1.0)
        # Marks it as used; no second array is needed.
        ticks[nearest] = -1


@njit(
    types.void(SUMS, int64, WAYS, int64, PLACES, float64, float64, float64, float64, float64, FEATURES),
    cache=True,
    nogil=True,
)
def fill_features(sums, stalest, ways, longest, places, x, y, half, across, up, features):
    """Fill in the observations of a robot by sectors.

    Args:
        sums: int64 (8, 4), from `sum_ages`.
        stalest: The age by which the others are divided, at least 1.
        ways: int64 (8,), from `count_free`.
        longest: The most that it counts.
        places: float64 (n, 2), x and y of the other robots, m.
        x: Of the robot, m.
        y: Of the robot, m.
        half: m, from the robot to where others are no longer near.
        across: Cosine of the robot's heading.
        up: Sine of it.
        features: float32 (8, 5), filled: mean age near the robot and farther away, free way, nearness of the nearest
            robot, and cosine of the angle between the sector's middle and the heading.
    """
    for sector_row in range(8):
        for k in range(2):
            # A sector without points has a sum of 0, and so a mean of 0.
            count = max(sums[sector_row, 2 * k + 1], 1)
            features[sector_row, k] = sums[sector_row, 2 * k] / (count * stalest)
        features[sector_row, 2] = ways[sector_row] / longest
        features[sector_row, 3] = 0.0
    # Written out by the addition theorem: the cosine of the heading less 0, 45, 90, ... degrees.
    side = np.sqrt(0.5)
    features[0, 4], features[4, 4] = across, -across
    features[2, 4], features[6, 4] = up, -up
    features[1, 4], features[5, 4] = side * (across + up), -side * (across + up)
    features[3, 4], features[7, 4] = side * (up - across), -side * (up - across)
    for k in range(places.shape[0]):
        dx, dy = places[k, 0] - x, places[k, 1] - y
        # For example, 0.75 at a quarter of the way.
        nearness = 1.0 - np.sqrt(dx * dx + dy * dy) / half
        if nearness <= 0.0:
            continue
        # A robot at the very same place falls into sector 0.
        if abs(dy) <= NARROW * abs(dx):
            sector = 0 if dx >= 0.0 else 4
        elif abs(dx) <= NARROW * abs(dy):
            sector = 2 if dy > 0.0 else 6
        elif dy > 0.0:
            sector = 1 if dx > 0.0 else 3
        else:
            sector = 7 if dx > 0.0 else 5
        features[sector, 3] = max(features[sector, 3], nearness)


@njit(types.void(SEEN, PATROLLED, int64, int64, int64, int64, SUMS), cache=True, nogil=True)
def sum_ages(last_seen, patrolled, row, col, half, tick, sums):
    """Sum the ages of the patrolled points in each of eight sectors around a point, near it and farther away.

    Sector s is centred on the direction of 45 s degrees, counted from the columns' direction towards the rows'. The
    point itself is in none. Sums of whole numbers do not depend on their order.

    Args:
        last_seen: int32 (h, w), the tick at which each point was last seen; below 0 counts as tick 0.
        patrolled: bool (h, w), the points that count.
        row: Of the point; it may lie off the grid, as may the column.
        col: Of the point.
        half: Points on each side of it that are near.
        tick: Now.
        sums: int64 (8, 4), filled: for each sector the sum of the ages and the number of near points, and the same of
            all others.
    """
    height, width = last_seen.shape
    bounds = np.empty(7, dtype=np.int64)
    sectors = np.empty(6, dtype=np.int64)
    sums[:] = 0
    for r in range(height):
        up = r - row
        if up == 0:
            bounds[0], bounds[1], bounds[2], bounds[3] = 0, col, col + 1, width
            sectors[0], sectors[1], sectors[2] = 4, -1, 0
            runs = 3
        else:
            rise = abs(up)
            # The tangent is irrational, so that no point but the centre lies on a border between sectors.
            # Columns up to `steep` away lie in the sector straight up or down, those beyond `flat` in the ones to the
            # sides.
            steep = np.int64(np.floor(NARROW * rise))
            flat = np.int64(np.floor(rise / NARROW))
            bounds[0], bounds[1], bounds[2] = 0, col - flat, col - steep
            bounds[3], bounds[4], bounds[5] = col + steep + 1, col + flat + 1, width
            sectors[0], sectors[4] = 4, 0
            if up > 0:
                sectors[1], sectors[2], sectors[3] = 3, 2, 1
            else:
                sectors[1], sectors[2], sectors[3] = 5, 6, 7
            runs = 5
        is_near = abs(up) <= half
        for run in range(runs):
            sector = sectors[run]
            if sector < 0:
                continue
            # Clipped to the grid. An empty run has equal ends, so no later range is negative.
            first = min(max(bounds[run], 0), width)
            last = max(min(bounds[run + 1], width), first)
            near_first = min(max(col - half, first), last) if is_near else last
            near_last = max(min(col + half + 1, last), near_first) if is_near else last
            # Before, near and after: three plain loops instead of a question for each point.
            for part in range(3):
                if part == 0:
                    begin, end = first, near_first
                elif part == 1:
                    begin, end = near_first, near_last
                else:
                    begin, end = near_last, last
                ages, count = 0, 0
                ticks, counts = last_seen[r, begin:end], patrolled[r, begin:end]
                for k in range(ticks.size):
                    age = tick - max(ticks[k], 0)
                    ages += age if counts[k] else 0
                    count += 1 if counts[k] else 0
                column = 0 if part == 1 else 2
                sums[sector, column] += ages
                sums[sector, column + 1] += count
