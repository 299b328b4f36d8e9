"""Kernels of the goal: how far a direction is free, and the goal's refinement away from obstacles."""

from __future__ import annotations

import math

from numba import njit, types

STATE = types.Array(types.uint8, 2, "C", readonly=True)
PSI = types.Array(types.float32, 2, "C", readonly=True)
int64 = types.int64
float64 = types.float64


@njit(float64(STATE, float64, float64, float64, float64, float64), cache=True, nogil=True)
def free_run(state, row, col, up, across, distance):
    """How far, in points, the ray from (row, col) along the unit vector (up, across) stays on open points.

    row, col: the ray's beginning in points, point (i, j) covering [i, i + 1) x [j, j + 1). state: uint8, 0 in the two
    low bits is blocked. The ray is sampled every quarter point; the last free sample counts.
    """
    rows, cols = state.shape
    steps = math.ceil(4.0 * distance)
    free = 0.0
    for index in range(1, steps + 1):
        run = min(0.25 * index, distance)
        r = math.floor(row + run * up)
        c = math.floor(col + run * across)
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


@njit(int64(STATE, PSI, int64, int64, float64, float64, float64, float64, int64), cache=True, nogil=True)
def refine(state, psi, goal_row, goal_col, from_row, from_col, up, across, side):
    """The flat index of the point with the lowest psi within ``side`` rows and columns of the goal (paper, psi).

    Only open points are taken that a straight line from the goal and one from the robot at (from_row, from_col), in
    points, both reach, and whose bearing from the robot is within 45 degrees of its direction, the unit vector (up,
    across): near a wall the square would otherwise turn it round. Of several as good the one nearest the goal is
    taken, of those the first row by row. state: uint8 (h + 2, w + 2), blocked frame, 0 in the low bits is blocked;
    rows and columns count from its corner. psi: float32 (h, w), without the frame.
    """
    rows, cols = state.shape
    best_row, best_col = goal_row, goal_col
    best = psi[goal_row - 1, goal_col - 1]
    nearest = 0
    for row in range(max(1, goal_row - side), min(rows - 1, goal_row + side + 1)):
        for col in range(max(1, goal_col - side), min(cols - 1, goal_col + side + 1)):
            if state[row, col] & 3 == 0:
                continue
            value = psi[row - 1, col - 1]
            gap = (row - goal_row) * (row - goal_row) + (col - goal_col) * (col - goal_col)
            if value > best or (value == best and gap >= nearest):
                continue
            ahead_row, ahead_col = row + 0.5 - from_row, col + 0.5 - from_col
            ahead = ahead_row * up + ahead_col * across
            if 2.0 * ahead * abs(ahead) < ahead_row * ahead_row + ahead_col * ahead_col:
                continue
            if not _reaches(state, goal_row + 0.5, goal_col + 0.5, row + 0.5, col + 0.5):
                continue
            if not _reaches(state, from_row, from_col, row + 0.5, col + 0.5):
                continue
            best, nearest = value, gap
            best_row, best_col = row, col
    return best_row * cols + best_col
