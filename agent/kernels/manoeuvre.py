"""Kernel of manoeuvres: a search over the arcs that a body can drive, forward and in reverse (hybrid A*)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

MASK = types.Array(types.uint8, 2, "C", readonly=True)
LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
ARCS = types.Array(types.float64, 2, "C", readonly=True)
FLAGS = types.Array(types.uint8, 1, "C", readonly=True)
FOUND = types.Array(types.int64, 1, "C")
BOXES = types.Array(types.int64, 2, "C")
SHAPE = types.Array(types.float64, 2, "C", readonly=True)
WRITTEN = types.Array(types.float64, 2, "C")
float64 = types.float64
int64 = types.int64
uint64 = types.uint64

HEADINGS = 32
"""Number of headings that are told apart."""

GREED = 1.3
"""Weight of the way that is left in a node's rank; a node's cost is at most so many times the least."""

CLEARANCE = 1e-3
"""Gap kept between a body and walls at the samples of an arc, m. Samples are so close to each other that between two of
them a body comes less than that nearer to a wall."""

TOUCHING = 5e-10
"""Rounding allowed in the distance of a disc that only touches a square, m."""

FITS, OVERLAPS, DEPENDS = 0, 1, 2
"""A disc with its centre on a point: it fits wherever on the point that is, or nowhere, or only in places."""

KEPT = 128
"""Rows and columns of points after which the table of what fits there repeats; the latest entry stays."""


@njit(types.boolean(MASK, float64, float64, float64, float64, float64, float64, FOUND), cache=True, nogil=True)
def _fits(blocked, point, ox, oy, x, y, radius, box):
    """Return True if a disc at (x, y) overlaps no blocked square of a box and stays on the grid; m.

    ``box``, int64 (4,), is first and last row, first and last column; rows and columns off the grid do not count.
    """
    height, width = blocked.shape
    inner = radius - TOUCHING
    if x - inner < ox or y - inner < oy or x + inner > ox + width * point or y + inner > oy + height * point:
        return False
    first, last = max(box[2], 0), min(box[3], width - 1)
    for row in range(max(box[0], 0), min(box[1], height - 1) + 1):
        low = oy + row * point
        up = max(low - y, 0.0, y - low - point)
        line = blocked[row, first : last + 1]
        for k in range(line.size):
            if line[k] == 0:
                continue
            side = ox + (first + k) * point
            across = max(side - x, 0.0, x - side - point)
            if math.sqrt(up * up + across * across) < inner:
                return False
    return True


@njit(int64(MASK, float64, int64, int64, float64, FOUND), cache=True, nogil=True)
def _judge(blocked, point, row, col, radius, near):
    """Return `FITS`, `OVERLAPS` or `DEPENDS` for a disc with its centre on a point; off the grid all is blocked.

    Where it depends, ``near``, int64 (4,), is filled in with the box of the squares that such a disc may overlap: first
    and last row, first and last column.
    """
    height, width = blocked.shape
    reach = int64(radius / point) + 1
    verdict = FITS
    near[0], near[1], near[2], near[3] = row, row, col, col
    for up in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            if 0 <= row + up < height and 0 <= col + across < width and blocked[row + up, col + across] == 0:
                continue
            # From the far side or corner of the point, and from the near one.
            if point * math.sqrt(up * up + across * across) < radius - 2.0 * TOUCHING:
                return OVERLAPS
            # Nearest when the centre lies on the facing side of its point: a whole point less in each direction.
            if point * math.sqrt(max(abs(up) - 1, 0) ** 2 + max(abs(across) - 1, 0) ** 2) < radius:
                verdict = DEPENDS
                near[0], near[1] = min(near[0], row + up), max(near[1], row + up)
                near[2], near[3] = min(near[2], col + across), max(near[3], col + across)
    return verdict


@njit(
    types.boolean(
        MASK, MASK, MASK, float64, float64, float64, float64, float64, float64, float64, SHAPE, float64, FOUND, BOXES
    ),
    cache=True,
    nogil=True,
)
def _is_free(blocked, room, closed, point, ox, oy, x, y, heading, distance, shape, radius, judged, near):
    """Return True if a disc overlaps no blocked square and its centre no closed point at all samples of an arc.

    Where there is room round a sample, the disc fits there and at the next samples too, as far as there is. ``shape``
    is as of `_measure`. ``judged``, int64 (KEPT * KEPT,), 0 at first, and ``near``, int64 (KEPT * KEPT, 4), keep what
    `_judge` has found for this radius.
    """
    height, width = blocked.shape
    samples = shape.shape[0]
    spacing = abs(distance) / samples
    ahead, aside = math.cos(heading), math.sin(heading)
    sample = 0
    while sample < samples:
        # Up to rounding, which is less than what `_judge` and room leave open.
        nx = x + ahead * shape[sample, 2] - aside * shape[sample, 3]
        ny = y + aside * shape[sample, 2] + ahead * shape[sample, 3]
        row, col = math.floor((ny - oy) / point), math.floor((nx - ox) / point)
        # A disc that is centred off the grid does not fit.
        spare, verdict, slot = -1.0, OVERLAPS, 0
        if 0 <= row < height and 0 <= col < width:
            spare = (room[row, col] - 1) * point - radius
            if spare >= 0.0:
                verdict = FITS
            else:
                # Index plus one above two bits of the verdict, so that an empty entry, 0, matches no point.
                slot, key = (row & KEPT - 1) * KEPT + (col & KEPT - 1), row * width + col + 1 << 2
                if judged[slot] >> 2 << 2 != key:
                    judged[slot] = key + _judge(blocked, point, row, col, radius, near[slot])
                verdict = judged[slot] & 3
        if verdict == OVERLAPS:
            return False
        if verdict == DEPENDS or closed.size > 0:
            nx = x + shape[sample, 1] * math.cos(heading + shape[sample, 0])
            ny = y + shape[sample, 1] * math.sin(heading + shape[sample, 0])
            if verdict == DEPENDS and not _fits(blocked, point, ox, oy, nx, ny, radius, near[slot]):
                return False
        # Room is measured to walls and not to closed points, so no sample may be skipped.
        if closed.size > 0:
            if closed[math.floor((ny - oy) / point), math.floor((nx - ox) / point)] != 0:
                return False
            sample += 1
        else:
            sample += 1 + int(max(spare, 0.0) / spacing)
    return True


@njit(types.void(float64, float64, WRITTEN), cache=True, nogil=True)
def _measure(distance, curvature, shape):
    """Fill in an arc's samples: half the turn, the chord, and how far ahead and to the left that leads.

    Args:
        distance: Of the arc, m; negative in reverse.
        curvature: Of the arc, 1/m.
        shape: float64 (samples, 4).
    """
    samples = shape.shape[0]
    for k in range(samples):
        half = 0.5 * distance * (k + 1) / samples * curvature
        chord = distance * (k + 1) / samples
        # sin(u) / u is 0 / 0 on a straight arc; two terms of its series are exact to the last bit for such small u.
        chord *= math.sin(half) / half if abs(half) > 1e-5 else 1.0 - half * half / 6.0
        shape[k, 0], shape[k, 1] = half, chord
        shape[k, 2], shape[k, 3] = chord * math.cos(half), chord * math.sin(half)


# fmt: off
@njit(
    int64(
        MASK, MASK, MASK, LENGTHS, int64, int64, int64, float64, float64, float64, float64, float64, float64,
        float64, ARCS, FLAGS, float64, float64, float64, float64, float64, float64, float64, float64, float64, float64,
        int64, FOUND,
    ),
    cache=True,
    nogil=True,
)
def search(
    blocked, room, closed, left, row0, col0, limit, point, ox, oy, x, y, heading, first_left, arcs, begins, gear_change,
    cell, radius, clearance, turning, near, progress, units, facing, askew, most, found,
):
    """Find arcs that bring a body nearer to its goal.

    Nodes are poses, told apart by a grid of ``cell`` and `HEADINGS`. The search ends at the first node from which the
    way left is at most ``near``, in a heading that counts; or shorter by ``progress`` than at the start, where that is
    still more than ``near``. When it ends without one, the arcs lead to the node with the shortest way left.

    Args:
        blocked: uint8 (h, w), 1 where no body may be.
        room: uint8 (h, w), see `patrol.kernels.clearance.measure_room`.
        closed: uint8 (h, w), 1 where this body's centre may not be now; size 0 for nowhere.
        left: int32 (m, n), the way left from each point of a window, in hundredths of a point.
        row0: Row of the grid under the window's row 0.
        col0: Column of the grid under the window's column 0.
        limit: The longest way that counts, in hundredths of a point. Longer ones, and those from points outside of the
            window, count as none.
        point: Side of a point, m.
        ox: x of the grid's origin, m.
        oy: y of the grid's origin, m.
        x: Of the body, m.
        y: Of the body, m.
        heading: Of the body, rad.
        first_left: The way left from where the body is, m.
        arcs: float64 (n, 4), the arcs to drive: length (m, negative in reverse), curvature (1/m), turn on the spot
            (rad, of an arc without length) and cost.
        begins: uint8 (n,), 1 where the body can begin the arc where it is: it may stand nearer to a wall than the gap
            that is kept at the samples of an arc.
        gear_change: Cost of a change between forward and reverse.
        cell: Side of the grid that tells nodes apart, m.
        radius: Of the body, m.
        clearance: Gap to keep between the body and walls, m.
        turning: Of the tightest turn, m.
        near: How short the way left has to be for the search to end, m.
        progress: How much shorter than at the start it has to be for the search to end, m.
        units: To how many parts of a metre places are rounded before the way left is looked up: as others hear them.
        facing: The heading in which the search may end near the goal, rad.
        askew: By how much it may be off there, rad; pi for any heading.
        most: Largest number of nodes to look at.
        found: int64, filled in with the indices of the arcs in driving order, as far as there is room.

    Returns:
        The number of arcs in ``found``; 0 when no arc leads nearer.
    """
    count = 1
    px, py, ph, pleft = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    cost = np.empty(most)
    parent, by = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    # No arc led to the start, so `by` is -1: its first arc is no change of gear.
    px[0], py[0], ph[0], pleft[0], cost[0], parent[0], by[0] = x, y, heading, first_left, 0.0, -1, -1
    # The last node of each cell that was come by, in a hash table, and each node's cell.
    # At most a quarter full, so that probes stay short.
    slots = 4
    while slots < 4 * most:
        slots *= 2
    # 0 is an empty slot: the start, node 0, is never entered.
    nodes = np.zeros(slots, dtype=np.int32)
    cells = np.empty((most, 3), dtype=np.int64)
    judged, boxes = np.zeros(KEPT * KEPT, dtype=np.int64), np.empty((KEPT * KEPT, 4), dtype=np.int64)
    heap, rank = np.empty(most, dtype=np.int64), np.empty(most)
    heap[0], rank[0] = 0, GREED * first_left
    size = 1
    best, goal = 0, -1
    # Between two samples a wall's corner gets in by at most s**2 / 8 * (1 / radius + curvature).
    spacing = min(0.5 * point, math.sqrt(8.0 * CLEARANCE / (1.0 / radius + 1.0 / turning)))
    # What of an arc does not depend on where it begins: its samples, half its turn and its chord; and the first arc
    # with the same turn, which ends in the same direction.
    ends, like = np.zeros(arcs.shape[0] + 1, dtype=np.int64), np.empty(arcs.shape[0], dtype=np.int64)
    for index in range(arcs.shape[0]):
        ends[index + 1] = ends[index] + max(math.ceil(abs(arcs[index, 0]) / spacing), 1)
    shapes = np.empty((ends[arcs.shape[0]], 4))
    halves, chords = np.empty(arcs.shape[0]), np.empty(arcs.shape[0])
    for index in range(arcs.shape[0]):
        _measure(arcs[index, 0], arcs[index, 1], shapes[ends[index] : ends[index + 1]])
        halves[index] = shapes[ends[index + 1] - 1, 0] + 0.5 * arcs[index, 2]
        half, chords[index] = halves[index], shapes[ends[index + 1] - 1, 1]
        like[index] = index
        for earlier in range(index - 1, -1, -1):
            like[index] = earlier if halves[earlier] == half else like[index]
    across, up = np.empty(arcs.shape[0]), np.empty(arcs.shape[0])
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
        # More than rounding, so that of equal nodes the first stays the best.
        if pleft[node] < pleft[best] - 1e-9:
            best = node
        off = abs((ph[node] - facing + math.pi) % (2.0 * math.pi) - math.pi)
        if (pleft[node] <= near and off <= askew) or near < pleft[node] <= first_left - progress:
            goal = node
            break
        for index in range(arcs.shape[0]):
            distance, half = arcs[index, 0], halves[index]
            if like[index] == index:
                across[index], up[index] = math.cos(ph[node] + half), math.sin(ph[node] + half)
            if node == 0 and begins[index] == 0:
                continue
            nx = px[node] + chords[index] * across[like[index]]
            ny = py[node] + chords[index] * up[like[index]]
            nh = ph[node] + 2.0 * half
            price = arcs[index, 3]
            if by[node] >= 0 and (arcs[by[node], 0] < 0.0) != (distance < 0.0):
                price += gear_change
            price += cost[node]
            turn = int64(math.floor(nh * (HEADINGS / (2.0 * math.pi)) + 0.5)) % HEADINGS
            cell_x, cell_y = int64(math.floor(nx / cell)), int64(math.floor(ny / cell))
            # Forward and reverse are different nodes: a change of gear costs more after one than after the other.
            cell_turn = turn * 2 + int64(distance < 0.0)
            mixed = uint64(cell_x * 73856093 ^ cell_y * 19349663 ^ cell_turn * 83492791)
            # Only low bits select the slot, so higher ones are mixed into them.
            slot = int64((mixed ^ mixed >> uint64(17)) & uint64(slots - 1))
            earlier = nodes[slot]
            while earlier > 0:
                if cells[earlier, 0] == cell_x and cells[earlier, 1] == cell_y and cells[earlier, 2] == cell_turn:
                    break
                slot = (slot + 1) & (slots - 1)
                earlier = nodes[slot]
            # Before the walls are looked at, which takes longer.
            if earlier > 0 and cost[earlier] <= price:
                continue
            if distance != 0.0 and not _is_free(
                blocked, room, closed, point, ox, oy, px[node], py[node], ph[node], distance,
                shapes[ends[index] : ends[index + 1]], radius + clearance, judged, boxes,
            ):
                continue
            # A turn on the spot leaves the way as long as it was, even between two points.
            row = math.floor((math.floor(ny * units + 0.5) / units - oy) / point) - row0
            col = math.floor((math.floor(nx * units + 0.5) / units - ox) / point) - col0
            # Outside of the window the way left is unknown: it counts as longer by the distance driven.
            way = limit + 1
            if 0 <= row < left.shape[0] and 0 <= col < left.shape[1]:
                way = int64(left[row, col])
            remaining_m = way * (point / 100.0) if way <= limit and distance != 0.0 else pleft[node] + abs(distance)
            if count >= most:
                # Ends the outer loop as well: `break` leaves only this one.
                size = 0
                break
            nodes[slot] = count
            cells[count, 0], cells[count, 1], cells[count, 2] = cell_x, cell_y, cell_turn
            px[count], py[count], ph[count], pleft[count], cost[count] = nx, ny, nh, remaining_m, price
            parent[count], by[count] = node, index
            # The new entry rises from the end to its place.
            hole, new_rank = size, price + GREED * remaining_m
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
    for entry in range(steps - 1, -1, -1):
        if entry < found.shape[0]:
            found[entry] = by[node]
        node = parent[node]
    return min(steps, found.shape[0])


# fmt: on
