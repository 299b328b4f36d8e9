"""The ground that each robot can reach and see by itself, in a terrain of parts without a way between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.cspace import parts_of
from patrol.ground.fields import StaticFields, anchor
from patrol.ground.terrain import BoolGrid, frozen_grid

if TYPE_CHECKING:
    from patrol.prepare import Prepared


@dataclass(frozen=True, eq=False, slots=True)
class OwnGround:
    """The ground that a robot can reach and see by itself, in the part of the terrain that it starts in; read-only."""

    reach: BoolGrid  # the connected part of the reachable ground
    patrolled: BoolGrid  # the patrolled points in it, and those that are best seen from it


def own_grounds(prepared: Prepared) -> dict[int, OwnGround]:
    """Find the ground that each robot can reach and see by itself; those of one radius in one part share an object."""
    terrain = prepared.terrain
    labels: dict[int, NDArray[np.int32]] = {}
    own_by_part: dict[tuple[int, int], OwnGround] = {}
    grounds = {}
    for spec, start in zip(prepared.scenario.roster, prepared.starts, strict=True):
        fields = prepared.fields[spec.number]
        body = id(fields)
        if body not in labels:
            labels[body], _ = parts_of(np.ascontiguousarray(fields.reach))
        start_point = anchor(terrain, fields.cspace, start.x, start.y)
        part = 0 if start_point is None else int(labels[body][start_point])
        if (body, part) not in own_by_part:
            reach = frozen_grid(labels[body] == part) if part else fields.reach
            own_by_part[body, part] = OwnGround(reach, _seen_from(fields, reach))
        grounds[spec.number] = own_by_part[body, part]
    return grounds


def _seen_from(fields: StaticFields, part: BoolGrid) -> BoolGrid:
    """Find the patrolled points in a part of the reachable ground, and those whose nearest seeing point lies in it."""
    hidden = fields.proxy >= 0
    seen_from_part = part & fields.patrolled
    seen_from_part[hidden] = part.reshape(-1)[fields.proxy[hidden]]
    return frozen_grid(seen_from_part)
