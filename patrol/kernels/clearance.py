"""Kernels of the room for bodies: how far obstacles are, which marked point is nearest, and connected parts.

Distances are exact and integer: squares of half points in `square_clearance`, squares of points in `nearest`. Each is
found in two passes, along the rows and then along the columns; both stop at the cap, so that their cost grows with the
cap and not with the distances. `measure_room` is a quick lower bound.
"""

from __future__ import annotations

from numba import njit, types

GRID = types.Array(types.uint8, 2, "C", readonly=True)
SPANS = types.Array(types.int32, 2, "C")
int32 = types.int32
int64 = types.int64


@njit(types.void(GRID, int64, SPANS, SPANS), cache=True, nogil=True)
def square_clearance(free, cap, along, clearance):
    """Squared distance from each point's centre to the nearest blocked square, or to the grid's edge.

    For example, 1 beside a blocked point, and 2 where one only touches a point's corner.

    Args:
        free: uint8 (h, w), 0 blocked.
        cap: In points; a distance of more than cap - 1/2 points reads as that.
        along: int32 (h, w), scratch.
        clearance: int32 (h, w), overwritten with the square of the distance in half points: 0 on a blocked point, 1
            beside one, (2 cap - 1)^2 at most.
    """
    height, width = free.shape
    for row in range(height):
        # Beyond the edge all is blocked.
        since = 0
        for col in range(width):
            since = 0 if free[row, col] == 0 else min(since + 1, cap)
            along[row, col] = since
        since = 0
        for col in range(width - 1, -1, -1):
            since = 0 if free[row, col] == 0 else min(since + 1, cap)
            # Both passes count from 1 beside a blocked point, so the smaller count is the nearer wall of the two.
            along[row, col] = min(along[row, col], since)
    for row in range(height):
        for col in range(width):
            aside = along[row, col]
            best = 0 if aside == 0 else (2 * aside - 1) * (2 * aside - 1)
            away = 1
            # Rows farther off than the best distance hold nothing nearer.
            while (2 * away - 1) * (2 * away - 1) < best:
                straight = (2 * away - 1) * (2 * away - 1)
                # The edge blocks over its whole length, so straight ahead is the nearest.
                if row - away < 0 or row + away >= height:
                    best = straight
                    break
                # 0 where the point straight ahead is itself blocked.
                aside = min(along[row - away, col], along[row + away, col])
                sideways = 0 if aside == 0 else (2 * aside - 1) * (2 * aside - 1)
                best = min(best, straight + sideways)
                away += 1
            clearance[row, col] = best


@njit(types.void(GRID, GRID, int64, int64, SPANS, SPANS), cache=True, nogil=True)
def nearest(marked, wanted, cap, limit, along, found):
    """The marked point nearest to each wanted point, walls or no walls.

    For example, with marks in columns 0 and 4 of a single row, the point in column 2 gets 0: both are 2 away, and 0 is
    the lower index.

    Args:
        marked: uint8 (h, w), non-zero where marked.
        wanted: uint8 (h, w), non-zero where wanted.
        cap: Whole points to look away.
        limit: Square of the largest distance in points.
        along: int32 (h, w), scratch.
        found: int32 (h, w), overwritten with the flat index of the nearest marked point (the lowest of several) at most
            sqrt(limit) away, or -1, and -1 where not wanted.
    """
    height, width = marked.shape
    # Farther than any point that is looked at.
    none = 2 * cap + 2
    for row in range(height):
        # So far to the left that the offset of a row without a mark is at least `none` and loses every comparison.
        last = -none
        for col in range(width):
            if marked[row, col] != 0:
                last = col
            along[row, col] = max(last - col, -none)
        ahead = width + none
        for col in range(width - 1, -1, -1):
            if marked[row, col] != 0:
                ahead = col
            # Not `<=`: of two marks equally far off, the one to the left has the lower index.
            if ahead - col < -along[row, col]:
                along[row, col] = ahead - col
    for row in range(height):
        for col in range(width):
            found[row, col] = -1
            if wanted[row, col] == 0:
                continue
            best = limit + 1
            index = int64(-1)
            away = 0
            # Equal distances too, since the lowest index of several counts.
            while away <= cap and away * away <= best:
                for turn in range(2):
                    r = row - away if turn == 0 else row + away
                    if r < 0 or r >= height or (turn == 1 and away == 0):
                        continue
                    aside = along[r, col]
                    square = away * away + aside * aside
                    candidate = r * width + col + aside
                    if square < best or (square == best and index >= 0 and candidate < index):
                        best = square
                        index = candidate
                away += 1
            found[row, col] = index


ROOM = types.Array(types.uint8, 2, "C")

MOST_ROOM = 255
"""Rows and columns beyond which distances are not told apart."""


@njit(types.void(GRID, ROOM), cache=True, nogil=True)
def measure_room(blocked, room):
    """Rows or columns, whichever are more, between each point and the nearest blocked one; all off the grid is blocked.

    For example, 3 in the middle of an open grid of 5 by 5 points, and 1 along its edge.

    In two passes over the grid, each of which asks four of a point's eight neighbours.

    Args:
        blocked: uint8 (h, w), 0 where bodies may be.
        room: uint8 (h, w), overwritten: 0 on a blocked point, 1 beside one, `MOST_ROOM` at most.
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
            before = 0 if walls[col] != 0 else min(distance + 1, MOST_ROOM)
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


LABELS = types.Array(types.int32, 2, "C")
LIST = types.Array(types.int32, 1, "C")


@njit(types.int32(GRID, LABELS, LIST), cache=True, nogil=True)
def label_parts(mask, labels, work):
    """Number the connected parts of a mask 1, 2, ... in the order of their first points.

    Bodies step to 8 neighbours, diagonally only where both orthogonal neighbours are in the mask. A body that can step
    diagonally can thus also go round by one of these, so the parts are those of 4 neighbours. For
    example, two points that touch at a corner only are two parts.

    Args:
        mask: uint8 (h, w), non-zero inside.
        labels: int32 (h, w), overwritten, 0 outside the mask.
        work: int32 (h * w,), scratch.

    Returns:
        The number of parts.
    """
    height, width = mask.shape
    labels[:, :] = 0
    parts = 0
    for first_row in range(height):
        for first_col in range(width):
            if mask[first_row, first_col] == 0 or labels[first_row, first_col] != 0:
                continue
            parts += 1
            labels[first_row, first_col] = parts
            work[0] = first_row * width + first_col
            waiting = 1
            while waiting > 0:
                waiting -= 1
                row = work[waiting] // width
                col = work[waiting] - row * width
                for side in range(4):
                    r = row + (side == 0) - (side == 1)
                    c = col + (side == 2) - (side == 3)
                    if r < 0 or r >= height or c < 0 or c >= width:
                        continue
                    # Numbered when it is put on the list and not when it is taken off it, so no point is listed
                    # twice.
                    if mask[r, c] != 0 and labels[r, c] == 0:
                        labels[r, c] = parts
                        work[waiting] = r * width + c
                        waiting += 1
    return parts
