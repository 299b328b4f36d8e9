"""The picture of a split into regions: neighbours have different colours; connecting points are marked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor.figures.ground import Key, canvas, key_column, label, paint, save
from patrol.ground.terrain import Terrain
from patrol.palette import LIGHT, WALL, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from patrol.regions.split import RegionSplit

BORDER = "#3b5b78"
CONNECTION = LIGHT["alert"]
COLOURS = ("#bcd9ea", "#f6dfb0", "#c8e3c0", "#f0c9cf", "#d6cdea", "#e3dccb", "#bfe3df", "#f3d3b8")
"""The colours of regions; paler where the body's centre does not fit."""

PALER = 0.5
"""Strength of the paler colours, 0 to 1."""

NAMED = 0.02
"""A region's number is drawn if the region is wider than this share of the terrain."""


def region_picture(terrain: Terrain, radius: float, split: RegionSplit, out: Path) -> None:
    """Draw the regions of a terrain, and their connections for a body of a radius, m."""
    count = len(split.polygons)
    title = f"{terrain.name}: {count} region{'' if count == 1 else 's'}, connected for a body of {radius:g} m radius"
    figure, axes = canvas(terrain, title)
    image = np.empty((*terrain.shape, 3), dtype=np.uint8)
    image[:] = rgb(WALL)
    shades = np.array([rgb(COLOURS[shade]) for shade in _region_shades(split.labels, count)], dtype=np.float64).reshape(
        -1, 3
    )
    inside, fits = split.labels >= 0, split.parts >= 0
    image[inside] = (255.0 - PALER * (255.0 - shades[split.labels[inside]])).astype(np.uint8)
    image[fits] = shades[split.labels[fits]].astype(np.uint8)
    paint(axes, terrain, image)
    for number, polygon in enumerate(split.polygons):
        _draw_outline(axes, number, polygon)
    for link in split.connections:
        axes.plot(link.x, link.y, "o", color=CONNECTION, markersize=4.0, markeredgecolor="white", zorder=5)
    keys = [
        Key(WALL, "wall, unknown, or kept out of"),
        Key(COLOURS[0], "a region, where the body's centre fits"),
        Key(BORDER, "border of a region", "-"),
        Key(CONNECTION, f"connecting point ({len(split.connections)})", "o"),
    ]
    key_column(figure, axes, terrain, keys)
    save(figure, out)


def _draw_outline(axes: Axes, number: int, polygon: tuple[tuple[float, float], ...]) -> None:
    xs, ys = (np.array(values) for values in zip(*polygon, strict=True))
    axes.fill(xs, ys, fill=False, edgecolor=BORDER, linewidth=0.9, zorder=4)
    left, right = axes.get_xlim()
    if min(np.ptp(xs), np.ptp(ys)) > NAMED * (right - left):
        label(axes, float(xs.mean()), float(ys.mean()), str(number), size=7.0)


def _region_shades(labels: NDArray[np.int32], count: int) -> list[int]:
    """Return a colour for each region that no neighbour has, as far as the colours suffice; the least used first."""
    beside: list[set[int]] = [set() for _ in range(count)]
    for here, shifted in ((labels[:, 2:], labels[:, :-2]), (labels[2:], labels[:-2])):
        apart = (here != shifted) & (here >= 0) & (shifted >= 0)
        for a, b in np.unique(np.stack([here[apart], shifted[apart]], axis=1), axis=0):
            beside[a].add(int(b))
            beside[b].add(int(a))
    shades: list[int] = []
    used = [0] * len(COLOURS)
    for number in range(count):
        used_shades = {shades[neighbour] for neighbour in beside[number] if neighbour < number}
        free = [shade for shade in range(len(COLOURS)) if shade not in used_shades] or list(range(len(COLOURS)))
        shade = min(free, key=lambda shade: (used[shade], shade))
        used[shade] += 1
        shades.append(shade)
    return shades
