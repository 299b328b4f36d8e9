"""Kernel of room: a quick lower bound of how far each point is from the nearest obstacle."""

from __future__ import annotations

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
ROOM = types.Array(types.uint8, 2, "C")

MOST = 255
"""Rows and columns beyond which distances are not told apart."""


@njit(types.void(GRID, ROOM), cache=True, nogil=True)
def measure_room(blocked, room):
    """Rows or columns, whichever are more, between each point and the nearest blocked one; all off the grid is blocked.

    For example, 3 in the middle of an open grid of 5 by 5 points, and 1 along its edge.

    In two passes over the grid, each of which asks four of a point's eight neighbours.

    Args:
        blocked: uint8 (h, w), 0 where bodies may be.
        room: uint8 (h, w), overwritten: 0 on a blocked point, 1 beside one, `MOST` at most.
    """
    height, width = blocked.shape
    for row in range(height):
        line, walls = room[row], blocked[row]
        above = room[row - 1 if row > 0 else 0]
        before = 0
        for col in range(width):
            distance = 0
            if walls[col] == 0 and row > 0 and col > 0 and col + 1 < width:
                distance = min(before, above[col - 1], above[col], above[col + 1])
            before = 0 if walls[col] != 0 else min(distance + 1, MOST)
            line[col] = before
    for row in range(height - 1, -1, -1):
        line = room[row]
        below = room[row + 1 if row + 1 < height else row]
        before = 0
        for back in range(width):
            col = width - 1 - back
            distance = 0
            if row + 1 < height and col > 0 and col + 1 < width:
                distance = min(before, below[col - 1], below[col], below[col + 1])
            before = min(int(line[col]), distance + 1)
            line[col] = before
