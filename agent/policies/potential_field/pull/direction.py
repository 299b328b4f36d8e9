"""The direction that forces give: the mode and vector-sum methods (paper, "direction decision methods")."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from patrol.pose import TAU, wrap


def sector_table(sectors: int, reach: int) -> NDArray[np.uint16]:
    """Return the sector of every bearing, by offset in rows and columns.

    Sector s is centred on the bearing s * 2 pi / sectors; a bearing on the border belongs to the later sector.

    Args:
        sectors: Number of sectors.
        reach: Largest offset, in points.

    Returns:
        uint16 (2 * reach + 1, 2 * reach + 1), indexed by the offsets plus ``reach``.
    """
    up, across = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    table: NDArray[np.uint16] = (np.floor(np.arctan2(up, across) / (TAU / sectors) + 0.5) % sectors).astype(np.uint16)
    return table


def bearings_by_force(sums: NDArray[np.float64]) -> list[float]:
    """Mode method: the bisectors of the sectors that exert force, strongest first.

    Args:
        sums: float64 (sectors,), the sum of moduli in each sector.

    Returns:
        Bearings in rad; of equally strong sectors the lowest comes first.
    """
    forces = sums.tolist()
    order = sorted(range(len(forces)), key=forces.__getitem__, reverse=True)
    bearings = bisectors(len(forces))
    return [bearings[sector] for sector in order if forces[sector] > 0.0]


@cache
def bisectors(sectors: int) -> tuple[float, ...]:
    """Return the bearings on which the sectors are centred, rad.

    Args:
        sectors: Their number.
    """
    return tuple(wrap(sector * TAU / sectors) for sector in range(sectors))


def bearings_by_vector(x: float, y: float, turns: int) -> list[float]:
    """Vector-sum method: the bearing of the sum, then alternatives turned ever further to either side.

    The alternatives are for a robot that cannot move in the direction of the sum.

    Args:
        x: x component of the sum.
        y: y component of the sum.
        turns: Number of bearings.

    Returns:
        Bearings in rad; none when the sum is zero.
    """
    if x == 0.0 and y == 0.0:
        return []
    bearing = math.atan2(y, x)
    sides = (((index + 1) // 2) * (1 if index % 2 else -1) for index in range(turns))
    return [wrap(bearing + side * TAU / turns) for side in sides]
