"""Kernel of manoeuvres: a search over the arcs that a car can drive, forward and in reverse (hybrid A*)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
LENGTHS = types.Array(types.float64, 2, "C", readonly=True)
ARCS = types.Array(types.float64, 2, "C", readonly=True)
FOUND = types.Array(types.int64, 1, "C")
float64 = types.float64
int64 = types.int64

HEADINGS = 32
"""Number of headings that are told apart."""

REVERSE = 1.5
"""Cost of driving in reverse, relative to driving forward."""

GEAR_CHANGE = 1.0
"""Cost of a change between forward and reverse, in turning radii."""

TURNING = 1.05
"""Cost of an arc, relative to driving straight."""

GREED = 1.3
"""Weight of the way that is left in a node's rank; a node's cost is at most so many times the least."""

CLEARANCE = 1e-3
"""Gap kept between a body and walls at the samples of an arc, m. Samples are so close to each other that between two of
them a body comes less than that nearer to a wall."""

TOUCHING = 5e-10
"""How much nearer than its radius a disc may be to a square and still only touch it, m."""


@njit(types.boolean(MASK, float64, float64, float64, float64, float64, float64), cache=True, nogil=True)
def _fits(blocked, point, ox, oy, x, y, radius):
    """Whether a disc at (x, y) overlaps no blocked square and stays on the grid; m."""
    height, width = blocked.shape
    inner = radius - TOUCHING
    if x - inner < ox or y - inner < oy or x + inner > ox + width * point or y + inner > oy + height * point:
        return False
    for row in range(math.floor((y - radius - oy) / point), math.floor((y + radius - oy) / point) + 1):
        if row < 0 or row >= height:
            continue
        low = oy + row * point
        up = max(low - y, 0.0, y - low - point)
        for col in range(math.floor((x - radius - ox) / point), math.floor((x + radius - ox) / point) + 1):
            if col < 0 or col >= width or blocked[row, col] == 0:
                continue
            left = ox + col * point
            across = max(left - x, 0.0, x - left - point)
            if math.sqrt(up * up + across * across) < inner:
                return False
    return True


# fmt: off
@njit(
    int64(
        MASK, MASK, LENGTHS, float64, float64, float64, float64, float64, float64, float64, ARCS, float64, float64,
        float64, float64, float64, float64, int64, FOUND,
    ),
    cache=True,
    nogil=True,
)
def search(
    blocked, closed, left, point, ox, oy, x, y, heading, first_left, arcs, cell, radius, clearance, turning,
    near, progress, most, found,
):
    """Find arcs that bring a car nearer to its goal.

    Nodes are poses, told apart by a grid of ``cell`` and `HEADINGS`. The search ends at the first node from which the
    way left is at most ``near`` or shorter by ``progress`` than at the start. When it ends without one, the arcs lead
    to the node with the shortest way left.

    Args:
        blocked: uint8 (h, w), 1 where no body may be.
        closed: uint8 (h, w), 1 where this body's centre may not be now; size 0 for nowhere.
        left: float64 (h, w), the way left from each point, m; infinite where none is known.
        point: Side of a point, m.
        ox: x of the grid's origin, m.
        oy: y of the grid's origin, m.
        x: Of the car, m.
        y: Of the car, m.
        heading: Of the car, rad.
        first_left: The way left from where the car is, m.
        arcs: float64 (n, 2), the arcs to drive: length (m, negative in reverse) and curvature (1/m).
        cell: Side of the grid that tells nodes apart, m.
        radius: Of the body, m.
        clearance: Gap to keep between the body and walls, m.
        turning: Of the tightest turn, m.
        near: How short the way left has to be for the search to end, m.
        progress: How much shorter than at the start it has to be for the search to end, m.
        most: Largest number of nodes to look at.
        found: int64, filled in with the indices of the arcs in driving order, as far as there is room.

    Returns:
        The number of arcs in ``found``; 0 when no arc leads nearer.
    """
    count = 1
    px, py, ph, pleft = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    cost = np.empty(most)
    parent, by = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    px[0], py[0], ph[0], pleft[0], cost[0], parent[0], by[0] = x, y, heading, first_left, 0.0, -1, -1
    known = {}
    known[(int64(0), int64(0), int64(-1))] = float64(0.0)
    heap, rank = np.empty(most, dtype=np.int64), np.empty(most)
    heap[0], rank[0] = 0, GREED * first_left
    size = 1
    best, goal = 0, -1
    # Every arc takes the same time, however short it is.
    longest = np.abs(arcs[:, 0]).max()
    # Between two samples a wall's corner gets in by at most s**2 / 8 * (1 / radius + curvature).
    spacing = min(0.5 * point, math.sqrt(8.0 * CLEARANCE / (1.0 / radius + 1.0 / turning)))
    while size > 0:
        node = heap[0]
        size -= 1
        # The last entry sinks from the root to its place.
        last, last_rank = heap[size], rank[size]
        hole = 0
        while True:
            child = 2 * hole + 1
            if child >= size:
                break
            if child + 1 < size and rank[child + 1] < rank[child]:
                child += 1
            if rank[child] >= last_rank:
                break
            heap[hole], rank[hole] = heap[child], rank[child]
            hole = child
        heap[hole], rank[hole] = last, last_rank
        if pleft[node] < pleft[best] - 1e-9:
            best = node
        if pleft[node] <= near or pleft[node] <= first_left - progress:
            goal = node
            break
        for index in range(arcs.shape[0]):
            distance, curvature = arcs[index, 0], arcs[index, 1]
            samples = math.ceil(abs(distance) / spacing)
            free = True
            nx, ny, nh = px[node], py[node], ph[node]
            for sample in range(1, samples + 1):
                half = 0.5 * distance * sample / samples * curvature
                chord = distance * sample / samples
                chord *= math.sin(half) / half if abs(half) > 1e-5 else 1.0 - half * half / 6.0
                nx = px[node] + chord * math.cos(ph[node] + half)
                ny = py[node] + chord * math.sin(ph[node] + half)
                nh = ph[node] + 2.0 * half
                if not _fits(blocked, point, ox, oy, nx, ny, radius + clearance):
                    free = False
                    break
                if closed.size > 0:
                    row, col = math.floor((ny - oy) / point), math.floor((nx - ox) / point)
                    if closed[row, col] != 0:
                        free = False
                        break
            if not free:
                continue
            row, col = math.floor((ny - oy) / point), math.floor((nx - ox) / point)
            there = left[row, col]
            if math.isinf(there):
                there = pleft[node] + abs(distance)
            price = longest * (REVERSE if distance < 0.0 else 1.0) * (TURNING if curvature != 0.0 else 1.0)
            if by[node] >= 0 and (arcs[by[node], 0] < 0.0) != (distance < 0.0):
                price += GEAR_CHANGE * turning
            price += cost[node]
            turn = int64(math.floor(nh * (HEADINGS / (2.0 * math.pi)) + 0.5)) % HEADINGS
            key = (int64(math.floor(nx / cell)), int64(math.floor(ny / cell)), turn * 2 + int64(distance < 0.0))
            if key in known and known[key] <= price:
                continue
            if count >= most:
                size = 0
                break
            known[key] = price
            px[count], py[count], ph[count], pleft[count], cost[count] = nx, ny, nh, there, price
            parent[count], by[count] = node, index
            # The new entry rises from the end to its place.
            hole, new_rank = size, price + GREED * there
            while hole > 0 and rank[(hole - 1) // 2] > new_rank:
                heap[hole], rank[hole] = heap[(hole - 1) // 2], rank[(hole - 1) // 2]
                hole = (hole - 1) // 2
            heap[hole], rank[hole] = count, new_rank
            size += 1
            count += 1
    if goal < 0:
        goal = best
    steps = 0
    node = goal
    while parent[node] >= 0:
        steps += 1
        node = parent[node]
    node = goal
    for place in range(steps - 1, -1, -1):
        if place < found.shape[0]:
            found[place] = by[node]
        node = parent[node]
    return min(steps, found.shape[0])


# fmt: on
