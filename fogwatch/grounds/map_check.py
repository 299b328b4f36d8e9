"""Map check: how much of a map a body reaches and sees, which parts are sealed off and why, and the doors.

Pure analysis; `fogwatch map check` prints the result and draws it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.ground.doors import LISTED_AREA, Door, Rooms
from patrol.ground.fields import StaticFields, compute_fields
from patrol.ground.left_out import joined_ground, why_out_of_reach
from patrol.ground.marks import middle
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.doors import FIRST, SADDLE, SECOND
from patrol.maps.doubts import perhaps_unknown
from patrol.pose import Pose
from patrol.starts import starting_part


@dataclass(frozen=True, slots=True)
class SealedPart:
    """Free space that the body cannot reach."""

    x: float  # m, of a place inside
    y: float  # m
    area: float  # m²
    seen: float  # m² of it that are seen from outside the part
    standable: float  # m² where the body's centre could be
    at_border: bool  # touches the map's border
    reason: str
    door: Door | None  # too narrow, where that is the reason; else None


@dataclass(frozen=True, eq=False)
class MapReport:
    """The result of a map check; all areas are in m²."""

    terrain: Terrain
    fields: StaticFields
    radius: float  # of the body, m
    sensor_range: float  # m
    line_of_sight: bool  # obstacles block the sensor
    free: float  # area of the free space
    fits: float  # where the body's centre may be
    reachable: float  # of that, what can be reached from the starts
    patrolled: float  # seen from what is reachable
    unseen: float  # passable, but never seen
    unseen_sealed: float  # of that, what is in sealed-off parts, listed or not
    parts: tuple[SealedPart, ...]  # the listed ones, largest first
    small_parts: int  # number of those too small to list
    small_area: float  # of those, in total
    doors: tuple[Door, ...]  # between the starts and the free space around them, narrowest first
    sealed: NDArray[np.int32]  # (h, w), number of the listed part at a point, from 1, or 0

    @property
    def perhaps_unknown(self) -> BoolGrid:
        """bool (height, width), passable points of greys that are read as free, and that mean unknown in most maps."""
        return perhaps_unknown(self.terrain)  # here, as it reads the map again, and only pictures need it


def check_map(
    terrain: Terrain, radius: float, sensor_range: float = 10.0, line_of_sight: bool = True, starts: Sequence[Pose] = ()
) -> MapReport:
    """Check a map for a body and a sensor; `radius` and `sensor_range` are in m.

    Without `starts`, the body starts at a place where random starts would be.
    """
    if not starts:
        part = np.flatnonzero(starting_part(terrain, radius))
        starts = [Pose(*terrain.centre(*divmod(int(part[0]), terrain.width)), 0.0)]
    fields = compute_fields(terrain, radius, sensor_range, line_of_sight, starts)
    rooms = Rooms(terrain, radius, fields.reach)
    parts = sorted(_sealed_parts(rooms, fields, radius), key=lambda sealed: (-sealed[0].area, sealed[0].x, sealed[0].y))
    listed = [(part, leaves) for part, leaves in parts if part.area >= LISTED_AREA]
    sealed = np.zeros(terrain.shape, dtype=np.int32)
    for number, (_, leaves) in enumerate(listed, start=1):
        sealed[rooms.points_of(leaves)] = number
    in_parts = rooms.points_of([leaf for _, leaves in parts for leaf in leaves]) | rooms.crumbs
    unseen = terrain.passable & ~fields.patrolled
    small = [part.area for part, _ in parts[len(listed) :]]
    return MapReport(
        terrain=terrain,
        fields=fields,
        radius=radius,
        sensor_range=sensor_range,
        line_of_sight=line_of_sight,
        free=_mask_area(terrain, terrain.free),
        fits=_mask_area(terrain, fields.cspace),
        reachable=_mask_area(terrain, fields.reach),
        patrolled=_mask_area(terrain, fields.patrolled),
        unseen=_mask_area(terrain, unseen),
        unseen_sealed=_mask_area(terrain, unseen & in_parts),
        parts=tuple(part for part, _ in listed),
        small_parts=len(small) + rooms.crumb_count,
        small_area=sum(small) + _mask_area(terrain, rooms.crumbs),
        doors=tuple(rooms.doors()),
        sealed=sealed,
    )


def _sealed_parts(rooms: Rooms, fields: StaticFields, radius: float) -> list[tuple[SealedPart, list[int]]]:
    """Find every part without a start, with its rooms, except parts too narrow for the body that are seen entirely."""
    joined = joined_ground(rooms.terrain, fields.reach)
    parts = []
    for number, node in enumerate(rooms.nodes):
        side, door = number, None
        if node[SADDLE] >= 0 and rooms.reached[node[FIRST]] != rooms.reached[node[SECOND]]:
            side = int(node[SECOND] if rooms.reached[node[FIRST]] else node[FIRST])
            door = rooms.door(number, float(rooms.areas[side]))
        elif rooms.reached[number] or not rooms.is_root[number]:
            continue
        points = rooms.points_of(rooms.leaves[side])
        why = why_out_of_reach(points, joined, fields.cspace, radius)
        part = _describe_part(rooms.terrain, fields, points, why, door)
        if part.standable or part.seen < part.area:
            parts.append((part, rooms.leaves[side]))
    return parts


def _describe_part(
    terrain: Terrain, fields: StaticFields, points: BoolGrid, reason: str, door: Door | None
) -> SealedPart:
    """Describe some rooms as one sealed-off part."""
    x, y = middle(points, terrain)
    standable = _mask_area(terrain, points & fields.cspace)
    edges = (points[0], points[-1], points[:, 0], points[:, -1])
    return SealedPart(
        x=x,
        y=y,
        area=_mask_area(terrain, points),
        seen=_mask_area(terrain, points & fields.patrolled),
        standable=standable,
        at_border=any(bool(edge.any()) for edge in edges),
        reason=reason,
        door=door if standable else None,
    )


def _mask_area(terrain: Terrain, mask: BoolGrid) -> float:
    return float(np.count_nonzero(mask) * terrain.point_area)
