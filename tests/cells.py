"""Maps and masks of cells, as files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

POINT = 0.5
"""Side of a cell, m."""


def write_cells(folder: Path, name: str, occupied: NDArray[np.bool_]) -> Path:
    """Write cells as a map or a mask; return its YAML file."""
    image = np.where(occupied[::-1], 0, 254).astype(np.uint8)
    (folder / f"{name}.pgm").write_bytes(b"P5 %d %d 255\n" % occupied.shape[::-1] + image.tobytes())
    says = f"image: {name}.pgm\nresolution: {POINT}\norigin: [0, 0, 0]\n"
    says += "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (folder / f"{name}.yaml").write_text(says, encoding="utf-8")
    return folder / f"{name}.yaml"
