"""The way back to the reachable points, for a body that is off them.

Routes run over points that leave half a point more room than the body needs. A body fits in places in between, such as
pockets and slits, and can get in there where its steps are not bound to points. From there no route leads on, so it
first has to return to a reachable point.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from agent.kernels.wave import FAR, HEMMED, STATUS
from agent.routes.ground import BoxPaths, Ground
from agent.routes.wave import box_around, paths_in
from patrol.ground.cspace import cspace_of
from patrol.ground.swept_path import line_is_free

if TYPE_CHECKING:
    from agent.routes.ground import Spot

MOST_TRIED = 1000
"""Places that are tried at a time, so that the search stays short on fine points."""

REACH = 5.0
"""Longest way back, m."""

OFF_CENTRE = 1.25
"""A body fits somewhere on every point at whose centre one smaller by so many points has its planning radius: half a
diagonal, half a point for that radius, and a little for rounding."""

LONGEST_TRAIL = 64
"""Places that are remembered of the way off the reachable points."""


class WayBack:
    """Finds ways from anywhere to the points on which a body's centre may be, whatever is closed at this tick."""

    def __init__(self, ground: Ground, radius: float, *, wanted: bool = True) -> None:
        """Compute nothing yet; unless `wanted`, there are no ways at all."""
        self._wanted = wanted
        self._ground = ground
        self._radius = radius
        self._loose: Ground | None = None
        self._trail: list[Spot] = []
        self._paths: tuple[tuple[int, int], BoxPaths | None] | None = None

    def note(self, x: float, y: float) -> None:
        """Remember where the body has been since it was last on the reachable points; call it once a tick."""
        if not self._wanted:
            return
        if self._ground.join(x, y) is not None:
            self._trail = [(x, y)]
        elif len(self._trail) < LONGEST_TRAIL:
            self._trail.append((x, y))

    def is_needed(self, x: float, y: float) -> bool:
        """Return True if a body is so far off the reachable points that it could not join them with nothing closed."""
        return self._wanted and self._ground.static.join(x, y) is None

    def paths(self, x: float, y: float) -> BoxPaths | None:
        """Find the paths to the nearest reachable points, over all points on which the body may fit.

        They are at most `REACH` long; None if none begins at (x, y).
        """
        here = self._ground.terrain.point_at(x, y)
        if self._paths is None or self._paths[0] != here:
            self._paths = here, self._paths_at(*here)
        return self._paths[1]

    def spot(self, x: float, y: float) -> Spot | None:
        """Return a place on the way back to which a body that moves in any direction can go straight, or None.

        It is on the point nearest to the end of the way, else a place that the body came by, x and y in m. None where
        neither can be reached in a free straight line.
        """
        paths = self.paths(x, y) if self._wanted else None
        if paths is not None:
            terrain = self._ground.terrain
            (ox, oy), point = terrain.origin, terrain.point
            here = terrain.point_at(x, y)
            rows, cols = np.nonzero(paths.length < paths.length_to(*here))
            lengths = paths.length[rows, cols]
            xs, ys = ox + (cols + paths.col0 + 0.5) * point, oy + (rows + paths.row0 + 0.5) * point
            centre = terrain.centre(*here)
            off = x - centre[0], y - centre[1]
            for index in np.lexsort((np.hypot(xs - x, ys - y), lengths))[:MOST_TRIED]:
                # In a slit as wide as the body, the places in line with its own are free, and those at centres not.
                for across, up in ((0.0, 0.0), off):
                    spot = float(xs[index]) + across, float(ys[index]) + up
                    if self._is_free(x, y, spot):
                        return spot
        return next((spot for spot in self._trail if spot != (x, y) and self._is_free(x, y, spot)), None)

    def _paths_at(self, row: int, col: int) -> BoxPaths | None:
        terrain, static = self._ground.terrain, self._ground.static
        if not terrain.inside(row, col):
            return None
        if self._loose is None:
            loose = cspace_of(terrain, max(0.0, self._radius - OFF_CENTRE * terrain.point))
            self._loose = Ground(terrain, loose)
        top, bottom, left, right = box = box_around((row, col), math.ceil(REACH / terrain.point), terrain.shape)
        inner = static.state[top + 1 : bottom + 1, left + 1 : right + 1]
        rows, cols = np.nonzero((inner & STATUS != 0) & (inner & HEMMED != 0))
        starts = list(zip((rows + top).tolist(), (cols + left).tolist(), strict=True))
        paths = paths_in(self._loose, starts, box, round(100.0 * REACH / terrain.point))
        paths.length[1:-1, 1:-1][inner & STATUS != 0] = 0
        return paths if paths.length_to(row, col) < FAR else None

    def _is_free(self, x: float, y: float, place: Spot) -> bool:
        return line_is_free(self._ground.terrain, (x, y), place, self._radius)
