"""Kernels that find doors: the narrowest places between two parts of the free space.

Points are taken in the order of falling clearance: pools form where the space is wide, grow and meet at saddles. A
saddle between two pools that are both sizeable and clearly wider than it is a door, and twice its clearance is the
door's width. The pools and doors form binary trees: leaves are rooms, inner nodes are doors.
"""

from __future__ import annotations

import math

from numba import njit, types

LEVELS = types.Array(types.int32, 1, "C", readonly=True)
ORDER = types.Array(types.int32, 1, "C", readonly=True)
LIST = types.Array(types.int32, 1, "C")
NODES = types.Array(types.int32, 2, "C")
int64 = types.int64
float64 = types.float64

ROOM, SADDLE, FIRST, SECOND = 0, 1, 2, 3
"""Columns of a node: leaf's widest point or -1; door's saddle point or -1; the two nodes that a door joins or -1."""


@njit(int64(LEVELS, LIST, LIST), cache=True, nogil=True)
def falling_order(level, counts, order):
    """List the points with a level above 0, highest first and of equal ones the lowest index first.

    For example, the levels 4, 9, 0 and 9 give the points 1, 3 and 0.

    Args:
        level: int32 (n,).
        counts: int32 (highest level + 2,), scratch.
        order: int32 (n,), its head is overwritten.

    Returns:
        The number of points listed.
    """
    highest = counts.shape[0] - 2
    counts[:] = 0
    for cell in range(level.shape[0]):
        if level[cell] > 0:
            # A counting sort. One slot further on, so that the sums give where each level begins.
            counts[highest - level[cell] + 1] += 1
    for rank in range(1, counts.shape[0]):
        counts[rank] += counts[rank - 1]
    for cell in range(level.shape[0]):
        if level[cell] > 0:
            rank = highest - level[cell]
            order[counts[rank]] = cell
            counts[rank] += 1
    # Level 0 would begin here, behind all that were listed.
    return int64(counts[highest])


@njit(int64(int64, int64, int64, int64), cache=True, nogil=True)
def _point_beside(at, side, width, count):
    """The point to the left, to the right, above or below (side 0 to 3) of one of `count`; -1 where there is none.

    For example, in rows of 10, to the right of point 4 is 5, and there is none to the right of 9.
    """
    col = at % width
    if (side == 0 and col == 0) or (side == 1 and col == width - 1):
        return -1
    neighbour = at + (side == 1) - (side == 0) + width * ((side == 3) - (side == 2))
    return neighbour if 0 <= neighbour < count else -1


@njit(int64(LIST, int64), cache=True, nogil=True)
def _find_root(parent, at):
    """The root of a point's pool, halving the path on the way."""
    while parent[at] != at:
        parent[at] = parent[parent[at]]
        at = int64(parent[at])
    return at


@njit(int64(LIST, LIST, int64, int64), cache=True, nogil=True)
def _join_pools(parent, size, a, b):
    """Make one pool of two, given by their roots; its root is that of the larger one."""
    if size[a] < size[b]:
        a, b = b, a
    parent[b] = a
    size[a] += size[b]
    return a


@njit(int64(NODES, int64, int64, int64, int64, int64), cache=True, nogil=True)
def _new_node(nodes, count, room, saddle, first, second):
    nodes[count, ROOM] = room
    nodes[count, SADDLE] = saddle
    nodes[count, FIRST] = first
    nodes[count, SECOND] = second
    return count + 1


