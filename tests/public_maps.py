"""Compare how maps are read with the rule that Nav2 publishes, cell by cell, and print a table.

    .venv/bin/python -m tests.public_maps FOLDER

FOLDER holds a folder OWNER+NAME for each repository, with map files and images at their paths in it. The rule here is
written a second time, from `nav2_map_server/src/map_io.cpp`, and shares no code with `patrol.maps`.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from patrol.errors import BadInput
from patrol.maps.cells import free_cells, occupied_levels, read_image, single_unknown_cells
from patrol.maps.doubts import doubts
from patrol.maps.load import read_terrain
from patrol.maps.map_file import read_map_file

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
HEADINGS = (
    "repository",
    "map",
    "size (m)",
    "mode, thresholds",
    "free (m²)",
    "occupied (m²)",
    "unknown (m²)",
    "specks (m²)",
    "cells",
    "other than Nav2",
    "warnings",
)


def nav2_cells(path: Path, says: dict[str, Any]) -> NDArray[np.int8]:
    """Read a map by Nav2's rule: int8 (rows, columns), the lowest y first.

    Nav2 keeps values from 1 to 99 in the modes scale and raw. Here those between the thresholds count as unknown.
    """
    with Image.open(path.parent / says["image"]) as image:
        rgba = np.asarray(image.convert("RGBA")).astype(np.float64)
    luma = np.floor(257.0 * (rgba[..., :3] @ (0.299, 0.587, 0.114)) + 0.5)
    grey = np.floor(luma / 257.0).astype(np.uint8)
    normalised = grey.astype(np.float32) / np.float32(255.0)
    if str(says.get("mode", "trinary")).lower() == "raw":
        normalised = np.where(grey > OCCUPIED, np.nan, grey / np.float32(100.0))
    elif not says["negate"]:
        normalised = np.float32(1.0) - normalised
    cells = np.full(grey.shape, UNKNOWN, dtype=np.int8)
    cells[normalised >= np.float32(says["occupied_thresh"])] = OCCUPIED
    cells[normalised <= np.float32(says["free_thresh"])] = FREE
    cells[rgba[..., 3] < 255.0] = UNKNOWN
    return cells[::-1]


def our_cells(path: Path) -> NDArray[np.int8]:
    """Read a map as fogwatch does, in the same form."""
    says = read_map_file(path)
    cells = np.full(read_image(says).greys.shape, UNKNOWN, dtype=np.int8)
    cells[read_image(says).cells(occupied_levels(says))] = OCCUPIED
    cells[free_cells(says)] = FREE
    return cells


def row_of(root: Path, path: Path) -> tuple[list[str], int]:
    """Return a row of the table, and the number of cells that are read otherwise than Nav2 reads them."""
    repository, *inner = path.relative_to(root).parts
    names = [repository.replace("+", "/"), "/".join(inner)]
    try:
        says = read_map_file(path)
    except BadInput as refused:
        return [*names, *["-"] * 8, f"refused: {str(refused).partition('.yaml: ')[2]}"], 0
    text = path.read_text(encoding="latin-1").replace("\t", " ")
    nav2, ours = nav2_cells(path, yaml.safe_load(text)), our_cells(path)
    others = int(np.count_nonzero(nav2 != ours))
    cell_m2 = says.resolution**2
    specks = np.count_nonzero(single_unknown_cells(read_image(says), says)) * cell_m2
    areas = [f"{np.count_nonzero(ours == value) * cell_m2:.1f}" for value in (FREE, OCCUPIED, UNKNOWN)]
    size = " x ".join(f"{count * says.resolution:.1f}" for count in ours.shape[::-1])
    settings = f"{says.mode}, {says.free_thresh:g}, {says.occupied_thresh:g}{', negate' if says.negate else ''}"
    try:
        warnings = "; ".join(line.partition(": ")[2] for line in doubts(read_terrain(path, max(0.1, says.resolution))))
    except BadInput as refused:
        warnings = f"refused: {str(refused).partition('.yaml: ')[2]}"
    return [*names, size, settings, *areas, f"{specks:.1f}", str(ours.size), str(others), warnings or "-"], others


def table(root: Path) -> Iterator[tuple[str, int]]:
    """Yield the lines of the table, each with the number of cells that are read otherwise than Nav2 reads them."""
    yield f"| {' | '.join(HEADINGS)} |", 0
    yield f"|{'---|' * len(HEADINGS)}", 0
    for path in sorted([*root.rglob("*.yaml"), *root.rglob("*.yml")]):
        row, others = row_of(root, path)
        yield f"| {' | '.join(row)} |", others


if __name__ == "__main__":
    wrong = 0
    for line, others in table(Path(sys.argv[1])):
        print(line)
        wrong += others
    sys.exit(wrong > 0)
