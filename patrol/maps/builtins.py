"""The built-in terrains: reconstructions of those that the paper patrols, whose figures are lost.

What is known of the originals is their size and a few words: a field without obstacles of 100 x 88 m (section
"Patrolling of an area without obstacles"), one of that size which falls into 5 convex regions (figure 1), one of
118 x 118 m with more obstacles (figure 2) and the model of a real site of 240 x 160 m (figure 3). Everything else here
is invented; the layouts are open enough for bodies of 1 m radius that cannot turn tighter than 3.5 m.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from patrol.errors import BadInput
from patrol.ground.shapes import Polygon, cover
from patrol.ground.terrain import MAX_POINTS, Terrain, whole_points


@dataclass(frozen=True, slots=True)
class Layout:
    """A terrain in metres: a rectangle with its lower left corner at (0, 0), and the obstacles in it."""

    width: float
    height: float
    obstacles: tuple[Polygon, ...]
    about: str


def builtin_terrain(name: str, point: float) -> Terrain:
    """Return a built-in terrain, a key of `LAYOUTS`, as a grid whose lower left corner is at (0, 0).

    A point that shares some area with an obstacle is impassable.
    """
    if name not in LAYOUTS:
        raise BadInput(f"terrain.builtin = {name}: no such terrain; known are {', '.join(LAYOUTS)}")
    layout = LAYOUTS[name]
    height = whole_points(layout.height, point)
    width = whole_points(layout.width, point)
    if height * width > MAX_POINTS:
        raise BadInput(f"point = {point:g}: gives {name} more than {MAX_POINTS} points; choose a larger point")
    passable = np.ones((height, width), dtype=np.bool_)
    for obstacle in layout.obstacles:
        passable &= ~cover(obstacle, passable.shape, point, (0.0, 0.0))
    if not passable.any():
        raise BadInput(f"point = {point:g}: leaves no free point on {name}; choose a smaller point")
    return Terrain(name, passable, point)


def _box_polygon(left: float, low: float, right: float, high: float) -> Polygon:
    return ((left, low), (right, low), (right, high), (left, high))


def _tank_polygon(x: float, y: float, radius: float) -> Polygon:
    """Return a round tank as an octagon."""
    # Odd eighths of half a circle, so that the octagon has sides along the axes.
    turns = [math.pi * (2 * corner + 1) / 8 for corner in range(8)]
    return tuple((x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns)


def _open_layout() -> Layout:
    return Layout(100.0, 88.0, (), "no obstacles")


def _yards_layout() -> Layout:
    """Five yards side by side between wedge-shaped buildings: 5 convex regions, and no fewer will do.

    Each wedge ends in a corner so sharp that only a cut that prolongs the wedge leaves both its sides convex; no cut
    serves two of the four. How far the wedges reach was chosen by the paper's one robot (Table 4, wave and mode).
    """
    reach, half = 48.0, 4.5
    from_below = tuple(((x - half, 0), (x + half, 0), (x, reach)) for x in (20.0, 60.0))
    from_above = tuple(((x - half, 88), (x, 88 - reach), (x + half, 88)) for x in (40.0, 80.0))
    return Layout(100.0, 88.0, (*from_below, *from_above), "five yards between wedge-shaped buildings")


def _clutter_layout() -> Layout:
    """Small buildings scattered without order; the gaps between them are 6 m and more."""
    obstacles: tuple[Polygon, ...] = (
        ((78.5, 41.5), (68.5, 41.5), (68.5, 29.5), (78.5, 29.5)),
        ((60, 36.5), (53, 36.5), (53, 27.5), (60, 27.5)),
        ((76.5, 100.5), (66.5, 100.5), (66.5, 89.5), (76.5, 89.5)),
        ((25.5, 76), (8.5, 76), (8.5, 71), (20.5, 71), (20.5, 65), (25.5, 65)),
        ((50.5, 65), (54.5, 74), (44.5, 78.5), (40.5, 69.5)),
        ((67, 80), (61, 80), (61, 73), (67, 73)),
        ((110.5, 80.5), (101.5, 80.5), (101.5, 64.5), (110.5, 64.5)),
        ((39, 83), (36.5, 87.5), (31.5, 87.5), (29, 83), (31.5, 79), (36.5, 79)),
        ((66.5, 13), (60, 17.5), (55.5, 11), (62, 6.5)),
        ((96.5, 11), (96.5, 20), (86.5, 20), (86.5, 11)),
        ((112, 88), (112, 94), (101, 94), (101, 88)),
        ((96, 37.5), (93.5, 41.5), (89.5, 41.5), (87, 37.5), (89.5, 33.5), (93.5, 33.5)),
        ((46, 47.5), (36, 47.5), (36, 34.5), (46, 34.5)),
        ((85.5, 60.5), (80.5, 69), (72, 64), (77, 55.5)),
        ((49.5, 100), (49.5, 111), (37.5, 111), (37.5, 100)),
        ((30, 24.5), (24, 28.5), (19, 21.5), (24.5, 17.5)),
        ((11.5, 39.5), (26.5, 39.5), (26.5, 45.5), (17.5, 45.5), (17.5, 50.5), (11.5, 50.5)),
        ((25.5, 103.5), (23.5, 108), (18.5, 108), (16, 103.5), (18.5, 99.5), (23.5, 99.5)),
        ((92, 100), (92, 107), (84, 107), (84, 100)),
        ((110, 21), (108.5, 24), (104.5, 24), (103, 21), (104.5, 18), (108.5, 18)),
        ((65, 58), (58.5, 62.5), (53, 55), (59.5, 50.5)),
        ((98.5, 52.5), (96.5, 56), (92.5, 56), (90.5, 52.5), (92.5, 49), (96.5, 49)),
        ((48.5, 8), (48.5, 14), (36.5, 14), (36.5, 8)),
        ((20.5, 87.5), (18.5, 90.5), (15, 90.5), (13.5, 87.5), (15, 84.5), (18.5, 84.5)),
        ((88, 76.5), (88, 84.5), (82, 84.5), (82, 76.5)),
        ((57, 89), (55, 92.5), (51, 92.5), (49, 89), (51, 85.5), (55, 85.5)),
        ((79.5, 18), (77.5, 21), (74, 21), (72, 18), (74, 15), (77.5, 15)),
        ((41, 58), (39, 61.5), (35, 61.5), (33, 58), (35, 54.5), (39, 54.5)),
        ((110, 32.5), (110, 42.5), (104, 42.5), (104, 32.5)),
        ((14.5, 8), (14.5, 16), (8.5, 16), (8.5, 8)),
        ((14, 57.5), (14, 63.5), (7, 63.5), (7, 57.5)),
        ((109.5, 104.5), (107.5, 108), (103, 108), (101, 104.5), (103, 101), (107.5, 101)),
    )
    return Layout(118.0, 118.0, obstacles, "32 small buildings without order")


def _site_layout() -> Layout:
    """A works: halls and warehouses along roads 8 m wide and wider, an office around an open court, yards, tanks."""
    obstacles: tuple[Polygon, ...] = (
        # South-west: three workshops side by side.
        _box_polygon(10, 10, 60, 26),
        _box_polygon(10, 34, 60, 50),
        _box_polygon(10, 58, 46, 74),
        # South: the assembly hall with its wing, and beside the yard north of it a store.
        ((72, 8), (142, 8), (142, 32), (94, 32), (94, 50), (72, 50)),
        _box_polygon(58, 60, 82, 76),
        # South-east: warehouses.
        _box_polygon(158, 8, 180, 60),
        _box_polygon(194, 8, 230, 30),
        _box_polygon(194, 40, 230, 62),
        # In the middle: the yard's kiosk and transformer, and a hall along the slanted road.
        _box_polygon(110, 54, 120, 62),
        _box_polygon(136, 58, 144, 70),
        ((92, 104), (128, 84), (137, 100), (101, 120)),
        # North-west: the office around a court that opens to the south.
        ((14, 90), (30, 90), (30, 134), (60, 134), (60, 90), (74, 90), (74, 150), (14, 150)),
        # North: archive.
        _box_polygon(88, 134, 150, 150),
        # North-east: laboratories, tank farm, boiler house.
        ((166, 98), (226, 98), (226, 114), (186, 114), (186, 148), (166, 148)),
        _tank_polygon(176, 78, 6.5),
        _tank_polygon(197, 80, 6.5),
        _tank_polygon(218, 80, 6.5),
        _box_polygon(198, 126, 224, 148),
    )
    return Layout(240.0, 160.0, obstacles, "a works of buildings, roads between them and open yards")


def _make_layouts() -> dict[str, Layout]:
    makers: dict[str, Callable[[], Layout]] = {
        "open": _open_layout,
        "yards": _yards_layout,
        "clutter": _clutter_layout,
        "site": _site_layout,
    }
    return {name: make() for name, make in makers.items()}


LAYOUTS = _make_layouts()
