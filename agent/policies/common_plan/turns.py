"""The cost of turns on the ways between stations, for a sensor that sees a sector.

Each station is seen in a heading. A body that faces where it drives turns on the spot when it leaves a station, and
when it has come to the next one. The turns count as the ways that its wheels drive meanwhile.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain

NEIGHBOURS = 12
"""The way from a station begins towards one of so many nearest ones."""

SAME_M = 1e-9
"""Stations nearer than this are in one place, m."""

FACING = 0.25
"""By this share of the sensor's angle a body may face beside a station's heading and still see most of it."""

Metres = NDArray[np.float64]
Angles = NDArray[np.float64]
"""In rad."""


class Turns:
    """The turns between some stations."""

    def __init__(
        self,
        radius: float,
        angle: float,  # of the sensor, rad
        terrain: Terrain,
        ways_m: Metres,
        spots: NDArray[np.int64],  # flat indices
        headings: Angles,  # in which each station is seen; NaN for any
    ) -> None:
        """Work out all directions."""
        self._radius, self._facing, self._headings = radius, FACING * angle, headings
        self._spots = spots = np.array([terrain.centre(*divmod(spot, terrain.width)) for spot in spots.tolist()])
        self._out = np.zeros_like(ways_m)  # from each station towards each, rad
        nearest = np.argsort(ways_m, axis=1, kind="stable")[:, : NEIGHBOURS + 1]
        for number, near in enumerate(nearest):
            beside = near[ways_m[number, near] > SAME_M]
            if beside.size:
                # Of those on the way, the nearest one.
                length_m = 1.001 * ways_m[number, beside][:, None] + ways_m[beside]
                offsets = (spots[beside] - spots[number]).tolist()
                towards = np.array([math.atan2(up, across) for across, up in offsets])
                self._out[number] = towards[length_m.argmin(axis=0)]
        same = ways_m <= SAME_M
        there = np.where(same, headings[:, None], self._out.T + math.pi)  # where a body faces that arrives
        self._arriving_m = self._facing_m(there, headings)
        leaving_m = np.where(same, 0.0, self._turn_m(_between(self._out, headings[:, None])))
        self.between_m: Metres = leaving_m + self._arriving_m  # float64 (n, n)
        np.fill_diagonal(self.between_m, 0.0)

    def from_pose_m(self, pose: Angles, ways_m: Metres, here_m: float) -> Metres:
        """Return the turns on the ways from a pose (x, y, heading) to each station; it is at those up to `here_m`."""
        nearest = int(((self._spots - pose[:2]) ** 2).sum(axis=1).argmin())
        leaving_m = self._turn_m(_between(self._out[nearest], pose[2])) + self._arriving_m[nearest]
        at_place = np.full(len(ways_m), pose[2])
        return np.where(ways_m <= here_m, self._facing_m(at_place, self._headings), leaving_m)

    def _facing_m(self, headings: Angles, wanted: Angles) -> Metres:
        return self._turn_m(np.maximum(_between(headings, wanted) - self._facing, 0.0))

    def _turn_m(self, angles: Angles) -> Metres:
        return self._radius * angles


def _between(first: Angles, last: Angles) -> Angles:
    """Return the angles between headings, rad; 0 for one that is NaN."""
    return np.nan_to_num(np.abs(np.remainder(first - last + math.pi, math.tau) - math.pi))
