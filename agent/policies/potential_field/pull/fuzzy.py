"""Obstacle avoidance inspired by fuzzy logic: sectors with an obstacle close by count less (paper, c_x)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agent.policies.potential_field.pull.direction import sector_table
from patrol.ground.terrain import Terrain


class FuzzySectors:
    """Scales each sector's sum by min(1, R_c / R_0), R_c being the distance to the closest obstacle in the sector.

    Distances run from the centre of the robot's point to the centres of obstacle points. Everything beyond the terrain
    is an obstacle.
    """

    def __init__(self, terrain: Terrain, sectors: int, distance: float) -> None:
        """Tabulate the distances and sectors of the points around a robot.

        Args:
            terrain: The map.
            sectors: Number of sectors.
            distance: R_0, m.
        """
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
        """c_x of every sector.

        Args:
            row: Row of the robot's point in the terrain.
            col: Column of the same point.

        Returns:
            float64 (sectors,), in [0, 1].
        """
        side = 2 * self._reach + 1
        blocked = self._blocked[row : row + side, col : col + side].reshape(-1)[self._near] != 0
        closest = np.full(self._sectors, self._distance)
        np.minimum.at(closest, self._sector[blocked], self._away[blocked])
        return closest / self._distance
