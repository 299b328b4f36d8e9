"""Terrains of maps in ROS map_server's format, read as nav2's map server reads them, without shrinking an obstacle.

A map is a YAML file (`patrol.maps.map_file`) and the image that it names, whose pixels are the map's cells, the
upper row at the highest y.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from patrol.errors import BadInput, NotPrepared, printable
from patrol.ground.shapes import cover, touched_points
from patrol.ground.terrain import MAX_POINTS, BoolGrid, Terrain, whole_points
from patrol.maps.builtins import builtin_terrain
from patrol.maps.cells import MapImage, free_levels, image_size, read_image, single_unknown_cells
from patrol.maps.doubts import settings_text, wrong_settings
from patrol.maps.map_file import MapFile, map_meaning, read_map_file

__all__ = ["load_terrain", "read_terrain"]

CELLS_AT_ONCE = 16_000_000
"""Cells of a map that are made points at a time, which bounds the memory that this takes."""

LARGE_S = 10.0
"""Shortest reading time of a map that is announced, s."""

POINTS_S, CELLS_S = 1.2e-6, 0.08e-6
"""Of that, the time for each point and for each cell, s: 25 million points of 100 million cells took 38 s."""

_LAST: dict[tuple[str, float], BoolGrid] = {}
"""The points of the map that was read last, by its content and the side of a point: a run asks for them three times."""


class TerrainSource(Protocol):
    """A terrain's name or file, and its keep-outs: a scenario's section `terrain`."""

    @property
    def builtin(self) -> str | None:
        """Name of a built-in terrain, or None."""
        ...

    @property
    def map(self) -> str | None:
        """A map_server YAML file, where there is no built-in terrain."""
        ...

    @property
    def keep_out(self) -> Sequence[Sequence[tuple[float, float]]]:
        """Polygons that no body may enter, m."""
        ...


def load_terrain(spec: TerrainSource, point: float, base: Path, within: Path | None = None) -> Terrain:
    """Return the terrain that a scenario asks for.

    The map's path is relative to `base`, and its files must lie in `within`; None allows any place.
    """
    if spec.builtin is not None:
        terrain = builtin_terrain(spec.builtin, point)
    else:
        terrain = read_terrain(base / str(spec.map), point, within)
    if not spec.keep_out:
        return terrain
    keep_out = np.zeros(terrain.shape, dtype=np.bool_)
    for polygon in spec.keep_out:
        keep_out |= cover(polygon, terrain.shape, point, terrain.origin)
    masked = Terrain(terrain.name, terrain.passable, point, terrain.origin, keep_out, terrain.source)
    if not masked.free.any():
        raise NotPrepared(f"terrain.keep_out: covers all free space of {terrain.name}; leave some for the robots")
    return masked


def read_terrain(path: Path, point: float, within: Path | None = None) -> Terrain:
    """Return the terrain of a map.

    The grid begins at the map's origin; what is left of the map beyond the last whole point is dropped. Both of the
    map's files must lie in `within`; None allows any place.
    """
    says = read_map_file(path, within)
    rows, columns = image_size(says)
    shape = tuple(whole_points(count * says.resolution, point) for count in (rows, columns))
    extent = f"{columns * says.resolution:g} x {rows * says.resolution:g} m"
    where = f"{path}: resolution = {says.resolution:g}"
    if min(shape) < 1:
        raise BadInput(f"{where}: makes the map {extent}, less than one point of {point:g} m; correct it")
    if shape[0] * shape[1] > MAX_POINTS:
        raise BadInput(
            f"{where}: makes the map {extent}, more than {MAX_POINTS} points of {point:g} m; "
            "correct it or choose a larger point"
        )
    key = (repr(map_meaning(path)), point)
    if (last := _LAST.get(key)) is not None:
        return Terrain(printable(path.stem), last, point, says.corner(rows, columns), source=path)
    if (takes := shape[0] * shape[1] * POINTS_S + rows * columns * CELLS_S) > LARGE_S:
        logging.getLogger("fogwatch").warning(
            f"{printable(str(path))}: {columns} x {rows} pixels make {shape[0] * shape[1] / 1e6:.0f} million points of "
            f"{point:g} m, which takes about {takes:.0f} s; a larger point is faster"
        )
    image = read_image(says)
    passable = _passable_points(image, says, point, (shape[0], shape[1]))
    if not passable.any():
        if not image.histogram[free_levels(says)].any():
            raise BadInput(f"{path}: leaves no free cell in {says.image.name}: {settings_text(says, image)}")
        where = f"{path}: no free point of {point:g} m"
        if why := wrong_settings(says, image):
            raise BadInput(f"{where}: {why}")
        raise BadInput(f"{where}; the free space is too narrow, choose a smaller point")
    # Only the last one: a large map takes tens of megabytes.
    _LAST.clear()
    _LAST[key] = passable
    return Terrain(printable(path.stem), passable, point, says.corner(rows, columns), source=path)


def _passable_points(image: MapImage, says: MapFile, point: float, shape: tuple[int, int]) -> BoolGrid:
    """Return the points on which no cell but free ones and single unknown ones lie, some rows of points at a time."""
    passable = np.empty(shape, dtype=np.bool_)
    cells_a_row = point / says.resolution * image.greys.shape[1]
    rows = max(int(CELLS_AT_ONCE / cells_a_row), 1)
    for first in range(0, shape[0], rows):
        strip = passable[first : first + rows]
        # A row of cells more on each side: whether an unknown cell is single depends on its neighbours.
        low = max(math.floor(first * point / says.resolution) - 1, 0)
        after = math.ceil((first + len(strip)) * point / says.resolution) + 1
        cells = image.rows(low, after)
        free = cells.cells(free_levels(says)) | single_unknown_cells(cells, says)
        above_low = first * point - low * says.resolution
        strip[:] = ~touched_points(~free, says.resolution, point, strip.shape, (0.0, above_low))
    return passable
