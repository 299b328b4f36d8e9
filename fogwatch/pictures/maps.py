"""The pictures of maps: of a map check, of one map on another, and of a split into regions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fogwatch.grounds.map_align import Place, WallMap, moved
from fogwatch.grounds.map_check import MapReport
from monitor.figures import ground as figures
from patrol.ground.cspace import grown
from patrol.ground.doors import Door
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.palette import LIGHT, MARKS, MEANINGS, NEVER_SEEN, WALL, rgb
from patrol.pose import Pose
from ros2.wire.frames import inverted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from patrol.ground.marks import Mark
    from patrol.regions.split import RegionSplit

ALERT = LIGHT["alert"]
REACHABLE = "#d9ecf5"
SEEN = "#8fc3dd"
SEALED_SEEN = "#f6e3a1"
SEALED = "#e79f3c"
KEEP_OUT = "#9c8fb5"
PERHAPS_UNKNOWN = "#c9a7d8"
PASSES = "#1d5f8a"
MOST_DOORS = 25
"""Doors drawn at most: first those too narrow for the body, then the narrowest of the others."""


def map_picture(report: MapReport, out: Path, marks: Sequence[Mark] = ()) -> None:
    """Draw a map check: walls, what is reached, seen and not seen, sealed-off parts, doors, and a site's marks."""
    terrain, fields = report.terrain, report.fields
    sealed = report.sealed > 0
    unseen = terrain.passable & ~fields.patrolled
    unreached = fields.patrolled & ~fields.reach
    layers = [
        figures.Layer(WALL, "wall or unknown", ~terrain.passable),
        figures.Layer(REACHABLE, "reached by the body's centre", fields.reach),
        figures.Layer(SEEN, "seen, but no place for the centre", unreached & ~sealed & ~terrain.keep_out),
        figures.Layer(KEEP_OUT, "keep-out area, but seen", unreached & ~sealed & terrain.keep_out),
        figures.Layer(SEALED_SEEN, "sealed off, but seen", sealed & unreached),
        figures.Layer(SEALED, "sealed off and never seen", sealed & unseen),
        figures.Layer(NEVER_SEEN, "never seen: small parts, blind corners", unseen & ~sealed),
        figures.Layer(PERHAPS_UNKNOWN, "read as free, perhaps unknown", report.perhaps_unknown),
    ]
    title = f"{terrain.name}: a body of {report.radius:g} m radius, a sensor of {report.sensor_range:g} m"
    shown, window = figures.cropped(terrain, terrain.passable)
    figure, axes = figures.canvas(shown, title)
    figures.paint(axes, shown, figures.painted(terrain.shape, layers)[window], ~shown.passable)
    doors = sorted(report.doors, key=lambda door: (door.passes, door.width))[:MOST_DOORS]
    boxes: list[figures.Box] = []
    for door in doors:
        _draw_door(axes, door, boxes)
    for number, part in enumerate(report.parts, start=1):
        figures.label(axes, part.x, part.y, str(number), size=9.0, taken=boxes)
    keys = [
        figures.Key(layer.colour, f"{layer.label}: {np.count_nonzero(layer.mask) * terrain.point_area:.1f} m²")
        for layer in layers
        if layer.mask.any()
    ]
    keys += [figures.Key(ALERT, "door too narrow for the body, m", "X")] * any(not door.passes for door in doors)
    keys += [figures.Key(PASSES, "door that lets it pass, m", "o")] * any(door.passes for door in doors)
    figures.key_column(figure, axes, shown, keys + _draw_marks(axes, terrain, marks))
    figures.save(figure, out)


def _draw_marks(axes: Axes, terrain: Terrain, marks: Sequence[Mark]) -> list[figures.Key]:
    """Draw outlines, places and names; return their lines of the legend."""
    keys: dict[str, figures.Key] = {}
    for mark in marks:
        colour, sign, above = MARKS[mark.kind], "-", 0.0
        if mark.points is None:
            sign, above = "P", 11.0
            axes.plot(*mark.at, sign, color=colour, markersize=9, markeredgecolor="white", zorder=6)
        else:
            style, above = ("dashed", 12.0) if mark.closes else ("solid", 0.0)  # doors have their widths there
            figures.draw_outline(axes, terrain, mark.points, colors=colour, linewidths=1.8, linestyles=style, zorder=5)
        figures.label(axes, *mark.at, mark.label, colour=colour, size=8.0, above=above)
        keys[mark.kind] = figures.Key(colour, MEANINGS[mark.kind], sign)
    return [keys[kind] for kind in MARKS if kind in keys]


def _draw_door(axes: Axes, door: Door, taken: list[figures.Box]) -> None:
    """Draw a circle as wide as the door, a cross where the body does not pass, and the width."""
    from matplotlib.patches import Circle

    colour = PASSES if door.passes else ALERT
    axes.add_patch(Circle((door.x, door.y), 0.5 * door.width, facecolor=colour, edgecolor=colour, alpha=0.35, zorder=4))
    if door.passes:
        figures.label(axes, door.x, door.y, f"{door.width:.2f}", taken=taken)
        return
    axes.plot(door.x, door.y, marker="X", markersize=7, color=ALERT, markeredgecolor="white", zorder=5)
    figures.label(axes, door.x, door.y, f"{door.width:.2f}", colour=ALERT, above=9.0, taken=taken)


OWN, OURS = "#d55e00", "#0077bb"
FREE_OWN, FREE_OURS, FREE_BOTH = "#f7dcc6", "#cfe3f2", "#eef1f4"

