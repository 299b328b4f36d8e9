"""Kernel of closing: points within discs are taken from the ground."""

from __future__ import annotations

from numba import njit, types

REACH = types.Array(types.boolean, 2, "A", readonly=True)
POINTS = types.Array(types.boolean, 2, "C")
BOXES = types.Array(types.int64, 2, "C", readonly=True)
DISCS = types.Array(types.float64, 2, "C", readonly=True)


@njit(types.void(REACH, POINTS, BOXES, DISCS, BOXES), cache=True, nogil=True)
def close_discs(reach, is_open, boxes, discs, bounds):
    """Open the points of some boxes, and then close those whose centres lie within some discs.

    Args:
        reach: bool (h, w), the points that can be open.
        is_open: bool (h + 2, w + 2), changed in place: those that are, framed by one closed point on every side.
        boxes: int64 (b, 4), first row, end row, first column and end column in `is_open`; ends are exclusive.
        discs: float64 (d, 3), row, column and radius of each, in points of `is_open`.
        bounds: int64 (d, 4), a box that holds all points of each disc.
    """
    for top, bottom, left, right in boxes:
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
