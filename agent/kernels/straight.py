"""Kernel of straight paths: the path to every point is the line to it (paper, patrolling without obstacles)."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
GRID = types.Array(types.int32, 2, "C")
MAP = types.Array(types.uint8, 2, "C", readonly=True)
float64 = types.float64
int64 = types.int64


@njit(types.void(MAP, MAP, STATE, types.int64, types.int64), cache=True, nogil=True)
def open_up(ground, patrolled, state, top, left):
    """Copy the part of the ground under a window, and open its patrolled points; the window's frame is left alone.

    Args:
        ground: uint8 (h + 2, w + 2), as of `agent.routes.ground.Ground.state`.
        patrolled: uint8 (h, w), what to set at each point of the terrain.
        state: uint8 (m, n), as in `agent.kernels.wave`; overwritten inside the frame.
        top: Row of the terrain under row 1 of the window, not negative.
        left: Column of the terrain under column 1 of the window, not negative.
    """
    rows, cols = state.shape[0] - 2, state.shape[1] - 2
    for row in range(rows):
        ground_row, also = ground[top + row + 1, left + 1 : left + 1 + cols], patrolled[top + row, left : left + cols]
        target = state[row + 1, 1 : cols + 1]
        for k in range(target.size):
            target[k] = ground_row[k] | also[k]


@njit(types.void(STATE, GRID, int64, int64, float64, float64, int64, int64), cache=True, nogil=True)
def rays(state, length, start_row, start_col, up, across, span, limit):
    """Settle every open point whose straight line from the robot is short enough; lines pass through obstacles.

    For example, a point 3 rows and 4 columns from a robot at its point's centre has the length 500.

    Args:
        state: uint8 (m, n), as in `agent.kernels.wave`; changed in place.
        length: int32 (m, n), path lengths, rounded to the nearest hundredth of a point; filled in. That of the robot's
            own point is 0.
        start_row: Row of the robot's point in the window.
        start_col: Its column.
        up: Rows from the centre of that point to the robot.
        across: Columns from there to the robot.
        span: Largest distance from the robot's point, in rows and in columns.
        limit: Longest path to settle, in hundredths of a point.
    """
    rows, cols = state.shape
    left, right = max(0, start_col - span), min(cols, start_col + span + 1)
    for row in range(max(0, start_row - span), min(rows, start_row + span + 1)):
        states, far = state[row, left:right], length[row, left:right]
        above = row - start_row - up
        for k in range(states.size):
            along = left + k - start_col - across
            far[k] = 100.0 * math.sqrt(above * above + along * along) + 0.5
            # A selection and no branch, which the compiler turns into vector code.
            states[k] |= 3 if states[k] & 3 != 0 and far[k] <= limit else 0
    length[start_row, start_col] = 0
