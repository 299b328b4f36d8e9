"""Doors of maps as closures that open and close at random, for tests and measurements."""

import math
from typing import Any

import numpy as np

from patrol.ground.doors import Door, Rooms
from patrol.ground.terrain import Terrain
from patrol.prepare import Prepared

WIDEST_M = 3.0
"""Wider places between two parts of the ground are no doors."""

THICK_M = 0.3
"""Thickness of a door that is closed."""


def door_polygon(terrain: Terrain, door: Door) -> list[list[float]]:
    """A strip across a door, from wall to wall."""
    half = 0.5 * door.width + 1.5 * terrain.point
    for angle in np.arange(12) * math.pi / 12.0:
        across, up = math.cos(angle), math.sin(angle)
        ends = [terrain.point_at(door.x + side * across * half, door.y + side * up * half) for side in (-1.0, 1.0)]
        if all(not terrain.inside(*end) or not terrain.free[end] for end in ends):
            thick = 0.5 * THICK_M
            corners = ((-half, -thick), (half, -thick), (half, thick), (-half, thick))
            return [[door.x + a * across - b * up, door.y + a * up + b * across] for a, b in corners]
    return [[door.x + a * half, door.y + b * half] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def doors_of(prepared: Prepared) -> list[list[list[float]]]:
    """The polygons of a scenario's doors in the ground that its first robot gets to, clear of all starts."""
    spec = prepared.scenario.roster[0]
    rooms = Rooms(prepared.terrain, spec.radius, prepared.fields[spec.number].reach)
    found = [door for door in rooms.doors() if door.passes and door.width <= WIDEST_M]
    clear = 1.0 + spec.radius
    return [
        door_polygon(prepared.terrain, door)
        for door in found
        if all(math.hypot(start.x - door.x, start.y - door.y) > door.width + clear for start in prepared.starts)
    ]


def some_doors(prepared: Prepared, share: float, seed: int, closes: float, opens: float) -> list[dict[str, Any]]:
    """A share of a scenario's doors, chosen at random, as closures that close and open at rates per second."""
    doors = doors_of(prepared)
    chosen = np.random.default_rng(seed).permutation(len(doors))[: max(1, round(share * len(doors)))]
    return [
        {"name": f"door-{number}", "polygon": doors[number], "closes": closes, "opens": opens}
        for number in sorted(chosen.tolist())
    ]
