"""Kernel that keeps a window to where a short way between two points can lead."""

from __future__ import annotations

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C")
int64 = types.int64

ASIDE = 4 * 141 * 2
"""Room on both sides, in hundredths of a point: a straight line between the centres of two points that are kept, and
the corners that a way may not cut, lie within."""


@njit(types.void(STATE, int64, int64, int64, int64, int64), cache=True, nogil=True)
def keep_between(state, from_row, from_col, to_row, to_col, most):
    """Block every element of a window over which no way between two others can lead.

    Without obstacles a way takes its shorter side diagonally, at 141 a point, and the rest straight, at 100. What is
    left of the window is convex.

    Args:
        state: uint8 (m, n), as in `agent.routes.kernels.wave`; changed in place.
        from_row: Row of the one element.
        from_col: Its column.
        to_row: Row of the other element.
        to_col: Its column.
        most: Longest way, in hundredths of a point.
    """
    most += ASIDE
    for row in range(state.shape[0]):
        up, down = abs(row - from_row), abs(row - to_row)
        line = state[row]
        for col in range(line.size):
            left, right = abs(col - from_col), abs(col - to_col)
            length = 100 * max(up, left) + 41 * min(up, left) + 100 * max(down, right) + 41 * min(down, right)
            line[col] = line[col] if length <= most else 0
