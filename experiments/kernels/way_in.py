"""Kernel of the way in: the way through space and time on which an intruder expects to be detected least.

Theory of operation
    Dynamic programming over the squares of a grid and instants, so no way costs less. `reached` holds the least cost of
    being in a square at the end of an instant. It follows from earlier instants by waiting, by entering from outside,
    or by a move of which the first half is spent in the square that is left:

        straight move of 1 instant:     |  at v  |          diagonal move of 2:    |  at u  |  at v  |

    The grid has a rim of squares that are nowhere open, so that neighbours are the same few places further in memory,
    and the compiler can work on many squares at once. Moves are not written down: the way back tries them again.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

int64 = types.int64
float64 = types.float64
CHANCES = types.Array(types.float32, 2, "C", readonly=True)
LEVELS = types.Array(types.float32, 1, "C", readonly=True)
SQUARES = types.Array(int64, 1, "C", readonly=True)
BARS = types.Array(types.float32, 2, "C", readonly=True)
BAR = types.Array(types.float32, 1, "C", readonly=True)
WORK = types.Array(types.float32, 2, "C")
WAY = types.Array(types.int32, 1, "C")


@njit(
    float64(CHANCES, LEVELS, SQUARES, int64, int64, BARS, BAR, int64, int64, int64, int64, int64, WORK, WORK, WAY),
    cache=True,
    nogil=True,
)
def least_detection(
    chances, costs, squares, width, parts, bars, outside, straight, diagonal, start, goal, stay, risk, reached, way
):
    """Find the way to a goal, and the stay there, with the least sum of costs of detection.

    Of equally good ways it takes that which arrives first. A tick has `parts` instants, of which each costs its share.

    Args:
        chances: float32 (ticks, points), that a point is seen in each tick to come, 0 to 1.
        costs: float32 (levels,), of being at a point for one instant, above 0, by its chance, from 0 to 1.
        squares: int64 (points,), of the grid.
        width: Squares in a row of the grid.
        parts: Instants of a tick.
        bars: float32 (8, squares), 0 where a move leads into a square from that above, below, left and right, and from
            the diagonal neighbours in the same order; else infinite.
        outside: float32 (squares,), 0 where the intruder may enter at any instant, else infinite; of no account with a
            start.
        straight: Instants that a move from one of the first four takes.
        diagonal: The same for the last four.
        start: The point where the intruder is before the first instant; -1 while it is still outside.
        goal: The point to stay at.
        stay: How many ticks the stay lasts.
        risk: float32 (ticks, squares), working memory.
        reached: float32 (ticks * parts + 1, squares), likewise.
        way: int32 (ticks,), filled in: the square at each tick's end, -1 outside, -2 from when the stay is over.

    Returns:
        The sum of costs; infinity where no way ends in time.
    """
    ticks, size = chances.shape
    top = np.float32(costs.size - 1)
    infinite = np.float32(np.inf)
    squares_count = bars.shape[1]
    instants, stayed = ticks * parts, stay * parts
    rim = width + 1  # no square before this one has all neighbours
    n = squares_count - 2 * rim
    steps = (-width, width, -1, 1, -width - 1, -width + 1, width - 1, width + 1)
    staying = np.zeros(instants + 1)
    for j in range(instants):
        staying[j + 1] = staying[j] + costs[np.int64(chances[j // parts, goal] * top + np.float32(0.5))]
    end = squares[goal]
    reached[0, :] = infinite
    if start >= 0:
        reached[0, squares[start]] = 0.0
    best, best_state, enough = np.inf, -1, -np.inf
    for j in range(1, instants - stayed + 1):
        tick = (j - 1) // parts
        now = risk[tick]
        if (j - 1) % parts == 0:
            now[:] = infinite
            for v in range(size):
                now[squares[v]] = costs[np.int64(chances[tick, v] * top + np.float32(0.5))]
        out = reached[j]
        before = reached[j - 1]
        if start < 0:
            for v in range(squares_count):
                lowest = before[v] if before[v] < outside[v] else outside[v]
                out[v] = lowest + now[v]
        else:
            for v in range(squares_count):
                out[v] = before[v] + now[v]
        for kind in range(2):
            takes = straight if kind == 0 else diagonal
            if takes > j:
                continue
            leaving = reached[j - takes]
            for i in range(j - takes, j - takes + takes // 2):
                leaving = leaving + risk[i // parts]
            inner = out[rim : rim + n]
            k = 4 * kind
            a, b = rim + steps[k], rim + steps[k + 1]
            c, d = rim + steps[k + 2], rim + steps[k + 3]
            from_a, from_b, from_c, from_d = (
                leaving[a : a + n],
                leaving[b : b + n],
                leaving[c : c + n],
                leaving[d : d + n],
            )
            bar_a, bar_b = bars[k, rim : rim + n], bars[k + 1, rim : rim + n]
            bar_c, bar_d = bars[k + 2, rim : rim + n], bars[k + 3, rim : rim + n]
            arriving = now[rim : rim + n]
            if takes - takes // 2 > 1:
                arriving = np.zeros(n, np.float32)
                for i in range(j - takes + takes // 2, j):
                    arriving += risk[i // parts, rim : rim + n]
            for v in range(n):
                lowest = from_a[v] + bar_a[v]
                candidate = from_b[v] + bar_b[v]
                lowest = candidate if candidate < lowest else lowest
                candidate = from_c[v] + bar_c[v]
                lowest = candidate if candidate < lowest else lowest
                candidate = from_d[v] + bar_d[v]
                lowest = candidate if candidate < lowest else lowest
                lowest += arriving[v]
                inner[v] = lowest if lowest < inner[v] else inner[v]
        if out[end] < infinite:
            total = np.float64(out[end]) + (staying[j + stayed] - staying[j])
            if total < best:
                best, best_state = total, j
            if enough < 0.0:
                # No way is shorter than this one, the first that arrives.
                enough = costs[0] * np.float64(j + stayed) * (1.0 + 1e-5)
        if 0.0 <= best <= enough or (start >= 0 and best < np.inf and out.min() >= best):
            break
    if best_state < 0:
        return best
    last = (best_state + stayed - 1) // parts
    for t in range(ticks):
        if t > last:
            way[t] = -2
        elif (t + 1) * parts >= best_state:
            way[t] = end
        else:
            way[t] = -1
    j, v = best_state, end
    while j > 0:
        if j % parts == 0:
            way[j // parts - 1] = v
        here = risk[(j - 1) // parts, v]
        move, takes, lowest = -1, 1, reached[j - 1, v] + here
        if start < 0 and outside[v] + here < lowest:
            move, lowest = -2, outside[v] + here
        for k in range(8):
            length = straight if k < 4 else diagonal
            if length > j or bars[k, v] > 0.0:
                continue
            u = v + steps[k]
            total = reached[j - length, u]
            for i in range(j - length, j - length + length // 2):
                total += risk[i // parts, u]
            into = np.float32(0.0)
            for i in range(j - length + length // 2, j):
                into += risk[i // parts, v]
            total += into
            if total < lowest:
                move, takes, lowest = k, length, total
        if move == -2:
            break
        if move >= 0:
            u = v + steps[move]
            for i in range(j - 1, j - takes, -1):
                if i % parts == 0:
                    way[i // parts - 1] = v if i > j - takes + takes // 2 else u
            v = u
        j -= takes
    return best
