"""Kernel that follows robots along a closed tour."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

float64 = types.float64
int64 = types.int64
ROW = types.Array(types.float64, 1, "C")
COSTS = types.Array(types.float64, 1, "C")
TOUR = types.Array(types.float64, 2, "C", readonly=True)

AHEAD_TWO = 0.1
BACK = 0.3
JUMP = 20.0
"""Cost of moving on by two places in a tick, of moving back by one, and of being anywhere else. None: on by one, or
standing still."""

MEMORY = 0.95
"""Share of the costs that is left after a tick."""

FAR = 4.0
"""Cost of the distance from a place at most; a spacing of the places costs 0.5."""

ASTRAY = 0.5
"""Cost of driving across the tour; twice as much against it."""


@njit(int64(COSTS, ROW, TOUR, float64, int64, float64, float64, float64, float64), cache=True, nogil=True)
def follow(costs, scratch, tour, spacing, ticks, x, y, across, up):
    """Bring the costs of the places of a tour up to date with where a robot has been heard.

    The place with the least cost is the end of the likeliest way along the tour (Viterbi).

    Args:
        costs: float64 (n,), changed; the least is 0 afterwards.
        scratch: float64 (n,), working memory.
        tour: float64 (n, 4), x and y of each place in m, and the direction of the tour there, of length 1.
        spacing: Distance of the places along the tour, m.
        ticks: Since the robot was heard last, at least 1.
        x: Of the robot, m.
        y: Of the robot, m.
        across: x of the direction in which it last drove, of length 1, or 0.
        up: y of the same.

    Returns:
        The number of the place with the least cost, the first of equal ones.
    """
    size = costs.size
    for _ in range(ticks):
        cheapest = np.inf
        for k in range(size):
            scratch[k] = costs[k]
            cheapest = min(cheapest, costs[k])
        for k in range(size):
            # Without %, which takes most of the time.
            previous = k - 1 if k > 0 else size - 1
            two = k - 2 if k > 1 else k + size - 2
            back = k + 1 if k < size - 1 else 0
            # Read from the copy: all places move on at the same time.
            cost = min(scratch[k], scratch[previous])
            cost = min(cost, scratch[two] + AHEAD_TWO)
            cost = min(cost, scratch[back] + BACK)
            costs[k] = min(cost, cheapest + JUMP) * MEMORY
    best, cheapest = 0, np.inf
    for k in range(size):
        off_x, off_y = tour[k, 0] - x, tour[k, 1] - y
        distance = math.sqrt(off_x * off_x + off_y * off_y)
        along = tour[k, 2] * across + tour[k, 3] * up
        costs[k] += min(0.5 * distance / spacing, FAR) + ASTRAY * (1.0 - along)
        if costs[k] < cheapest:
            best, cheapest = k, costs[k]
    for k in range(size):
        # Only differences matter, and so the costs never grow without bound.
        costs[k] -= cheapest
    return best
