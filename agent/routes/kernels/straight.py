"""Kernel of straight paths: the path to every point is the line to it (paper, patrolling without obstacles)."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
GRID = types.Array(types.int32, 2, "C")
FAR = types.Array(types.int32, 2, "C", readonly=True)
index = types.uint64
"""Of what is sure not to be negative: a negative index would have to be asked for and counted from the end."""


@njit(
    types.void(STATE, GRID, FAR, types.int64, types.int64, types.int64, types.int64),
    cache=True,
    nogil=True,
)
def rays(state, length, away, start_row, start_col, span, limit):
    """Settle every open point whose straight line from the start is short enough; lines pass through obstacles.

    Args:
        state: uint8 (m, n), as in `agent.routes.kernels.wave.advance`, in two dimensions; changed in place.
        length: int32 (m, n), path lengths in hundredths of a point; filled in.
        away: int32 (r, r), path lengths by rows and columns between the points, as `between` gives them.
        start_row: The start's row in the window.
        start_col: The start's column in the window.
        span: Largest distance from the start, in rows and in columns.
        limit: Longest path to settle, in hundredths of a point.
    """
    rows, cols = state.shape
    left, right = max(0, start_col - span), min(cols, start_col + span + 1)
    for row in range(max(0, start_row - span), min(rows, start_row + span + 1)):
        known, far, lengths = state[row, left:right], length[row, left:right], away[abs(row - start_row)]
        for k in range(known.size):
            far[k] = lengths[index(abs(left + k - start_col))]
            known[k] |= 3 if known[k] & 3 != 0 and far[k] <= limit else 0


@njit(types.void(GRID), cache=True, nogil=True)
def between(away):
    """The lengths of straight lines.

    Args:
        away: int32 (r, r), the lengths by rows and columns between the points, rounded to the nearest hundredth of a
            point; filled in.
    """
    rows, cols = away.shape
    for up in range(rows):
        for across in range(cols):
            away[up, across] = int(100.0 * math.sqrt(up * up + across * across) + 0.5)