RIM = 5
"""Points around what the maps know."""


def overlay_picture(
    names: tuple[str, str], a: WallMap, b: WallMap, transform: Pose, landmarks: Sequence[Place], out: Path
) -> None:
    """Draw map `a` over map `b`.

    `transform` is the pose of A's frame in B's; the landmarks are places on B.
    """
    sheet = _common_sheet(a, b, transform)
    walls_a, known_a = (_sheet_mask(sheet, a, mask, inverted(transform)) for mask in (a.walls, a.known))
    walls_b, known_b = (_sheet_mask(sheet, b, mask, Pose(0.0, 0.0, 0.0)) for mask in (b.walls, b.known))
    near_a, near_b = grown(walls_a), grown(walls_b)
    common = (walls_a & near_b) | (walls_b & near_a)
    common |= near_a & near_b & ~known_a & ~known_b  # the middle of a thick wall is on neither map
    layers = [
        figures.Layer(FREE_OWN, f"free on {names[0]} only", known_a & ~known_b),
        figures.Layer(FREE_OURS, f"free on {names[1]} only", known_b & ~known_a),
        figures.Layer(FREE_BOTH, "free on both", known_a & known_b),
        figures.Layer(OWN, f"wall of {names[0]} only", walls_a & ~common),
        figures.Layer(OURS, f"wall of {names[1]} only", walls_b & ~common),
        figures.Layer(WALL, "wall of both", common),
    ]
    degrees = math.degrees(transform.heading)
    title = f"{names[0]} on {names[1]}: shifted by ({transform.x:.2f}, {transform.y:.2f}) m, turned by {degrees:.1f}°"
    figure, axes = figures.canvas(sheet, title)
    figures.paint(axes, sheet, figures.painted(sheet.shape, layers))
    for number, (x, y) in enumerate(landmarks, start=1):
        axes.plot(x, y, "o", color=ALERT, markersize=5.0, markeredgecolor="white", zorder=5)
        figures.label(axes, x, y, str(number), colour=ALERT, size=9.0, above=9.0)
    keys = [figures.Key(layer.colour, layer.label) for layer in layers]
    if landmarks:
        keys.append(figures.Key(ALERT, "landmark", "o"))
    figures.key_column(figure, axes, sheet, keys)
    figures.save(figure, out)


def _common_sheet(a: WallMap, b: WallMap, transform: Pose) -> Terrain:
    """Return ground in B's frame that holds all that the maps know, and a rim."""
    known_points = np.concatenate([moved(a.places(a.known), transform), b.places(b.known)])
    low, high = known_points.min(axis=0) - RIM * b.point, known_points.max(axis=0) + RIM * b.point
    width, height = (math.ceil(length / b.point) for length in high - low)
    return Terrain("overlay", np.ones((height, width), dtype=np.bool_), b.point, (float(low[0]), float(low[1])))


def _sheet_mask(sheet: Terrain, one: WallMap, mask: BoolGrid, pose: Pose) -> BoolGrid:
    """Return a mask of a map as the sheet shows it; the pose is that of the sheet's frame in the map's."""
    cols, rows = np.meshgrid(np.arange(sheet.width) + 0.5, np.arange(sheet.height) + 0.5)
    x, y = sheet.origin[0] + cols * sheet.point, sheet.origin[1] + rows * sheet.point
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    col = np.floor((pose.x + cos * x - sin * y - one.origin[0]) / one.point).astype(np.int64)
    row = np.floor((pose.y + sin * x + cos * y - one.origin[1]) / one.point).astype(np.int64)
    inside = (row >= 0) & (row < mask.shape[0]) & (col >= 0) & (col < mask.shape[1])
    return np.asarray(inside & mask[np.where(inside, row, 0), np.where(inside, col, 0)])


BORDER = "#3b5b78"
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
    figure, axes = figures.canvas(terrain, title)
    image = np.empty((*terrain.shape, 3), dtype=np.uint8)
    image[:] = rgb(WALL)
    shades = np.array([rgb(COLOURS[number % len(COLOURS)]) for number in range(max(count, 1))], dtype=np.float64)
    inside, fits = split.labels >= 0, split.parts >= 0
    image[inside] = (255.0 - PALER * (255.0 - shades[split.labels[inside]])).astype(np.uint8)
    image[fits] = shades[split.labels[fits]].astype(np.uint8)
    figures.paint(axes, terrain, image)
    for number, polygon in enumerate(split.polygons):
        _draw_region(axes, number, polygon)
    for link in split.connections:
        axes.plot(link.x, link.y, "o", color=ALERT, markersize=4.0, markeredgecolor="white", zorder=5)
    keys = [
        figures.Key(WALL, "wall, unknown, or kept out of"),
        figures.Key(COLOURS[0], "a region, where the body's centre fits"),
        figures.Key(BORDER, "border of a region", "-"),
        figures.Key(ALERT, f"connecting point ({len(split.connections)})", "o"),
    ]
    figures.key_column(figure, axes, terrain, keys)
    figures.save(figure, out)


def _draw_region(axes: Axes, number: int, polygon: tuple[tuple[float, float], ...]) -> None:
    xs, ys = (np.array(values) for values in zip(*polygon, strict=True))
    axes.fill(xs, ys, fill=False, edgecolor=BORDER, linewidth=0.9, zorder=4)
    left, right = axes.get_xlim()
    if min(np.ptp(xs), np.ptp(ys)) > NAMED * (right - left):
        figures.label(axes, float(xs.mean()), float(ys.mean()), str(number), size=7.0)
