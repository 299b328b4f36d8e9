"""Kernels of the footprint: which points a robot sees from where it stands.

Each kernel writes a window of points; its element (0, 0) lies over the point (row0, col0) of the grid, which may lie
outside.
"""

from __future__ import annotations

import math

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
VIEW = types.Array(types.uint8, 2, "C")
int64 = types.int64
float64 = types.float64
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""


@njit(types.void(GRID, int64, int64, float64, VIEW, int64, int64), cache=True, nogil=True)
def cast(passable, row, col, radius, view, row0, col0):
    """Symmetric shadow casting: mark the passable points in sight of (row, col).

    A point is in sight when the line between the two centres crosses no impassable point, each of which blocks the full
    width of its own row (or, sideways, column). If a sees b then b sees a. Slopes are ratios of integers, so that
    nothing is rounded.

    Args:
        passable: uint8 (h, w), 0 blocks.
        row: Of the robot's point.
        col: Of the robot's point.
        radius: In points; centres farther than this are out of sight.
        view: uint8, overwritten with 1 in sight, 0 not; it holds every point within `radius` that lies on the grid, and
            the robot's own.
        row0: Of the grid, under the view's row 0.
        col0: Of the grid, under the view's column 0.
    """
    height, width = passable.shape
    if not (-1 <= row <= height and -1 <= col <= width):  # so far outside nothing is in sight
        view[:, :] = 0
        view[row - row0, col - col0] = 1
        return
    across_view = view.shape[1]
    ground, visible = passable.ravel(), view.ravel()
    # Rounding must not lose the point at exactly the radius.
    reach = int(radius + 1e-9)
    visible[:] = 0
    view[row - row0, col - col0] = 1
    # At least the square of the reach, or the farthest line would have no width: the root of a negative number.
    limit = max(radius * radius + 1e-9, float64(reach * reach))
    # Wedges of the current and of the next line: start and end slope as numerator and denominator.
    # A line has at most 2 * reach + 3 points, and between two wedges lies at least one of them.
    now = [(0, 0, 0, 0)] * (4 * reach + 8)
    after = [(0, 0, 0, 0)] * (4 * reach + 8)
    for quadrant in range(4):
        # A line lies `depth` away; along it `across` runs over the grid's points, from `least` to `most`.
        ahead = 1 if quadrant % 2 == 0 else -1
        if quadrant < 2:
            # Quadrants 0 and 1 go along rows, 2 and 3 along columns; strides let all four share one loop.
            deepest = height - 1 - row if ahead == 1 else row
            lowest, highest = -col, width - 1 - col
            outward, along, view_outward, view_along = ahead * width, 1, ahead * across_view, 1
        else:
            deepest = width - 1 - col if ahead == 1 else col
            lowest, highest = -row, height - 1 - row
            outward, along, view_outward, view_along = ahead, width, ahead, across_view
        here = row * width + col
        shown = (row - row0) * across_view + col - col0
        now[0] = (-1, 1, 1, 1)
        wedges = 1
        for depth in range(1, min(reach, deepest) + 1):
            here += outward
            shown += view_outward
            widest = int(math.sqrt(limit - depth * depth))
            coming = 0
            for wedge in range(wedges):
                start_up, start_down, end_up, end_down = now[wedge]
                # Exact in integers. Ties round into the wedge, which takes in no point that it only touches.
                first = max((2 * depth * start_up + start_down) // (2 * start_down), -widest - 1)
                last = min(-((end_down - 2 * depth * end_up) // (2 * end_down)), widest + 1)
                # Only points whose centre lies in the wedge are seen; that makes sight symmetric.
                low = max(-((-depth * start_up) // start_down), -widest)
                high = min((depth * end_up) // end_down, widest)
                before = 0 if first < lowest else -1  # beyond the grid nothing is open
                for across in range(max(first, lowest), min(last, highest) + 1):
                    is_open = ground[index(here + across * along)]
                    if is_open != 0:
                        # Behind an obstacle the wedge begins at its far edge.
                        if before == 0:
                            start_up = 2 * across - 1
                            start_down = 2 * depth
                            low = max(across, -widest)
                        if low <= across <= high:
                            visible[index(shown + across * view_along)] = 1
                        before = 1
                    else:
                        if before == 1:
                            after[coming] = (start_up, start_down, 2 * across - 1, 2 * depth)
                            coming += 1
                        before = 0
                if before == 1:
                    # Beyond the grid nothing is open, so the wedge ends at its edge.
                    if last > highest:
                        end_up, end_down = 2 * highest + 1, 2 * depth
                    after[coming] = (start_up, start_down, end_up, end_down)
                    coming += 1
            if coming == 0:
                break
            now, after = after, now
            wedges = coming


@njit(types.void(GRID, int64, int64, float64, VIEW, int64, int64), cache=True, nogil=True)
def disc(passable, row, col, radius, view, row0, col0):
    """Mark every passable point within `radius` points of (row, col), walls or no walls.

    For example, a radius of 1 marks five points on open ground.

    Args:
        passable: uint8 (h, w).
        row: Of the robot's point.
        col: Of the robot's point.
        radius: In points.
        view: As in `cast`.
        row0: As in `cast`.
        col0: As in `cast`.
    """
    height, width = passable.shape
    limit = radius * radius + 1e-9
    for i in range(view.shape[0]):
        r = row0 + i
        for j in range(view.shape[1]):
            c = col0 + j
            near = (r - row) * (r - row) + (c - col) * (c - col) <= limit
            inside = 0 <= r < height and 0 <= c < width
            view[i, j] = 1 if near and inside and passable[r, c] != 0 else 0


@njit(types.void(VIEW, float64, float64), cache=True, nogil=True)
def keep_sector(view, heading, angle):
    """Unmark the points outside a sector; the robot's own point, at the centre of the view, stays.

    Args:
        view: uint8 (m, m).
        heading: Of the sector's middle, rad.
        angle: Of the whole sector, rad.
    """
    reach = view.shape[0] // 2
    ahead_c = math.cos(heading)
    ahead_r = math.sin(heading)
    # Cosines are compared instead of bearings, so that no angle has to be wrapped.
    narrowest = math.cos(0.5 * angle)
    for dr in range(-reach, reach + 1):
        for dc in range(-reach, reach + 1):
            if view[reach + dr, reach + dc] == 0 or (dr == 0 and dc == 0):
                continue
            along = dc * ahead_c + dr * ahead_r
            # A point on the edge belongs to the sector, whatever the rounding.
            if along < narrowest * math.sqrt(dr * dr + dc * dc) - 1e-9:
                view[reach + dr, reach + dc] = 0
