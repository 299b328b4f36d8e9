"""Kernels of convex regions (`patrol.regions`): which points belong to each, and which parts a body finds of it.

Corners are rows of float64 (n, 2). Coordinates are in points and corners lie between points: point (row, col)
covers [col, col + 1) x [row, row + 1).
"""

from __future__ import annotations

import math

from numba import njit, types

PLACES = types.Array(types.float64, 2, "C", readonly=True)
int64 = types.int64
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

    For example, the square with the corners (0, 0) and (2, 2) holds four points; one from (0.6, 0.6) to (2, 2) holds
    only (1, 1).

    Args:
        polygon: float64 (k, 2), in points.
        number: To give.
        mask: uint8 (h, w), only its points are numbered.
        labels: int32 (h, w), -1 where there is no number.
    """
    corners = polygon.shape[0]
    # A row's centre is half a point above its lower edge, hence the 0.5 here and below.
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
            # Only edges that cross the row's centre line bound it. A level edge counts with its first corner; its
            # neighbours give the other.
            if min(y0, y1) <= y <= max(y0, y1):
                share = (y - y0) / (y1 - y0) if y1 != y0 else 0.0
                x = x0 + share * (x1 - x0)
                left, right = min(left, x), max(right, x)
        begin = int64(max(math.ceil(left - 0.5 - EDGE), 0))
        end = int64(min(math.floor(right - 0.5 + EDGE), mask.shape[1] - 1))
        for col in range(begin, end + 1):
            # The first region wins a point on an edge that two regions share.
            if mask[row, col] != 0 and labels[row, col] < 0:
                labels[row, col] = number


@njit(int64(MASK, int64, LABELS, LIST), cache=True, nogil=True)
def spread(mask, rounds, labels, work):
    """Give points of the mask without a number that of a neighbour (of four), nearest first.

    For example, with two rounds, numbers 7 and 8 at the ends of a row of six points become 7, 7, 7, 8, 8, 8.

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
                    # Parts end at the border of their region, even where a body could go on.
                    if labels[r, c] == labels[row, col]:
                        parts[r, c] = count
                        work[waiting] = r * width + c
                        waiting += 1
            count += 1
    return count
