"""Static fields of one body and sensor on one terrain: where it fits, where it gets to, what it can see from there.

They depend on nothing that happens in a run, so they are computed once and shared, memory-mapped, by all processes.
The kernels that compute them are loaded where they are used: a process that is given the fields needs none of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.cspace import TOLERANCE, IntGrid, cspace_of, parts_of
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid
from patrol.pose import Pose

GRIDS = ("cspace", "reach", "patrolled", "proxy")

MARGIN = 2.0
"""Longest way (points) from a start to the C-space, beyond the planning radius's half point."""


@dataclass(frozen=True, eq=False)
class StaticFields:
    """The reach and the view of robots of one radius on one terrain. All arrays are (height, width) and read-only."""

    cspace: BoolGrid  # the body fits with its centre at the point's centre
    reach: BoolGrid  # the connected parts of `cspace` that hold a start, as far as ways lead there and back
    patrolled: BoolGrid  # seen from some place in `reach`: all such points, or those to be watched
    # int32, for a patrolled point outside `reach` the flat index of the nearest point of `reach` that sees it
    # (paper/NOTES 4: such points pull through it), else -1
    proxy: IntGrid

    def stands_for(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return from where points are seen, flat indices: from there, or from their posts where no body fits."""
        return np.where(self.reach.reshape(-1)[points], points, self.proxy.reshape(-1)[points])

    def watching(self, points: BoolGrid) -> StaticFields:
        """Return the fields of robots that patrol nothing else than some points."""
        proxy = np.where(points, self.proxy, np.int32(-1))
        proxy.flags.writeable = False
        return StaticFields(self.cspace, self.reach, frozen_grid(self.patrolled & points), proxy)

    def save(self, folder: Path) -> None:
        """Write the four arrays as .npy files into a folder, which is made when missing."""
        save_grids(folder, self, GRIDS)

    @staticmethod
    def load(folder: Path) -> StaticFields:
        """Load the fields that `save` wrote into a folder, memory-mapped and read-only."""
        cspace, reach, patrolled, proxy = (load_grid(folder / f"{name}.npy") for name in GRIDS)
        return StaticFields(cspace, reach, patrolled, proxy)


def save_grids(folder: Path, arrays: object, names: Sequence[str]) -> None:
    """Write some attributes of an object as .npy files into a folder, which is made when missing."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        np.save(folder / f"{name}.npy", getattr(arrays, name))


def load_grid(path: Path) -> NDArray[Any]:
    """Return an array of a .npy file, memory-mapped and read-only."""
    return np.asarray(np.load(path, mmap_mode="r"))


def anchor(terrain: Terrain, cspace: BoolGrid, x: float, y: float) -> tuple[int, int] | None:
    """Return the (row, col) of the C-space point through which a body joins the C-space, or None.

    The nearest point within two points and a half (the lowest index of several) that a straight line over free points
    leads to, so that no start joins a room behind a wall. None when there is no such point.
    """
    row, col = terrain.point_at(x, y)
    span = math.ceil(MARGIN + 0.5) + 1
    candidates = []
    for r in range(max(row - span, 0), min(row + span + 1, terrain.height)):
        for c in range(max(col - span, 0), min(col + span + 1, terrain.width)):
            if cspace[r, c]:
                cx, cy = terrain.centre(r, c)
                away = math.hypot(cx - x, cy - y) / terrain.point
                if away <= MARGIN + 0.5 + TOLERANCE:
                    candidates.append((away, r, c))
    # By distance and then by index, so that equal distances give the same point everywhere.
    for _, r, c in sorted(candidates):
        if _open_line(terrain, x, y, *terrain.centre(r, c)):
            return r, c
    return None


def _open_line(terrain: Terrain, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Return True if every tenth of a point along a short straight line lies on free points."""
    steps = max(math.ceil(10.0 * math.hypot(x1 - x0, y1 - y0) / terrain.point), 1)
    for i in range(steps + 1):
        cell = terrain.point_at(x0 + (x1 - x0) * i / steps, y0 + (y1 - y0) * i / steps)
        if not terrain.inside(*cell) or not terrain.free[cell]:
            return False
    return True


def compute_fields(
    terrain: Terrain, radius: float, sensor_range: float, line_of_sight: bool, starts: Sequence[Pose]
) -> StaticFields:
    """Return the static fields of a body and a sensor, for robots that begin at given places.

    Patrolled is what the whole disc around some place in reach sees, whatever the sensor's angle: a robot may turn.
    """
    cspace = cspace_of(terrain, radius)
    labels, _ = parts_of(cspace)
    start_labels = []
    for start in starts:
        cell = anchor(terrain, cspace, start.x, start.y)
        if cell is None:
            raise BadInput(
                f"robots.starts: a body of radius {radius:g} m does not fit at ({start.x:g}, {start.y:g}) on "
                f"{terrain.name}; start it further from the walls"
            )
        start_labels.append(int(labels[cell]))
    reach = np.isin(labels, sorted(set(start_labels))) & cspace
    reach = frozen_grid(reach)
    proxy = proxies_of(terrain, reach, sensor_range, line_of_sight)
    proxy.flags.writeable = False
    return StaticFields(cspace, reach, frozen_grid(reach | (proxy >= 0)), proxy)


def proxies_of(terrain: Terrain, reach: BoolGrid, sensor_range: float, line_of_sight: bool) -> IntGrid:
    """Return the flat index of the nearest point of `reach` that sees each passable point outside of it.

    The result is int32 (h, w), -1 in `reach` and where there is no such point.
    """
    from patrol.kernels.clearance import nearest
    from patrol.kernels.coverage import see_back, see_from_reach

    # No sensor reaches further than across the terrain, and squares must fit into 32 bits.
    radius = min(sensor_range / terrain.point, math.hypot(*terrain.shape), 32_000.0)
    cap = math.floor(radius + TOLERANCE)
    limit = math.floor(radius * radius + TOLERANCE)
    shape = terrain.shape
    reached = reach.view(np.uint8)
    proxy = np.full(shape, -1, dtype=np.int32)
    # One above the limit, so that a point at exactly the range still counts as nearer.
    square = np.full(shape, limit + 1, dtype=np.int32)
    if not line_of_sight:
        wanted = (terrain.passable & ~reach).view(np.uint8)
        nearest(reached, wanted, cap, limit, square, proxy)
        return proxy
    passable = terrain.passable.view(np.uint8)
    now = np.empty((2 * cap + 8, 4), dtype=np.int64)
    after = np.empty_like(now)
    see_from_reach(passable, reached, limit, now, after, proxy, square)
    work = np.empty(terrain.passable.size, dtype=np.int32)
    see_back(passable, reached, limit, now, after, work, proxy, square)
    # The kernel's -2 says that a point was looked at; readers only know -1.
    return np.maximum(proxy, -1, out=proxy)
