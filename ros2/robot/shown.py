"""Maps: the robot's own, read from its latched topic; for RViz and Foxglove the map, the believed fog and the way.

Viewers cost the patrol nothing: a thread of its own sends, pictures that come too soon are left out, and a large grid
is thinned.
"""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from queue import Queue
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from agent.ports import Decision
from patrol.exchange import Sensed
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from ros2.robot.options import DriveSettings
from ros2.wire.frames import apart
from ros2.wire.messages import OccupancyGrid, Path
from ros2.wire.names import LATCHED, EntityKind
from ros2.wire.ports import Ros2Link

if TYPE_CHECKING:
    from patrol.ground.fog import Fog  # has kernels, which are not compiled when the robot's map is read

EVERY_S = 2.0
"""Wall time between two pictures of the fog, s."""
MOST_CELLS = 250_000
"""Cells of a grid of fog; of a finer one every second, third, ... row and column is sent."""
MOST_POSES = 2000
APART_M = 0.1
"""Distance between the poses of a path, m."""
GRAPH_S = 2.0
OCCUPIED, UNKNOWN = 100, -1


class Shown:
    """Publishes the robot's belief (`agent.ports.Telemetry`)."""

    def __init__(
        self, link: Ros2Link, settings: DriveSettings, terrain: Terrain, fog: Fog, stamp_ns: Callable[[], int]
    ) -> None:
        self._terrain = terrain
        self._fog = fog
        self._settings = settings
        self._stamp_ns = stamp_ns
        self._way: deque[Pose] = deque(maxlen=MOST_POSES)
        self._grids = link.publisher(settings.topic("fog"), OccupancyGrid, LATCHED)
        self._paths = link.publisher(settings.topic("path"), Path, LATCHED)
        self._due_s = 0.0
        self._pictures: Queue[tuple[NDArray[np.int8], tuple[Pose, ...]]] = Queue(1)
        self._thin = max(1, math.ceil(math.sqrt(terrain.height * terrain.width / MOST_CELLS)))
        Thread(target=self._publish_shown, name="show", daemon=True).start()

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """A decision has been taken."""
        del decision, decision_ms
        pose = sensed.pose
        if not self._way or apart(pose, self._way[-1])[0] >= APART_M:
            self._way.append(pose)
        now_s = time.monotonic()
        # Where the thread is still busy, this picture is left out instead of waiting.
        if now_s >= self._due_s and self._pictures.empty():
            self._due_s = now_s + EVERY_S
            self._pictures.put((fog_cells(self._fog, sensed.k, self._thin), tuple(self._way)))

    def _publish_shown(self) -> None:
        settings, frame = self._settings, self._settings.localisation.map_frame
        while True:
            cells, way = self._pictures.get()
            stamp_ns = self._stamp_ns()
            grid = grid_of(self._terrain, cells, self._thin, frame, stamp_ns)
            self._grids.send(replace(grid, origin=settings.on_robots_map(grid.origin)))
            self._paths.send(Path(stamp_ns, frame, tuple(map(settings.on_robots_map, way))))


def show_map(link: Ros2Link, settings: DriveSettings, terrain: Terrain, stamp_ns: int) -> bool:
    """Publish the map, latched, unless another node already does; return True if it was published."""
    topic = link.resolve(settings.topic("map"))
    if any(entity.kind is EntityKind.PUBLISHER and entity.topic == topic for entity in link.graph(GRAPH_S)):
        return False
    cells = np.where(terrain.free, 0, OCCUPIED).astype(np.int8)
    link.publisher(topic, OccupancyGrid, LATCHED).send(
        grid_of(terrain, cells, 1, settings.localisation.map_frame, stamp_ns)
    )
    return True


def fog_cells(fog: Fog, tick: int, thin: int) -> NDArray[np.int8]:
    """Return a fog as cells: 0 where it was just seen, 100 where it is stalest, -1 off the patrolled ground.

    The cells are every `thin`-th row and column: int8 (ceil(h / thin), ceil(w / thin)).

    For example, at tick 10 a point last seen at tick 6 gives 50 if the stalest was last seen at tick 2.
    """
    ages = tick - fog.last_seen[::thin, ::thin].astype(np.int64)
    # Against the stalest point of now, so that the picture uses the whole scale.
    shares = np.clip(OCCUPIED * ages // max(1, fog.mfow(tick)), 0, OCCUPIED)
    return np.where(fog.patrolled[::thin, ::thin] != 0, shares, UNKNOWN).astype(np.int8)


def grid_of(terrain: Terrain, cells: NDArray[np.int8], thin: int, frame: str, stamp_ns: int) -> OccupancyGrid:
    """Return a grid on a terrain.

    `cells` is int8 (h, w), with row 0 at the lowest y; the side of a cell is `thin` points.
    """
    return OccupancyGrid(stamp_ns, frame, terrain.point * thin, Pose(*terrain.origin, 0.0), cells)


OCCUPIED_SHARE = 0.65
FREE_SHARE = 0.196
"""Least share of a wall and largest share of free ground in a cell, as map_server has it. A cell that is unknown,
a pixel of 205, lies in between, and no robot drives there."""
_WALL, _UNKNOWN, _FREE = 0, 205, 254


def write_map(grid: OccupancyGrid, folder: FilePath, name: str = "map") -> FilePath:
    """Write a map as map_server does, its YAML file and its image with the same name, and return the former's path."""
    share = grid.cells.astype(np.float64) / 100.0
    pixels = np.full(grid.cells.shape, _UNKNOWN, dtype=np.uint8)
    pixels[(share >= 0.0) & (share < FREE_SHARE)] = _FREE
    # Images have their first row at the top, grids at the lowest y, hence the reversal below.
    pixels[share > OCCUPIED_SHARE] = _WALL
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(folder / f"{name}.png")
    path = folder / f"{name}.yaml"
    origin = [grid.origin.x, grid.origin.y, grid.origin.heading]
    path.write_text(
        f"image: {json.dumps(f'{name}.png')}\nmode: trinary\nresolution: {grid.resolution!r}\norigin: {origin}\n"
        f"negate: 0\noccupied_thresh: {OCCUPIED_SHARE}\nfree_thresh: {FREE_SHARE}\n",
        encoding="utf-8",
    )
    return path
