"""The map that a robot has: its latched topic, written as a file of ROS's map_server, which everything else reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from patrol.errors import BadInput
from ros2.wire.messages import OccupancyGrid

OCCUPIED_SHARE = 0.65
FREE_SHARE = 0.196
"""Least share of a wall and largest share of free ground in a cell, as map_server has it. What is unknown, a pixel of
205, lies in between, and no robot drives there."""
_WALL, _UNKNOWN, _FREE = 0, 205, 254


def write_map(grid: OccupancyGrid, folder: Path) -> Path:
    """Write a map as map_server does, and return the path of the YAML file.

    A map that is turned raises `BadInput`, because a map_server file cannot say that here.
    """
    if grid.origin.heading != 0.0:
        raise BadInput("the robot's map is turned against its frame; give --map FILE with an upright one")
    share = grid.cells.astype(np.float64) / 100.0
    pixels = np.full(grid.cells.shape, _UNKNOWN, dtype=np.uint8)
    pixels[(share >= 0.0) & (share < FREE_SHARE)] = _FREE
    pixels[share > OCCUPIED_SHARE] = _WALL
    Image.fromarray(np.ascontiguousarray(pixels[::-1])).save(folder / "map.png")
    path = folder / "map.yaml"
    origin = [grid.origin.x, grid.origin.y, 0.0]
    path.write_text(
        f"image: map.png\nmode: trinary\nresolution: {grid.resolution!r}\norigin: {origin}\nnegate: 0\n"
        f"occupied_thresh: {OCCUPIED_SHARE}\nfree_thresh: {FREE_SHARE}\n",
        encoding="utf-8",
    )
    return path
