"""Kernels of the ground: closing the points within discs, and finding the points on which bodies are."""

from __future__ import annotations

import numpy as np
from numba import njit, types

REACH = types.Array(types.boolean, 2, "A", readonly=True)
POINTS = types.Array(types.boolean, 2, "C")
BOXES = types.Array(types.int64, 2, "C", readonly=True)
DISCS = PLACES = types.Array(types.float64, 2, "C", readonly=True)
FLOAT = types.float64


@njit(types.void(REACH, POINTS, BOXES, DISCS, BOXES), cache=True, nogil=True)
def close_discs(reach, is_open, boxes, discs, bounds):
    """Open the points of some boxes, and then close those whose centres lie within some discs.

    For example, a disc of radius 1.1 around a point's centre closes five points: that one and the four beside it.

    Args:
        reach: bool (h, w), the points that can be open.
        is_open: bool (h + 2, w + 2), changed in place: those that are, framed by one closed point on every side.
        boxes: int64 (b, 4), first row, end row, first column and end column in `is_open`; ends are exclusive.
        discs: float64 (d, 3), row, column and radius of each, in points of `is_open`.
        bounds: int64 (d, 4), a box that holds all points of each disc.
    """
    for top, bottom, left, right in boxes:
        # The frame stays closed, whatever the box.
        for row in range(max(top, 1), min(bottom, is_open.shape[0] - 1)):
            for col in range(max(left, 1), min(right, is_open.shape[1] - 1)):
                is_open[row, col] = reach[row - 1, col - 1]
    for disc in range(discs.shape[0]):
        row_at, col_at, radius = discs[disc]
        top, bottom, left, right = bounds[disc]
        for row in range(top, bottom):
            up = row + 0.5 - row_at
            for col in range(left, right):
                across = col + 0.5 - col_at
                if up * up + across * across < radius * radius:
                    is_open[row, col] = False


@njit(types.Array(types.int64, 2, "C")(REACH, PLACES, FLOAT, FLOAT, FLOAT), cache=True, nogil=True)
def open_elements(is_open, places, x0, y0, point):
    """Find the open elements on which some places lie.

    For example, with the origin at (0, 0) and points of 1 m, the place (2.5, 0.5) lies on the element (1, 3): the frame
    shifts both by one.

    Args:
        is_open: bool (m, n), framed by closed points, which stand for all that lies off the terrain.
        places: float64 (k, 2), x and y in m.
        x0: The terrain's origin, m.
        y0: Likewise.
        point: The side of its points, m.

    Returns:
        int64 (k, 2), row and column; -1 where the element is closed.
    """
    elements = np.full((places.shape[0], 2), -1, dtype=np.int64)
    for place in range(places.shape[0]):
        # Compared as floats: a place that is far off would overflow an integer.
        row = np.floor((places[place, 1] - y0) / point) + 1.0
        col = np.floor((places[place, 0] - x0) / point) + 1.0
        if 0.0 < row < is_open.shape[0] and 0.0 < col < is_open.shape[1] and is_open[int(row), int(col)]:
            elements[place, 0], elements[place, 1] = int(row), int(col)
    return elements
