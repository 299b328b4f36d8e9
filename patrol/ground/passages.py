"""Narrow passages: where two robots get into each other's way (paper, "Semaphores")."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from patrol.errors import BadInput
from patrol.ground.cspace import clearance_levels, grown, parts_of
from patrol.ground.shapes import Polygon, cover
from patrol.ground.terrain import BoolGrid, Terrain

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
