"""Kernels of the goal: how far a direction is free, and how the goal moves away from obstacles."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C", readonly=True)
PSI = types.Array(types.float32, 2, "C", readonly=True)
int64 = types.int64
float64 = types.float64


@njit(float64(STATE, float64, float64, float64, float64, float64), cache=True, nogil=True)
def free_run(state, row, col, up, across, distance):
    """Measure how far a ray stays on open points.

    For example, a ray from a point's centre to a wall that begins 2.5 points on gives 2.25.

    The ray is sampled every quarter point, and the last free sample counts.

    Args:
        state: uint8 (m, n), 0 in the two low bits is blocked.
        row: Where the ray begins, in points; point (i, j) covers [i, i + 1) x [j, j + 1).
        col: Where the ray begins, in points.
        up: Row component of the ray's unit vector.
        across: Column component of the ray's unit vector.
        distance: Longest run, in points.

    Returns:
        The free run in points.
    """
    rows, cols = state.shape
    steps = math.ceil(4.0 * distance)
    free = 0.0
    for index in range(1, steps + 1):
        run = min(0.25 * index, distance)
        r = math.floor(row + run * up)
        c = math.floor(col + run * across)
        # Off the window is blocked. `math.floor` rounds down below 0 too, where `int` would round up to 0.
        if r < 0 or r >= rows or c < 0 or c >= cols or state[r, c] & 3 == 0:
            break
        free = run
    return free


@njit(types.boolean(STATE, float64, float64, float64, float64), cache=True, nogil=True)
def _reaches(state, row, col, to_row, to_col):
    up = to_row - row
    across = to_col - col
    steps = math.ceil(4.0 * math.sqrt(up * up + across * across))
    for index in range(1, steps + 1):
        share = index / steps
        if state[math.floor(row + share * up), math.floor(col + share * across)] & 3 == 0:
            return False
    return True


@njit(int64(STATE, PSI, int64, int64, float64, float64, float64, float64, int64, types.boolean), cache=True, nogil=True)
def refine(state, psi, goal_row, goal_col, from_row, from_col, up, across, side, whole):
    """Find the point with the lowest psi in a square around the goal (paper, psi).

    A candidate is open, within reach of a straight line both from the goal and from the robot, and at a bearing within
    45 degrees of the robot's direction: near a wall the square would otherwise turn the robot round. Of equally good
    points the one nearest to the goal is taken, and of those the first, row by row.

    As printed, every point of the square is a candidate.

    Args:
        state: uint8 (h + 2, w + 2) with a blocked frame, 0 in the two low bits is blocked.
        psi: float32 (h, w), without the frame.
        goal_row: Row of the goal in ``state``.
        goal_col: Column of the goal in ``state``.
        from_row: The robot's place in ``state``, in points.
        from_col: The robot's place in ``state``, in points.
        up: Row component of the direction's unit vector.
        across: Column component of the direction's unit vector.
        side: Half the side of the square, in points.
        whole: Whether every point of the square is a candidate.

    Returns:
        Flat index of the point in ``state``; -1 where none is better than the goal itself, which may lie anywhere.
    """
    rows, cols = state.shape
    cell = int64(-1)
    best = math.inf
    if 0 < goal_row < rows - 1 and 0 < goal_col < cols - 1:
        best = psi[goal_row - 1, goal_col - 1]
    elif not whole:
        return cell
    nearest = 0
    for row in range(max(1, goal_row - side), min(rows - 1, goal_row + side + 1)):
        for col in range(max(1, goal_col - side), min(cols - 1, goal_col + side + 1)):
            if not whole and state[row, col] & 3 == 0:
                continue
            candidate = psi[row - 1, col - 1]
            gap = (row - goal_row) * (row - goal_row) + (col - goal_col) * (col - goal_col)
            if candidate > best or (candidate == best and gap >= nearest):
                continue
            if not whole:
                ahead_row, ahead_col = row + 0.5 - from_row, col + 0.5 - from_col
                ahead = ahead_row * up + ahead_col * across
                # Within 45 degrees the cosine is at least the root of 1/2. Squared; `abs` keeps the sign of points
                # behind.
                if 2.0 * ahead * abs(ahead) < ahead_row * ahead_row + ahead_col * ahead_col:
                    continue
                # Rays cost most, so they come last.
                if not _reaches(state, goal_row + 0.5, goal_col + 0.5, row + 0.5, col + 0.5):
                    continue
                if not _reaches(state, from_row, from_col, row + 0.5, col + 0.5):
                    continue
            best, nearest = candidate, gap
            cell = row * cols + col
    return cell
