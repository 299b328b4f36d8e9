"""The direction that forces give: the mode and vector-sum methods (paper, "direction decision methods").

Sums may be changed before: obstacles close by scale them (`FuzzySectors`), and other robots add to them (`repel`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain
from patrol.kernels.elementary import arctan2
from patrol.pose import TAU, Pose, wrap
from patrol.radio.peers import Peer, places_of
from patrol.scenario import PotentialFieldOptions


def sector_table(sectors: int, reach: int) -> NDArray[np.uint16]:
    """Return the sector of every bearing, by offset in rows and columns from -``reach`` to ``reach`` points.

    The indices are the offsets plus ``reach``. Sector s is centred on the bearing s * 2 pi / sectors; a bearing on the
    border belongs to the later sector.
    """
    up, across = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    table: NDArray[np.uint16] = (np.floor(arctan2(up, across) / (TAU / sectors) + 0.5) % sectors).astype(np.uint16)
    return table


def bearings_by_force(sums: NDArray[np.float64]) -> list[float]:
    """Mode method: return the bisectors of the sectors that exert force, rad, strongest first.

    Of equally strong sectors the lowest comes first.
    """
    forces = sums.tolist()
    order = sorted(range(len(forces)), key=forces.__getitem__, reverse=True)
    bearings = bisectors(len(forces))
    return [bearings[sector] for sector in order if forces[sector] > 0.0]


@cache
def bisectors(sectors: int) -> tuple[float, ...]:
    """Return the bearings on which the sectors are centred, rad."""
    return tuple(wrap(sector * TAU / sectors) for sector in range(sectors))


def bearings_by_vector(x: float, y: float, turns: int) -> list[float]:
    """Vector-sum method: return the bearing of the sum, then alternatives turned ever further to either side, rad.

    The alternatives are for a robot that cannot move in the direction of the sum. With them there are ``turns``
    bearings, and none when the sum is zero.
    """
    if x == 0.0 and y == 0.0:
        return []
    bearing = math.atan2(y, x)
    sides = (((index + 1) // 2) * (1 if index % 2 else -1) for index in range(turns))
    return [wrap(bearing + side * TAU / turns) for side in sides]


class FuzzySectors:
    """Obstacle avoidance inspired by fuzzy logic (paper, c_x): sectors with an obstacle close by count less.

    Scales each sector's sum by min(1, R_c / R_0), R_c being the distance to the closest obstacle in the sector, and R_0
    the given distance, m.

    Distances run from the centre of the robot's point to the centres of obstacle points. Everything beyond the terrain
    is an obstacle.
    """

    def __init__(self, terrain: Terrain, sectors: int, distance: float) -> None:
        reach = math.ceil(distance / terrain.point)
        self._distance = distance
        self._reach = reach
        self._blocked = np.pad(terrain.blocked, reach, constant_values=1)
        offsets = np.arange(-reach, reach + 1)
        away = terrain.point * np.hypot(offsets[:, None], offsets[None, :])
        near = away < distance
        near[reach, reach] = False
        self._near = np.flatnonzero(near)
        self._away = away.reshape(-1)[self._near]
        self._sector = sector_table(sectors, reach).reshape(-1)[self._near]
        self._sectors = sectors

    def coefficients(self, row: int, col: int) -> NDArray[np.float64]:
        """Return c_x of every sector, in [0, 1], at a robot's point of the terrain."""
        side = 2 * self._reach + 1
        blocked = self._blocked[row : row + side, col : col + side].reshape(-1)[self._near] != 0
        closest = np.full(self._sectors, self._distance)
        np.minimum.at(closest, self._sector[blocked], self._away[blocked])
        return closest / self._distance


def repel(sums: NDArray[np.float64], pose: Pose, peers: Mapping[int, Peer], options: PotentialFieldOptions) -> None:
    """Add repulsive forces from the peers to the sums of a `Pull`, in place.

    Each peer pushes straight away with ``repulsion`` times the sum of all attraction, times exp(-(d /
    repulsion_reach)^2). The paper gives no formula; this one is relative to the attraction, whatever its scale.
    """
    as_vector = options.direction == "vector"
    total = float(sums[2] if as_vector else sums.sum())
    for x, y in places_of(peers).tolist():
        across, up = pose.x - x, pose.y - y
        distance = math.hypot(across, up)
        if distance == 0.0:
            continue
        force = options.repulsion * total * math.exp(-((distance / options.repulsion_reach) ** 2))
        if as_vector:
            sums[0] += force * across / distance
            sums[1] += force * up / distance
        else:
            sums[round(math.atan2(up, across) / (TAU / sums.size)) % sums.size] += force
