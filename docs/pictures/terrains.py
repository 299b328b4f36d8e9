"""Makes the pictures of the built-in terrains that docs/results/paper.md shows."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from monitor.figures.ground import Key, Layer, canvas, legend, paint, painted, save
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import builtin_terrain
from patrol.palette import WALL
from patrol.scenario import BUILTINS

POINT_M = 0.1


def draw(terrain: Terrain, file: Path) -> None:
    """Draw a terrain into a PNG file."""
    layer = Layer(WALL, "obstacle", ~terrain.passable)
    xmin, ymin, xmax, ymax = terrain.bounds
    figure, axes = canvas(terrain, f"{terrain.name} (a reconstruction): {xmax - xmin:g} x {ymax - ymin:g} m")
    paint(axes, terrain, painted(terrain.shape, [layer]))
    free = np.count_nonzero(terrain.passable) * terrain.point_area
    keys = [Key(WALL, f"obstacles: {(xmax - xmin) * (ymax - ymin) - free:.0f} m²")] * bool(layer.mask.any())
    legend(axes, [*keys, Key("#ffffff", f"free: {free:.0f} m²")])
    save(figure, file)


def main() -> None:
    """Draw all built-in terrains."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "results" / "paper")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    for name in BUILTINS:
        draw(builtin_terrain(name, POINT_M), folder / f"terrain_{name}.png")


if __name__ == "__main__":
    main()
