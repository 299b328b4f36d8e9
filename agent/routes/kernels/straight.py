"""Kernel of straight paths: the path to every point is the line to it (paper, patrolling without obstacles)."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
GRID = types.Array(types.int32, 2, "C")
MAP = types.Array(types.uint8, 2, "C", readonly=True)
FAR = types.Array(types.int32, 2, "C", readonly=True)


@njit(types.void(MAP, MAP, STATE, types.int64, types.int64), cache=True, nogil=True)
def open_up(ground, patrolled, state, top, left):
    """Copy the part of the ground under a window, and open its patrolled points; the window's frame is left alone.

    Args:
        ground: uint8 (h + 2, w + 2), as of `agent.routes.ground.Ground.state`.
        patrolled: uint8 (h, w), what to set at each point of the terrain.
        state: uint8 (m, n), as in `agent.routes.kernels.wave`; overwritten inside the frame.
        top: Row of the terrain under row 1 of the window, not negative.
        left: Column of the terrain under column 1 of the window, not negative.
    """
    rows, cols = state.shape[0] - 2, state.shape[1] - 2
    for row in range(rows):
        known, also = ground[top + row + 1, left + 1 : left + 1 + cols], patrolled[top + row, left : left + cols]
        there = state[row + 1, 1 : cols + 1]
        for k in range(there.size):
            there[k] = known[k] | also[k]


@njit(
    types.void(STATE, GRID, FAR, types.int64, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def rays(state, length, away, start_row, start_col, span, limit):
    """Settle every open point whose straight line from the start is short enough; lines pass through obstacles.

    Args:
        state: uint8 (m, n), as in `agent.routes.kernels.wave`; changed in place.
        length: int32 (m, n), path lengths in hundredths of a point; filled in.
        away: int32 (r + 1, 2 c + 1), path lengths by rows and columns between the points, as `between` gives them; r
            and c are no less than ``span``, or than the rows and columns to any point of the window.
        start_row: The start's row in the window.
        start_col: The start's column in the window.
        span: Largest distance from the start, in rows and in columns.
        limit: Longest path to settle, in hundredths of a point.
    """
    rows, cols = state.shape
    left, right = max(0, start_col - span), min(cols, start_col + span + 1)
    shift = away.shape[1] // 2 - start_col
    for row in range(max(0, start_row - span), min(rows, start_row + span + 1)):
        known, far = state[row, left:right], length[row, left:right]
        lengths = away[abs(row - start_row), left + shift : right + shift]
        for k in range(known.size):
            far[k] = lengths[k]
            known[k] |= 3 if known[k] & 3 != 0 and lengths[k] <= limit else 0


@njit(types.void(GRID), cache=True, nogil=True)
def between(away):
    """The lengths of straight lines.

    Args:
        away: int32 (r + 1, 2 c + 1), the lengths by rows between the points and by columns plus c, rounded to the
            nearest hundredth of a point; filled in.
    """
    rows, cols = away.shape
    for up in range(rows):
        for col in range(cols):
            across = col - cols // 2
            away[up, col] = int(100.0 * math.sqrt(up * up + across * across) + 0.5)
