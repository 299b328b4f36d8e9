"""A ring of two rooms and two corridors, worked out by hand, whose corridors can be one-way.

         x = 0 1        5               15       19 20 m
    y = 9     +--------+                 +--------+
      8.5     |        +-----------------+        |
      7       |  west    upper corridor      east |
      3       |        +-----------------+        |
      1.5     |          lower corridor           |
    y = 1     +--------+-----------------+--------+

Centres of a body of 0.3 m, in points of 0.5 m, get along a corridor in one row only: at y = 2.25 and at y = 7.75.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain
from patrol.zones.ground import with_zones
from patrol.zones.spec import ZoneSpec

POINT = 0.5
LOWER: list[list[float]] = [[6, 1], [14, 1], [14, 3.5], [6, 3.5]]
UPPER: list[list[float]] = [[6, 6.5], [14, 6.5], [14, 9], [6, 9]]


def zone(name: str, polygon: list[list[float]], one_way: int) -> dict[str, Any]:
    return {"name": name, "polygon": polygon, "one_way": one_way}


def ring(*zones: dict[str, Any]) -> Terrain:
    """The ring with some zones."""
    passable = np.zeros((20, 40), dtype=np.bool_)
    passable[2:18, 2:10] = passable[2:18, 30:38] = True
    passable[3:6, 2:38] = passable[14:17, 2:38] = True
    return with_zones(Terrain("ring", passable, POINT), [ZoneSpec.model_validate(each) for each in zones])


def write_ring(folder: Path) -> Path:
    """Write the ring as a map; return its YAML file."""
    return write_cells(folder, "ring", ~ring().passable)


def write_cells(folder: Path, name: str, occupied: NDArray[np.bool_]) -> Path:
    """Write cells of the ring's size as a map or a mask; return its YAML file."""
    image = np.where(occupied[::-1], 0, 254).astype(np.uint8)
    (folder / f"{name}.pgm").write_bytes(b"P5 %d %d 255\n" % occupied.shape[::-1] + image.tobytes())
    says = f"image: {name}.pgm\nresolution: {POINT}\norigin: [0, 0, 0]\n"
    says += "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (folder / f"{name}.yaml").write_text(says, encoding="utf-8")
    return folder / f"{name}.yaml"
