"""The footprint: the points a robot observes from a pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol.ground.kernels.footprint import cast, disc, keep_sector
from patrol.ground.terrain import Terrain
from patrol.pose import Pose

REMEMBERED = 64
"""Footprints that a `Footprint` keeps unless told otherwise: in one tick every robot asks for the same few."""

Quality = float | Sequence[tuple[float, float]]
"""Share of a point's age that an observation takes away: one number in (0, 1], or (distance in m, share) corners with
straight lines between them and the nearest corner's share beyond the first and last."""


@dataclass(frozen=True, slots=True)
class View:
    """The points seen from one pose.

    Attributes:
        row0: The terrain's row under the window's row 0; may lie outside the terrain.
        col0: The terrain's column under the window's column 0; may lie outside the terrain.
        mask: uint8 (m, m), 1 where the point is seen; read-only.
        quality: float64 (m, m), share of the age that an observation removes, or None where it makes a point fresh;
            read-only.
    """

    row0: int
    col0: int
    mask: NDArray[np.uint8]
    quality: NDArray[np.float64] | None

    def mark(self, grid: NDArray[np.int32], tick: int) -> None:
        """Note in a grid at which tick each seen point was last in view.

        Args:
            grid: int32 (height, width) of the terrain, ticks; changed where this view is the later one.
            tick: When this view was seen.
        """
        rows, cols = self.mask.shape
        top, left = max(0, -self.row0), max(0, -self.col0)
        part = grid[self.row0 + top : self.row0 + rows, self.col0 + left : self.col0 + cols]
        seen = self.mask[top : top + part.shape[0], left : left + part.shape[1]] != 0
        part[seen] = np.maximum(part[seen], tick)

    def shows(self, row: int, col: int) -> bool:
        """Whether the terrain's point (row, col) is seen.

        Args:
            row: Of the terrain.
            col: Of the terrain.
        """
        up, across = row - self.row0, col - self.col0
        rows, cols = self.mask.shape
        return 0 <= up < rows and 0 <= across < cols and bool(self.mask[up, across])


class Footprint:
    """A sensor on a terrain: from a pose to the points it observes.

    The sensor sits at the centre of the point that holds the pose. It sees a disc, or a sector around the heading, by
    symmetric shadow casting. Only impassable points block sight; keep-out zones do not. The paper does not say whether
    its sensor sees through obstacles, so that is an option.

    Args:
        terrain: The ground.
        range_m: Radius of the disc, m.
        angle_deg: Of the sector, degrees; 360 for the disc.
        line_of_sight: False for a sensor that sees through obstacles.
        quality: See `Quality`.
        remembered: How many footprints to keep.
    """

    def __init__(
        self,
        terrain: Terrain,
        range_m: float,
        angle_deg: float = 360.0,
        line_of_sight: bool = True,
        quality: Quality = 1.0,
        remembered: int = REMEMBERED,
    ) -> None:
        self.terrain = terrain
        # No sensor reaches farther than across the terrain.
        self.radius = min(range_m / terrain.point, math.hypot(*terrain.shape))
        self.reach = math.floor(self.radius + 1e-9)
        self.angle = math.radians(angle_deg)
        self.line_of_sight = line_of_sight
        self._whole = angle_deg >= 360.0
        self._passable = np.ascontiguousarray(terrain.passable).view(np.uint8)
        self._quality = _quality_window(quality, self.reach, terrain.point)
        self._remembered = lru_cache(maxsize=remembered)(self._look)

    @property
    def leaves_age(self) -> bool:
        """Whether a look may leave some of a point's age (quality below 1)."""
        return self._quality is not None

    def visible(self, pose: Pose) -> View:
        """The points seen from a pose.

        Args:
            pose: As receivers of its frame compute with it (`patrol.radio.message.as_received`), so that all who hear
                it agree on the points.

        Returns:
            The footprint, shared and read-only.
        """
        row, col = self.terrain.point_at(pose.x, pose.y)
        return self._remembered(row, col, 0.0 if self._whole else pose.heading)

    def _look(self, row: int, col: int, heading: float) -> View:
        mask = np.empty((2 * self.reach + 1, 2 * self.reach + 1), dtype=np.uint8)
        look = cast if self.line_of_sight else disc
        look(self._passable, row, col, self.radius, mask, row - self.reach, col - self.reach)
        if not self._whole:
            keep_sector(mask, heading, self.angle)
        mask.setflags(write=False)
        return View(row - self.reach, col - self.reach, mask, self._quality)


def _quality_window(quality: Quality, reach: int, point: float) -> NDArray[np.float64] | None:
    if isinstance(quality, (int, float)):
        corners: Sequence[tuple[float, float]] = [(0.0, float(quality))]
    else:
        corners = quality
    if all(share == 1.0 for _, share in corners):
        return None
    offsets = np.arange(-reach, reach + 1, dtype=np.float64)
    distance = point * np.sqrt(offsets[:, None] ** 2 + offsets[None, :] ** 2)
    window = np.interp(distance, [at for at, _ in corners], [share for _, share in corners])
    window.flags.writeable = False
    return np.ascontiguousarray(window)
