"""The picture of one map on another: the walls of each in a colour of its own, and of both in a third."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fogwatch.grounds.map_align import Place, WallMap, moved
from monitor.figures.ground import Key, Layer, canvas, key_column, label, paint, painted, save
from patrol.ground.cspace import grown
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.palette import LIGHT, WALL
from patrol.pose import Pose
from ros2.wire.frames import inverted

OWN, OURS = "#d55e00", "#0077bb"
FREE_OWN, FREE_OURS, FREE_BOTH = "#f7dcc6", "#cfe3f2", "#eef1f4"
LANDMARK = LIGHT["alert"]

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
        Layer(FREE_OWN, f"free on {names[0]} only", known_a & ~known_b),
        Layer(FREE_OURS, f"free on {names[1]} only", known_b & ~known_a),
        Layer(FREE_BOTH, "free on both", known_a & known_b),
        Layer(OWN, f"wall of {names[0]} only", walls_a & ~common),
        Layer(OURS, f"wall of {names[1]} only", walls_b & ~common),
        Layer(WALL, "wall of both", common),
    ]
    degrees = math.degrees(transform.heading)
    title = f"{names[0]} on {names[1]}: shifted by ({transform.x:.2f}, {transform.y:.2f}) m, turned by {degrees:.1f}°"
    figure, axes = canvas(sheet, title)
    paint(axes, sheet, painted(sheet.shape, layers))
    for number, (x, y) in enumerate(landmarks, start=1):
        axes.plot(x, y, "o", color=LANDMARK, markersize=5.0, markeredgecolor="white", zorder=5)
        label(axes, x, y, str(number), colour=LANDMARK, size=9.0, above=9.0)
    keys = [Key(layer.colour, layer.label) for layer in layers]
    if landmarks:
        keys.append(Key(LANDMARK, "landmark", "o"))
    key_column(figure, axes, sheet, keys)
    save(figure, out)


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
