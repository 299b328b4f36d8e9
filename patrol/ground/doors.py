"""Rooms and doors: how the free space falls into parts at its narrowest places.

See kernels/doors.py for how they are found. Of two ways between the same rooms only the wider is a door: the narrower
one keeps no body out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.ground.cspace import clearance_levels, needed_level, parts_of, planning_radius
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.doors import FIRST, ROOM, SADDLE, SECOND, falling_order, find_doors, spread_rooms

DOOR_CLEARANCE = 8.0
"""Clearance in m above which places are not told apart: a door is at most about 12 m wide."""

ROOM_AREA = 0.5
"""Least area in m2, of where the centre of a body as wide as the door may be, on both sides of a door."""

WIDER = 1.25
"""A door is narrower than the rooms beside it by more than this factor."""

LISTED_AREA = 2.0
"""Doors to rooms of less area than this, in m2, are not worth telling."""


@dataclass(frozen=True, slots=True)
class Door:
    """A narrowest place between two parts of the free space. Lengths are in m, areas in m2."""

    x: float  # of its middle
    y: float  # of its middle
    width: float  # between the walls, in whole free points
    radius: float  # of the widest body that passes
    behind: float  # area of the part that it leads to: the one not reached, or the smaller one
    passes: bool  # whether the body fits through


class Rooms:
    """The rooms and doors of a terrain for one body, as binary trees (see kernels/doors.py).

    `nodes`, int32 (n, 4), are rooms (leaves) and doors (inner nodes), each after those that it joins. By node, `areas`
    are in m2, `leaves` are the rooms in it, and `reached` tells whether the body gets there.

    Of the grids, `labels`, int32 (h, w), is 1 + the node of the room that a point belongs to, or 0; `levels`, int32 (h,
    w), the squared clearance in half points; and `crumbs` the free points in no room, in `crumb_count` connected parts.
    """

    def __init__(self, terrain: Terrain, radius: float, reach: BoolGrid) -> None:
        """Split the terrain."""
        self.terrain = terrain
        self.body = needed_level(radius, terrain.point)
        self.levels, self.nodes, self.labels = _split_rooms(terrain, radius)
        count = len(self.nodes)
        areas = np.bincount(self.labels.ravel(), minlength=count + 1)[1:]
        self.areas = areas * terrain.point_area
        self.leaves: list[list[int]] = []
        self.reached = np.zeros(count, dtype=np.bool_)
        self.is_root = np.ones(count, dtype=np.bool_)
        flat = reach.ravel()
        for number, node in enumerate(self.nodes):
            if node[ROOM] >= 0:
                self.leaves.append([number])
                self.reached[number] = flat[node[ROOM]]
                continue
            sides = [int(node[FIRST]), int(node[SECOND])]
            self.leaves.append(self.leaves[sides[0]] + self.leaves[sides[1]])
            self.is_root[sides] = False
            self.areas[number] = self.areas[sides].sum()
            self.reached[number] = self.reached[sides].any()
        self.crumbs: BoolGrid = terrain.free & (self.labels == 0)
        self.crumb_count = parts_of(self.crumbs)[1]

    def points_of(self, leaves: Sequence[int]) -> BoolGrid:
        """Return the points of some rooms."""
        chosen = np.zeros(len(self.nodes) + 1, dtype=np.bool_)
        chosen[[leaf + 1 for leaf in leaves]] = True
        points: BoolGrid = chosen[self.labels]
        return points

    def door(self, number: int, behind: float) -> Door:
        """Return the door that an inner node stands for; `behind` is the area (m2) that it leads to."""
        cell = int(self.nodes[number, SADDLE])
        x, y = self.terrain.centre(*divmod(cell, self.terrain.width))
        level = int(self.levels.flat[cell])
        width = math.sqrt(level) * self.terrain.point
        return Door(x, y, width, max(0.5 * width - 0.5 * self.terrain.point, 0.0), behind, level >= self.body)

    def doors(self) -> list[Door]:
        """Return the doors between parts large enough to list, at least one of them reached; narrowest first."""
        doors = []
        for root in np.flatnonzero(self.is_root & self.reached):
            waiting = [int(root)]
            while waiting:
                number = waiting.pop()
                node = self.nodes[number]
                if node[SADDLE] < 0:
                    continue
                sides = [int(node[FIRST]), int(node[SECOND])]
                waiting += sides
                if self.areas[sides].min() < LISTED_AREA or not self.reached[sides].any():
                    continue
                # Of two sides that are both reached, the smaller one counts as behind the door.
                far = [side for side in sides if not self.reached[side]] or sides
                doors.append(self.door(number, float(self.areas[far].min())))
        return sorted(doors, key=lambda door: (door.width, -door.behind, door.x, door.y))


def _split_rooms(terrain: Terrain, radius: float) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Clearance levels (h, w), the nodes (see kernels/doors.py) and each point's room, node number + 1 or 0, (h, w)."""
    point = terrain.point
    clearance = max(DOOR_CLEARANCE, 2.0 * planning_radius(radius, point))
    levels = clearance_levels(terrain.free, math.ceil(clearance / point) + 2)
    flat = levels.ravel()
    order = np.empty(flat.size, dtype=np.int32)
    order = order[: falling_order(flat, np.empty(int(flat.max()) + 2, dtype=np.int32), order)]
    body = needed_level(radius, point)
    room = max(math.ceil(ROOM_AREA / terrain.point_area), 1)
    # A tree of n rooms has n - 1 doors; the sum bounds the rooms of at least `room` points and those that take a body.
    capacity = 2 * (order.size // room + parts_of(levels >= body)[1] + 1)
    nodes = np.full((capacity, 4), -1, dtype=np.int32)
    size, top, node = (np.empty(flat.size, dtype=np.int32) for _ in range(3))
    parent = np.full(flat.size, -1, dtype=np.int32)
    nodes = nodes[: find_doors(flat, order, terrain.width, body, room, WIDER, parent, size, top, node, nodes)]
    labels = np.zeros(flat.size, dtype=np.int32)
    leaves = np.flatnonzero(nodes[:, ROOM] >= 0)
    labels[nodes[leaves, ROOM]] = leaves + 1
    parent[:] = -1
    spread_rooms(flat, order, terrain.width, parent, size, labels)
    return levels, nodes, labels.reshape(terrain.shape)
