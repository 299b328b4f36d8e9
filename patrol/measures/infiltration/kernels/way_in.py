"""Kernel of the way in: the way through space and time on which an intruder expects to be detected least."""

from __future__ import annotations

import numpy as np
from numba import njit, types

int64 = types.int64
float64 = types.float64
COSTS = types.Array(types.float32, 2, "C", readonly=True)
NEIGHBOURS = types.Array(types.int32, 2, "C", readonly=True)
FLAGS = types.Array(types.bool_, 1, "C", readonly=True)
WAY = types.Array(types.int32, 1, "C")


@njit(
    float64(COSTS, int64, NEIGHBOURS, int64, int64, FLAGS, int64, int64, int64, WAY),
    cache=True,
    nogil=True,
)
def least_detection(costs, parts, neighbours, straight, diagonal, entries, start, goal, stay, way):
    """Find the way to a goal, and the stay there, with the least sum of costs of detection.

    Dynamic programming over points and instants, so no way costs less. Of equally good ones it takes that which arrives
    first. A tick has `parts` instants, of which each costs its share.

    Args:
        costs: float32 (ticks, points), of being at a point in each tick to come, above 0.
        parts: Instants of a tick.
        neighbours: int32 (points, 8), those above, below, left and right first, then the diagonal ones; -1 for none.
        straight: Instants that a move to one of the first four takes.
        diagonal: The same for the last four.
        entries: bool (points,), where the intruder may enter at any instant; of no account with a start.
        start: The point where the intruder is before the first instant; -1 while it is still outside.
        goal: The point to stay at.
        stay: How many ticks the stay lasts.
        way: int32 (ticks,), filled in: the point at each tick's end, -1 outside, -2 from when the stay is over.

    Returns:
        The sum of costs; infinity where no way ends in time.
    """
    ticks, size = costs.shape
    least_cost = costs.min()
    instants, stayed = ticks * parts, stay * parts
    spent = np.zeros((instants + 1, size))
    for j in range(instants):
        for v in range(size):
            spent[j + 1, v] = spent[j, v] + costs[j // parts, v] / parts
    cost = np.full((instants + 1, size), np.inf)
    came = np.full((instants + 1, size), -1, np.int8)  # 0 to 7 from a neighbour, 8 waited, 9 entered, -1 not there
    if start >= 0:
        cost[0, start] = 0.0
    best, at, enough = np.inf, -1, -np.inf
    for j in range(1, instants + 1):
        least_left = np.inf
        for v in range(size):
            here = spent[j, v]
            least = cost[j - 1, v] + (here - spent[j - 1, v])
            move = 8 if least < np.inf else -1
            for k in range(8):
                u = neighbours[v, k]
                takes = straight if k < 4 else diagonal
                if u < 0 or takes > j or cost[j - takes, u] == np.inf:
                    continue
                half = j - takes + takes // 2
                total = cost[j - takes, u] + (spent[half, u] - spent[j - takes, u]) + (here - spent[half, v])
                if total < least:
                    least, move = total, k
            if start < 0 and entries[v]:
                entering = here - spent[j - 1, v]
                if entering < least:
                    least, move = entering, 9
            cost[j, v] = least
            came[j, v] = move
            least_left = min(least_left, least)
        if j + stayed <= instants:
            total = cost[j, goal] + (spent[j + stayed, goal] - spent[j, goal])
            if total < best:
                best, at = total, j
            if enough < 0.0 and cost[j, goal] < np.inf:
                # No way is shorter than this one, the first that arrives.
                enough = least_cost * (j + stayed) / parts * (1.0 + 1e-6)
        else:
            break
        if 0.0 <= best <= enough or (start >= 0 and least_left >= best):
            break
    if at < 0:
        return best
    for t in range(ticks):
        way[t] = -1 if start < 0 else start
    last = (at + stayed - 1) // parts
    for t in range(ticks):
        if t > last:
            way[t] = -2
        elif (t + 1) * parts >= at:
            way[t] = goal
    j, v = at, goal
    while j > 0:
        move = came[j, v]
        if move == 9:
            if j % parts == 0:
                way[j // parts - 1] = v
            break
        if move == 8:
            if j % parts == 0:
                way[j // parts - 1] = v
            j -= 1
            continue
        u = neighbours[v, move]
        takes = straight if move < 4 else diagonal
        half = j - takes + takes // 2
        for i in range(j, j - takes, -1):
            if i % parts == 0:
                way[i // parts - 1] = v if i > half else u
        j, v = j - takes, u
    return best
