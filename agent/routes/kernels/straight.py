"""Kernel of straight paths: the path to every point is the line to it (paper, patrolling without obstacles)."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
GRID = types.Array(types.int32, 2, "C")


@njit(
    types.void(STATE, GRID, GRID, types.int64, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def rays(state, length, bend, start_row, start_col, span, limit):
    """Settle every open point whose straight line from the start is short enough; lines pass through obstacles.

    Args:
        state: uint8 (m, n), as in `agent.routes.kernels.wave.advance`, in two dimensions; changed in place.
        length: int32 (m, n), path lengths rounded to the nearest hundredth of a point; filled in.
        bend: int32 (m, n), the flat index of the point itself; filled in.
        start_row: The start's row in the window.
        start_col: The start's column in the window.
        span: Largest distance from the start, in rows and in columns.
        limit: Longest path to settle, in hundredths of a point.
    """
    rows, cols = state.shape
    for row in range(max(0, start_row - span), min(rows, start_row + span + 1)):
        up = row - start_row
        for col in range(max(0, start_col - span), min(cols, start_col + span + 1)):
            across = col - start_col
            if state[row, col] & 3 == 0:
                continue
            far = int(100.0 * math.sqrt(up * up + across * across) + 0.5)
            if far <= limit:
                state[row, col] |= 3
                length[row, col] = far
                bend[row, col] = row * cols + col
