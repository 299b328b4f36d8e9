"""Grounds of benchmarks: an open field, where a robot fits on `site`, a square with obstacles, and a terrain as tiles.

The last two are written as maps, so that scenarios name them like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from patrol.ground.terrain import BoolGrid
from patrol.maps.builtins import builtin_terrain
from patrol.prepare import prepare
from patrol.random import draw
from patrol.scenario import load_scenario

KILOMETRE = 1000
"""Side of the usual square in m, and in points of 1 m."""

OBSTACLES = 250
"""On a square kilometre."""

SHORTEST_SIDE, LONGEST_SIDE = 5, 30
"""Of an obstacle, m."""
GAP = 6
"""Between two obstacles, and between one and the border, m at least: any of our bodies passes."""

SEED = 15


def open_field() -> tuple[BoolGrid, tuple[int, int]]:
    """Return an open field with a border, bool (880, 1000), and the row and column of its middle."""
    is_open = np.ones((880, 1000), dtype=np.bool_)
    is_open[[0, -1], :] = is_open[:, [0, -1]] = False
    return is_open, (440, 500)


def site() -> tuple[BoolGrid, tuple[int, int]]:
    """Return where a robot's centre can be on `site`, bool (1600, 2400), and the row and column near its middle."""
    prepared = prepare(load_scenario({"terrain": {"builtin": "site"}, "robots": {"count": 1, "model": "holonomic"}}))
    reach = prepared.fields[1].reach
    places = np.argwhere(reach)
    row, col = places[int(np.argmin(np.abs(places - np.array(reach.shape) // 2).sum(axis=1)))]
    return reach, (int(row), int(col))


GROUNDS: Mapping[str, Callable[[], tuple[BoolGrid, tuple[int, int]]]] = {
    "open field of 880 x 1000 points": open_field,
    "site of 1600 x 2400 points": site,
}
"""Functions that make the grounds which waves run over, and a start on each, by name."""


def square(side: int = KILOMETRE, seed: int = SEED) -> BoolGrid:
    """A square at points of 1 m with rectangular obstacles that leave a way round each, as many as its area asks for.

    Args:
        side: In m, at least `LONGEST_SIDE` and two gaps.
        seed: Of the obstacles' places and sizes.

    Returns:
        bool (side, side), True where a body may be.
    """
    obstacles = round(OBSTACLES * (side / KILOMETRE) ** 2)
    passable = np.ones((side, side), dtype=np.bool_)
    placed = attempt = 0
    while placed < obstacles:
        attempt += 1
        place = [draw(seed, attempt, index) for index in range(4)]
        tall, wide = (SHORTEST_SIDE + int(share * (LONGEST_SIDE - SHORTEST_SIDE + 1)) for share in place[:2])
        row, col = (
            GAP + int(share * (side - 2 * GAP - length + 1))
            for share, length in zip(place[2:], (tall, wide), strict=True)
        )
        if passable[row - GAP : row + tall + GAP, col - GAP : col + wide + GAP].all():
            passable[row : row + tall, col : col + wide] = False
            placed += 1
    return passable


def tiled(name: str, point: float, tiles: int = 2) -> BoolGrid:
    """A built-in terrain, tiles x tiles times side by side; its roads along the border join.

    Args:
        name: Of the terrain.
        point: Side of one point, m.
        tiles: Along each side.

    Returns:
        bool (h, w).
    """
    return np.tile(builtin_terrain(name, point).passable, (tiles, tiles))


def write_map(passable: BoolGrid, point: float, path: Path) -> Path:
    """Write a ground as a map.

    Args:
        passable: bool (h, w), True where a body may be; row 0 has the lowest y.
        point: Side of one point, m.
        path: Of the YAML file; the image lies beside it.

    Returns:
        `path`.
    """
    image = path.with_suffix(".pgm")
    height, width = passable.shape
    pixels = np.where(passable[::-1], 254, 0).astype(np.uint8)
    image.write_bytes(f"P5\n{width} {height}\n255\n".encode() + pixels.tobytes())
    lines = [
        f"image: {image.name}",
        f"resolution: {point:g}",
        "origin: [0.0, 0.0, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.25",
    ]
    path.write_text("\n".join([*lines, ""]), encoding="ascii")
    return path