@njit(int64(LEVELS, ORDER, int64, int64, int64, float64, LIST, LIST, LIST, LIST, NODES), cache=True, nogil=True)
def find_doors(level, order, width, body, room, wider, parent, size, top, node, nodes):
    """Build the tree of rooms and doors, in the order of finding.

    For example, two rooms that one corridor joins give three nodes: the two rooms, and the door between them as the
    last one.

    A saddle is a door when both pools hold at least `room` points and are wider than it by the factor `wider` and half
    a point, or when a body that needs the level `body` fits into both and not through the saddle. What has no door is
    one room; what is smaller than `room` and takes no body is left out.

    Args:
        level: int32 (h * w,), squared clearance in half points.
        order: From `falling_order`, its head alone.
        width: Of the grid, points.
        body: The level that a body needs.
        room: Points of the smallest room.
        wider: Factor, see above.
        parent: int32 (h * w,), scratch; -1 everywhere on entry.
        size: int32 (h * w,), scratch.
        top: int32 (h * w,), scratch.
        node: int32 (h * w,), scratch.
        nodes: int32 (m, 4), see ROOM; its head is overwritten. m must be at least 2 * (points / room + parts that a
            body fits into + 1).

    Returns:
        The number of nodes.
    """
    count = int64(0)
    for rank in range(order.shape[0]):
        cell = int64(order[rank])
        here = level[cell]
        parent[cell] = cell
        size[cell] = 1
        # Points come in falling order, so the first one of a pool is its widest.
        top[cell] = cell
        node[cell] = -1
        # Levels are squares of half points: 1.0 is the half point by which pools must be wider.
        high_enough = wider * math.sqrt(here) + 1.0
        for side in range(4):
            neighbour = _point_beside(cell, side, width, level.shape[0])
            # Not taken yet: it lies lower, or is as high and comes later.
            if neighbour < 0 or parent[neighbour] < 0:
                continue
            a = _find_root(parent, cell)
            b = _find_root(parent, neighbour)
            if a == b:
                continue
            # The narrower pool decides: a bulge in a corridor that is hardly wider than the saddle is no room.
            low = min(level[top[a]], level[top[b]])
            is_door = min(size[a], size[b]) >= room and math.sqrt(low) >= high_enough
            # Two pools that hold doors can be joined by a door alone, or one of their trees would be lost.
            is_door = is_door or low >= body > here or (node[a] >= 0 and node[b] >= 0)
            # Without a door at most one of the two has a tree; -1 stands for none.
            joined = max(node[a], node[b])
            if is_door:
                if node[a] < 0:
                    node[a] = count
                    count = _new_node(nodes, count, top[a], -1, -1, -1)
                if node[b] < 0:
                    node[b] = count
                    count = _new_node(nodes, count, top[b], -1, -1, -1)
                joined = count
                count = _new_node(nodes, count, -1, cell, node[a], node[b])
            root = _join_pools(parent, size, a, b)
            # The root is that of the larger pool, which need not hold the wider point.
            smaller = b if root == a else a
            node[root] = joined
            if level[top[smaller]] > level[top[root]]:
                top[root] = top[smaller]
    for rank in range(order.shape[0]):
        cell = int64(order[rank])
        # Pools that never met a door: closed rooms, and nooks that a body fits into.
        if parent[cell] == cell and node[cell] < 0 and (size[cell] >= room or level[top[cell]] >= body):
            count = _new_node(nodes, count, top[cell], -1, -1, -1)
    return count


@njit(types.void(LEVELS, ORDER, int64, LIST, LIST, LIST), cache=True, nogil=True)
def spread_rooms(level, order, width, parent, size, label):
    """Give every point the room that it falls to, so that rooms meet at the doors' saddles.

    Args:
        level: As in `find_doors`.
        order: As in `find_doors`.
        width: Of the grid, points.
        parent: int32 (h * w,), scratch; -1 everywhere on entry.
        size: int32 (h * w,), scratch.
        label: int32 (h * w,), on entry a number above 0 on each room's widest point and 0 elsewhere; on return on each
            of the room's points.
    """
    for rank in range(order.shape[0]):
        cell = int64(order[rank])
        parent[cell] = cell
        size[cell] = 1
        for side in range(4):
            neighbour = _point_beside(cell, side, width, level.shape[0])
            if neighbour < 0 or parent[neighbour] < 0:
                continue
            a = _find_root(parent, cell)
            b = _find_root(parent, neighbour)
            # Two rooms are never joined: they meet at the door's saddle.
            if a == b or (label[a] > 0 and label[b] > 0):
                continue
            label[_join_pools(parent, size, a, b)] = max(label[a], label[b])
    for rank in range(order.shape[0]):
        cell = int64(order[rank])
        label[cell] = label[_find_root(parent, cell)]
