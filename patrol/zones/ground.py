"""Zones laid over the grid of a terrain: their points, their directions and their top speeds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import NotPrepared
from patrol.ground.terrain import Terrain
from patrol.zones.spec import points_of

if TYPE_CHECKING:
    from collections.abc import Collection

    from patrol.zones.spec import ZoneSpec


def with_zones(terrain: Terrain, zones: Iterable[ZoneSpec]) -> Terrain:
    """Return the terrain without the ground that zones keep bodies out of."""
    zones = list(zones)
    keep_out, kept_out = terrain.keep_out.copy(), []
    for number, zone in enumerate(zones):
        points = points_of(zone, terrain)
        if not points.any():
            outside = f"{zone.name} lies outside of {terrain.name}"
            raise NotPrepared(f"zones.{number}: {outside}, which {terrain.span}; move or drop it")
        if zone.keep_out:
            keep_out |= points
            kept_out.append(zone.name)
    if not kept_out:
        return terrain
    zoned = Terrain(terrain.name, terrain.passable, terrain.point, terrain.origin, keep_out, terrain.source)
    if not zoned.free.any():
        names = ", ".join(kept_out)
        reason = f"{names} keep robots out of all free space of {terrain.name}"
        raise NotPrepared(f"zones: {reason}; leave some for the robots")
    return zoned


class SpeedLimits:
    """The top speeds of a terrain's slow zones, point by point as for all zones.

    For example, where `ward` allows 0.3 m/s and a part of it, `bed`, 0.1 m/s, the limit there is 0.1 m/s with both in
    force and 0.3 m/s with `ward` alone.
    """

    def __init__(self, zones: Iterable[ZoneSpec], terrain: Terrain) -> None:
        """Lay the slow zones over the grid."""
        self._terrain = terrain
        self._slow = [(zone.name, zone.speed, points_of(zone, terrain)) for zone in zones if zone.speed is not None]

    def at(self, x: float, y: float, in_force: Collection[str]) -> float:
        """Return the top speed of a body whose centre is at a place, m/s; infinity where no zone limits it."""
        if not self._slow:
            return math.inf
        row, col = self._terrain.point_at(x, y)
        if not self._terrain.inside(row, col):
            return math.inf
        limits = [speed for name, speed, points in self._slow if name in in_force and points.item(row, col)]
        return min(limits, default=math.inf)

    def delays(self, speed: float, in_force: Collection[str]) -> NDArray[np.float64] | None:
        """Return the time that the limits add to each metre of a body, s per m, float64 (height, width).

        0 where the body drives at its top speed, `speed` in m/s; None where it does so everywhere.
        """
        slow = [(limit, points) for name, limit, points in self._slow if name in in_force and limit < speed]
        if not slow:
            return None
        added = np.zeros(self._terrain.shape)
        for limit, points in slow:
            np.maximum(added, 1.0 / limit - 1.0 / speed, out=added, where=points)
        return added
