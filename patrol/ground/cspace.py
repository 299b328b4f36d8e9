"""The C-space of a body: where its centre may be on a terrain, its connected parts and narrow passages.

The kernels are loaded where they are used: a process that is given the static fields needs none of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.shapes import Polygon, cover
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid

IntGrid = NDArray[np.int32]

TOLERANCE = 1e-9
"""Rounding allowed in the distance (m) of a body's centre from a wall."""


def planning_radius(radius: float, point: float) -> float:
    """Return the clearance in m that a body needs at the centres of points.

    Half a point more than the body, so that a straight drive between neighbouring C-space points touches no wall.

    For example, 0.35 m for a body of 0.3 m on points of 0.1 m.
    """
    return radius + 0.5 * point


def needed_level(radius: float, point: float) -> int:
    """Return the least squared clearance, in half points, at which a body has its planning radius.

    For example, 49 for a body of 0.3 m on points of 0.1 m: 0.35 m are 7 half points.
    """
    halves = min(2.0 * (planning_radius(radius, point) - TOLERANCE) / point, 46_000.0)  # its square fits int32
    return max(math.ceil(halves * halves), 1)


def clearance_levels(free: BoolGrid, cap: int) -> IntGrid:
    """Return the squared distance, in half points, from each point's centre to the nearest blocked point.

    The grid's edge counts as blocked. The result is int32 (h, w), 0 on blocked points and at most (2 cap - 1)^2:
    distances beyond `cap` whole points are not told apart, and the cost grows with it.
    """
    from patrol.kernels.clearance import square_clearance

    cap = min(cap, min(free.shape) // 2 + 2)  # the edge is never further
    along = np.empty(free.shape, dtype=np.int32)
    levels = np.empty(free.shape, dtype=np.int32)
    square_clearance(np.ascontiguousarray(free).view(np.uint8), cap, along, levels)
    return levels


def cspace_of(terrain: Terrain, radius: float) -> BoolGrid:
    """Return the C-space of a body, read-only: where its centre keeps the planning radius to every wall.

    Distances are exact, from a point's centre to the nearest blocked or keep-out square and to the terrain's edge.
    """
    # Two points beyond what is needed suffice: farther distances need not be told apart.
    needed = needed_level(radius, terrain.point)
    cap = math.ceil(math.sqrt(needed)) // 2 + 2
    return frozen_grid(clearance_levels(terrain.free, cap) >= needed)


def parts_of(mask: BoolGrid) -> tuple[IntGrid, int]:
    """Return the connected parts of a mask (8 neighbours, no corner cutting), and the number of them.

    The parts are int32 (h, w), labels from 1, and 0 outside the mask.
    """
    from patrol.kernels.clearance import label_parts

    labels = np.empty(mask.shape, dtype=np.int32)
    work = np.empty(mask.size, dtype=np.int32)
    return labels, int(label_parts(np.ascontiguousarray(mask).view(np.uint8), labels, work))


def grown(mask: BoolGrid) -> BoolGrid:
    """Return a mask with all eight neighbours of its points."""
    # First along the columns and then along the rows, so that corners are covered by two plain steps.
    rows = mask.copy()
    rows[1:] |= mask[:-1]
    rows[:-1] |= mask[1:]
    wide = rows.copy()
    wide[:, 1:] |= rows[:, :-1]
    wide[:, :-1] |= rows[:, 1:]
    return wide


SMALLEST_M2 = 1.0
"""Area below which a narrow part is an irregularity of a wall."""


def narrow_passages(terrain: Terrain, reach: BoolGrid, width: float) -> list[BoolGrid]:
    """Return the critical areas of a terrain: connected parts narrower than `width` (m) that join wider ground.

    Narrow is what no disc of that diameter, lying on free ground, covers. A narrow part counts when it meets wider
    ground in two places or more, so that corners and dead ends do not. The masks are bool (h, w), the one with the
    lowest point first.
    """
    half = width / (2.0 * terrain.point)
    cap = math.ceil(half) + 2
    fits = clearance_levels(terrain.free, cap) >= (2.0 * half) ** 2
    # A point is covered when a disc's centre is within half a width of it; beyond the edge there is none.
    apart = np.pad(~fits, cap, constant_values=True)
    covered = fits | (clearance_levels(apart, cap)[cap:-cap, cap:-cap] <= (2.0 * half) ** 2)
    labels, count = parts_of(reach & ~covered)
    wide = reach & covered
    passages = []
    for label in range(1, count + 1):
        part = labels == label
        if np.count_nonzero(part) * terrain.point_area < SMALLEST_M2:
            continue
        _, mouths = parts_of(grown(part) & wide)
        if mouths >= 2:
            passages.append(part)
    return passages


def check_areas(polygons: Sequence[Polygon], terrain: Terrain, field: str) -> None:
    """Refuse critical areas that are given and hold no free ground."""
    for number, polygon in enumerate(polygons):
        if not (terrain.free & cover(polygon, terrain.shape, terrain.point, terrain.origin)).any():
            raise BadInput(f"{field}.{number}: holds no free point of {terrain.name}; correct or drop it")
