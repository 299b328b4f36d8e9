"""The sensors that come with fogwatch: a disc, one that sees through obstacles, and a sector of either."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import REMEMBERED, Footprint, SensorSetup, View
from patrol.ground.terrain import Terrain
from patrol.kernels.footprint import cast, disc, keep_sector
from patrol.pose import Pose

__all__ = ["Disc", "Quality", "Sector", "SeeThrough", "footprint_of"]

Quality = float | Sequence[tuple[float, float]]
"""Share of a point's age that an observation takes away: one number in (0, 1], or (distance in m, share) corners with
straight lines between them and the nearest corner's share beyond the first and last. For example, with the corners
(1, 1.0) and (5, 0.2) a point 3 m away loses 60 % of its age."""


class Disc:
    """Sees all round as far as its range, by symmetric shadow casting.

    Only impassable points block sight; keep-out zones do not.

    Args:
        setup: The ground and the range.
        quality: See `Quality`.
    """

    all_round = True
    _mark = staticmethod(cast)

    def __init__(self, setup: SensorSetup, quality: Quality = 1.0) -> None:
        self._terrain = setup.terrain
        self._radius, self._reach = setup.radius, setup.reach
        self._passable = np.ascontiguousarray(setup.terrain.passable).view(np.uint8)
        self._quality = _quality_window(quality, self._reach, setup.terrain.point)

    @property
    def leaves_age(self) -> bool:
        """True if a look may leave some of a point's age (quality below 1)."""
        return self._quality is not None

    def visible(self, pose: Pose) -> View:
        """The points in a disc around a pose that are in sight."""
        row, col = self._terrain.point_at(pose.x, pose.y)
        row0, col0, side = row - self._reach, col - self._reach, 2 * self._reach + 1
        mask = np.empty((side, side), dtype=np.uint8)
        self._mark(self._passable, row, col, self._radius, mask, row0, col0)
        return View(row0, col0, mask, self._quality)


class SeeThrough(Disc):
    """Sees all round as far as its range, obstacles or not. The paper does not say whether its sensor does."""

    _mark = staticmethod(disc)


class Sector:
    """Sees what another sensor sees within an angle around the heading.

    Args:
        whole: The other sensor, which sees all round.
        angle_deg: Of the sector, degrees.
    """

    all_round = False

    def __init__(self, whole: Disc, angle_deg: float) -> None:
        self._whole = whole
        self._angle = math.radians(angle_deg)
        self.leaves_age = whole.leaves_age

    def visible(self, pose: Pose) -> View:
        """The points in a sector around the heading that are in sight, and the robot's own."""
        view = self._whole.visible(pose)
        # In place: the inner sensor makes a new mask for each call.
        keep_sector(view.mask, pose.heading, self._angle)
        return view


def footprint_of(
    terrain: Terrain,
    range_m: float,
    angle_deg: float = 360.0,
    line_of_sight: bool = True,
    quality: Quality = 1.0,
    remembered: int = REMEMBERED,
) -> Footprint:
    """The footprint of a sensor that comes with fogwatch.

    Args:
        terrain: The ground.
        range_m: Radius of the disc, m.
        angle_deg: Of the sector, degrees; 360 for the disc.
        line_of_sight: False for a sensor that sees through obstacles.
        quality: See `Quality`.
        remembered: How many views to keep.
    """
    setup = SensorSetup(terrain, range_m, line_of_sight)
    full_circle = (Disc if line_of_sight else SeeThrough)(setup, quality)
    return Footprint(setup, full_circle if angle_deg >= 360.0 else Sector(full_circle, angle_deg), remembered)


def _quality_window(quality: Quality, reach: int, point: float) -> NDArray[np.float64] | None:
    if isinstance(quality, (int, float)):
        corners: Sequence[tuple[float, float]] = [(0.0, float(quality))]
    else:
        corners = quality
    if all(share == 1.0 for _, share in corners):
        return None
    offsets = np.arange(-reach, reach + 1, dtype=np.float64)
    distance = point * np.sqrt(offsets[:, None] ** 2 + offsets[None, :] ** 2)
    return np.ascontiguousarray(
        np.interp(distance, [corner_m for corner_m, _ in corners], [share for _, share in corners])
    )
