"""Random buildings, with openings about as wide as the bodies that are to patrol them.

A building has rooms side by side, along a corridor, or scattered and joined by slanting corridors. In and around its
rooms are pillars, pockets, slits, closets and dead ends. Many stand askew on the grid, so that every wall is a stair.
Results name buildings by their seed, so the same seed, radius and point must give the same building in every version.

`STORED` lists those that are kept as maps; ``python -m tests.random_building`` draws them again.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image

from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.random import Draws
from patrol.scenario import RobotSpec
from patrol.starts import place_starts, starting_part
from tests.chaos.swarm import BUILDINGS, DrawBuilding

LEAST_PART = 0.5
"""Least share of the places where the body fits that are connected with each other."""

LEAST_AREA = 25.0
"""Least area of these places, m2."""

TEAM = 4
"""How many robots there has to be room for, in rooms that they can leave."""

OUTSIDE = 0.5
"""Thickness of the solid border, m."""

MOST_TRIES = 1000
"""Buildings that are drawn at most until one is connected well enough; nearly always fewer than ten."""

Gap = str
"""How wide an opening is: ``wide``, ``fits`` (a few points to spare) or ``narrow`` (a few points too narrow)."""

MAPS = Path(__file__).parents[1] / "examples" / "maps"

STORED = {
    **{MAPS / f"random{seed}.yaml": (seed, 0.3, 0.1) for seed in range(101, 107)},
    **{MAPS / f"random{seed}-radius0.2.yaml": (seed, 0.2, 0.1) for seed in (1, 2)},
    **{MAPS / f"random{seed}-point0.25.yaml": (seed, 0.3, 0.25) for seed in (1, 2, 4, 5, 6, 13)},
    **{
        BUILDINGS / f"point{point}-radius{radius}-{seed}.yaml": (seed, radius, point)
        for point in (0.25, 0.4)
        for radius in (0.3, 0.4)
        for seed in (1, 2, 3)
    },
}
"""Seed, body's radius and point's side of the stored maps: those of results and pages, and those of `check_policy`."""


@dataclass(frozen=True)
class Slab:
    """A rectangle that may lie askew."""

    x: float  # of its middle, m
    y: float  # of its middle, m
    length: float  # along its angle, m
    width: float  # across, m
    angle: float = 0.0  # rad


@dataclass(frozen=True)
class Room:
    """A room without its walls, m."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def slab(self) -> Slab:
        """The room's floor."""
        x, y = self.middle
        return Slab(x, y, self.right - self.left, self.top - self.bottom)

    @property
    def middle(self) -> tuple[float, float]:
        """x and y, m."""
        return 0.5 * (self.left + self.right), 0.5 * (self.bottom + self.top)


@dataclass(frozen=True, eq=False)
class Building:
    """A building on a grid."""

    free: BoolGrid  # (h, w), row 0 at the lowest y
    point: float  # side of a point, m

    @property
    def terrain(self) -> Terrain:
        """The building as a terrain."""
        return Terrain("building", self.free, self.point)

    def write(self, folder: Path, name: str = "building") -> Path:
        """Write the building as a map in ROS map_server's format, and return the map's YAML file.

        The folder must exist.
        """
        Image.fromarray(np.where(self.free[::-1], 254, 0).astype(np.uint8)).save(folder / f"{name}.png", optimize=True)
        path = folder / f"{name}.yaml"
        path.write_text(
            f"image: {name}.png\nresolution: {self.point}\norigin: [0, 0, 0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
            encoding="utf-8",
        )
        return path


def draws_into(folder: Path) -> DrawBuilding:
    """Return what draws a new building for each random scenario, and writes its map into a folder."""

    def draw_building(dice: Draws, radius: float, point: float) -> Path:
        building = random_building(dice.whole(0, 10**6), radius, point)
        return building.write(folder, f"building-{dice.whole(0, 10**9)}")

    return draw_building


def random_building(seed: int, radius: float, point: float) -> Building:
    """Draw a building that a few robots can patrol most of; `radius` and `point` are in m.

    `point` is the side of a point. Raises BadInput if no building was good enough.
    """
    architect = Architect(np.random.default_rng(seed), radius, point)
    robots = [RobotSpec(n, f"r{n}", "holonomic", 1.0, radius, 1.0, None) for n in range(1, TEAM + 1)]
    for _ in range(MOST_TRIES):
        building = architect.building()
        try:
            place_starts(building.terrain, robots, seed)
            part = np.count_nonzero(starting_part(building.terrain, radius))
        except BadInput:
            continue
        fits = np.count_nonzero(cspace_of(building.terrain, radius))
        if part >= LEAST_PART * fits and part * point * point >= LEAST_AREA:
            return building
    raise BadInput(
        f"seed = {seed}, radius = {radius:g}, point = {point:g}: of {MOST_TRIES} buildings none is connected well; "
        "choose another seed, or a smaller body"
    )


class Architect:
    """Draws up one building after the other for a body, from one stream of random numbers."""

    def __init__(self, rng: Generator, radius: float, point: float) -> None:
        """Draw the tilt and the walls that all buildings share; `radius` and `point` (a point's side) are in m."""
        self._rng = rng
        self._point = point
        self._tilt = float(rng.uniform(0.0, 0.5 * math.pi)) if rng.random() < 0.4 else 0.0
        # Of an opening that lies askew on the grid, up to a point and a half is lost.
        self._needed = 2.0 * radius + point * (2.5 if self._tilt else 1.0)
        self._wall = float(rng.uniform(1.0, 2.0)) * max(point, 0.15)
        self._drawn: list[tuple[Slab, bool]] = []

    def building(self) -> Building:
        """A building; no place in it need be connected with another."""
        self._drawn = []
        size = float(self._rng.uniform(10.0, 24.0)), float(self._rng.uniform(8.0, 16.0))
        layout = self._rng.choice(["side by side", "along a corridor", "scattered"])
        if layout == "side by side":
            rooms = self._side_by_side(*size)
        elif layout == "along a corridor":
            rooms = self._along_a_corridor(*size)
        else:
            size = 1.3 * size[0], 1.3 * size[1]
            rooms = self._scatter_rooms(*size)
        for room in rooms:
            self._furnish_room(room)
        return self._on_grid(*size)

    # --- layouts -----------------------------------------------------------------------------------------------------

    def _side_by_side(self, width: float, height: float) -> list[Room]:
        """Rooms that fill a rectangle, with doors in the walls between them."""
        half = 0.5 * self._wall
        parts = list(self._split_room(Room(0.0, 0.0, width, height), float(self._rng.uniform(2.0, 3.5))))
        rooms = [Room(r.left + half, r.bottom + half, r.right - half, r.top - half) for r in parts]
        for room in rooms:
            self._open_slab(room.slab)
        pairs = [(i, j) for j in range(len(rooms)) for i in range(j)]
        self._join_rooms(
            rooms, [pair for pair in pairs if self._shared_wall(rooms[pair[0]], rooms[pair[1]]) is not None]
        )
        return rooms

    def _split_room(self, room: Room, least: float) -> Iterator[Room]:
        across, up = room.right - room.left, room.top - room.bottom
        longer = max(across, up)
        if longer < 2.2 * least or (longer < 3.5 * least and self._rng.random() < 0.15):
            yield room
            return
        offset = float(self._rng.uniform(least, longer - least))
        if across >= up:
            yield from self._split_room(Room(room.left, room.bottom, room.left + offset, room.top), least)
            yield from self._split_room(Room(room.left + offset, room.bottom, room.right, room.top), least)
        else:
            yield from self._split_room(Room(room.left, room.bottom, room.right, room.bottom + offset), least)
            yield from self._split_room(Room(room.left, room.bottom + offset, room.right, room.top), least)

    def _along_a_corridor(self, width: float, height: float) -> list[Room]:
        """Rooms on both sides of a corridor, some of them no more than dead ends."""
        wide = self._gap_width("wide")
        low, high = 0.5 * (height - wide), 0.5 * (height + wide)
        corridor = Room(0.0, low, width, high)
        rooms = [corridor]
        for bottom, top in ((0.0, low - self._wall), (high + self._wall, height)):
            left = 0.0
            while left < width - 2.0:
                dead_end = self._rng.random() < 0.25
                side = self._gap_width("fits") if dead_end else float(self._rng.uniform(2.0, 5.5))
                rooms.append(Room(left, bottom, min(left + side, width), top))
                left += side + self._wall
        for room in rooms:
            self._open_slab(room.slab)
        beside = [(i, j) for j in range(2, len(rooms)) for i in range(1, j) if self._shared_wall(rooms[i], rooms[j])]
        self._join_rooms(rooms, [(0, j) for j in range(1, len(rooms))], beside)
        return rooms

    def _scatter_rooms(self, width: float, height: float) -> list[Room]:
        """Rooms here and there, joined by straight corridors from middle to middle."""
        rooms: list[Room] = []
        for _ in range(100):
            across, up = (float(self._rng.uniform(1.8, 5.0)) for _ in range(2))
            left, bottom = float(self._rng.uniform(0.0, width - across)), float(self._rng.uniform(0.0, height - up))
            room = Room(left, bottom, left + across, bottom + up)
            if all(
                room.left > earlier.right + 1.5
                or earlier.left > room.right + 1.5
                or room.bottom > earlier.top + 1.5
                or earlier.bottom > room.top + 1.5
                for earlier in rooms
            ):
                rooms.append(room)
        for room in rooms:
            self._open_slab(room.slab)
        ways = sorted((math.dist(rooms[i].middle, rooms[j].middle), i, j) for j in range(len(rooms)) for i in range(j))
        for _, i, j in self._spanning_tree(len(rooms), ways):
            self._add_corridor(rooms[i].middle, rooms[j].middle, self._gap_width(self._fitting_gap()))
        for _, i, j in ways[: len(rooms)]:
            if self._rng.random() < 0.2:
                self._add_corridor(rooms[i].middle, rooms[j].middle, self._gap_width(self._any_gap()))
        for room in rooms:
            if self._rng.random() < 0.3:
                away = float(self._rng.uniform(3.0, 6.0))
                angle = float(self._rng.uniform(0.0, math.tau))
                end = room.middle[0] + away * math.cos(angle), room.middle[1] + away * math.sin(angle)
                if 0.0 < end[0] < width and 0.0 < end[1] < height:
                    self._add_corridor(room.middle, end, self._gap_width(self._any_gap()))
        return rooms

    def _open_slab(self, slab: Slab) -> None:
        self._drawn.append((slab, True))

    def _wall_off(self, slab: Slab) -> None:
        self._drawn.append((slab, False))

    # --- openings ----------------------------------------------------------------------------------------------------

    def _any_gap(self) -> Gap:
        return str(self._rng.choice(["wide", "fits", "narrow"]))

    def _fitting_gap(self) -> Gap:
        return str(self._rng.choice(["wide", "fits"]))

    def _gap_width(self, gap: Gap) -> float:
        """The width of an opening, m."""
        if gap == "wide":
            return self._needed * float(self._rng.uniform(1.2, 2.2))
        if gap == "fits":
            return self._needed + self._point * float(self._rng.uniform(0.0, 2.5))
        return max(self._needed - self._point * float(self._rng.uniform(0.5, 3.0)), self._point)

    def _join_rooms(
        self, rooms: Sequence[Room], pairs: Sequence[tuple[int, int]], more: Sequence[tuple[int, int]] = ()
    ) -> None:
        """Put doors that fit the body between as many rooms as it takes to join them, and any doors elsewhere."""
        order = [(float(self._rng.random()), *pair) for pair in pairs]
        tree = {(i, j) for _, i, j in self._spanning_tree(len(rooms), sorted(order))}
        for i, j in (*pairs, *more):
            if (i, j) in tree:
                self._add_door(rooms[i], rooms[j], self._fitting_gap())
            elif self._rng.random() < 0.35:
                self._add_door(rooms[i], rooms[j], self._any_gap())

    @staticmethod
    def _spanning_tree(count: int, ways: Sequence[tuple[float, int, int]]) -> list[tuple[float, int, int]]:
        """The least spanning tree, of ways that are sorted."""
        part = list(range(count))
        tree = []
        for way, i, j in ways:
            if part[i] != part[j]:
                tree.append((way, i, j))
                part = [part[i] if number == part[j] else number for number in part]
        return tree

    def _shared_wall(self, one: Room, other: Room) -> tuple[float, float, float, bool] | None:
        """The wall between two rooms: start, end, its middle line, and whether it is upright; None without one."""
        thick = 1.01 * self._wall
        low, high = max(one.bottom, other.bottom), min(one.top, other.top)
        for left, right in ((one, other), (other, one)):
            if 0.0 <= right.left - left.right <= thick and high - low > self._needed:
                return low, high, 0.5 * (left.right + right.left), True
        low, high = max(one.left, other.left), min(one.right, other.right)
        for below, above in ((one, other), (other, one)):
            if 0.0 <= above.bottom - below.top <= thick and high - low > self._needed:
                return low, high, 0.5 * (below.top + above.bottom), False
        return None

    def _add_door(self, one: Room, other: Room, gap: Gap) -> None:
        border = self._shared_wall(one, other)
        if border is None:
            return
        low, high, line, upright = border
        width = min(self._gap_width(gap), high - low)
        centre = low + 0.5 * width + float(self._rng.random()) * (high - low - width)
        through = 2.0 * self._wall + 2.0 * self._point
        self._open_slab(Slab(line, centre, through, width) if upright else Slab(centre, line, width, through))

    def _add_corridor(self, start: tuple[float, float], end: tuple[float, float], width: float) -> None:
        middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        slanting = self._point * 1.5 * abs(math.sin(2.0 * angle))
        self._open_slab(Slab(*middle, math.dist(start, end) + width, width + slanting, angle))

    # --- furniture ---------------------------------------------------------------------------------------------------

    def _furnish_room(self, room: Room) -> None:
        across, up = room.right - room.left, room.top - room.bottom
        if min(across, up) < 2.0 * self._needed:
            return
        if self._rng.random() < 0.35:
            for _ in range(int(self._rng.integers(1, 4))):
                x, y = self._place_in(room)
                side = float(self._rng.uniform(0.1, 0.6))
                self._wall_off(Slab(x, y, side, side, float(self._rng.uniform(0.0, math.pi))))
        if self._rng.random() < 0.4:
            self._add_pocket(room)
        if self._rng.random() < 0.3:
            self._add_slit(room)
        if self._rng.random() < 0.25:
            self._add_closet(room)
        if self._rng.random() < 0.2:
            x, y = self._place_in(room)
            length = float(self._rng.uniform(0.3, 0.6)) * min(across, up)
            self._wall_off(Slab(x, y, length, self._wall, float(self._rng.uniform(0.0, math.pi))))

    def _place_in(self, room: Room) -> tuple[float, float]:
        return float(self._rng.uniform(room.left, room.right)), float(self._rng.uniform(room.bottom, room.top))

    def _add_pocket(self, room: Room) -> None:
        """A niche in a wall, straight or slanting."""
        x, y = self._place_in(room)
        deep = float(self._rng.uniform(0.3, 1.5))
        width = self._gap_width(self._any_gap())
        angle = float(self._rng.uniform(-0.6, 0.6)) if self._rng.random() < 0.4 else 0.0
        side = int(self._rng.integers(4))
        x = (room.left, room.right, x, x)[side]
        y = (y, y, room.bottom, room.top)[side]
        self._open_slab(Slab(x, y, 2.0 * deep, width, angle + (0.0 if side < 2 else 0.5 * math.pi)))

    def _add_slit(self, room: Room) -> None:
        """A long piece of furniture that leaves a slit along a wall, parallel to it or nearly so."""
        gap, thick = self._gap_width(self._any_gap()), float(self._rng.uniform(0.2, 0.6))
        askew = float(self._rng.uniform(-0.15, 0.15)) if self._rng.random() < 0.5 else 0.0
        away = gap + 0.5 * thick
        x, y = room.middle
        if room.right - room.left >= room.top - room.bottom:
            y = room.bottom + away if self._rng.random() < 0.5 else room.top - away
            self._wall_off(Slab(x, y, 0.5 * (room.right - room.left), thick, askew))
        else:
            x = room.left + away if self._rng.random() < 0.5 else room.right - away
            self._wall_off(Slab(x, y, 0.5 * (room.top - room.bottom), thick, askew + 0.5 * math.pi))

    def _add_closet(self, room: Room) -> None:
        """A box in a corner with a door of any width."""
        side = self._needed + float(self._rng.uniform(0.2, 1.0))
        if min(room.right - room.left, room.top - room.bottom) < 2.5 * side:
            return
        self._wall_off(Slab(room.left + side, room.bottom + 0.5 * side, self._wall, side + self._wall))
        self._wall_off(Slab(room.left + 0.5 * side, room.bottom + side, side + self._wall, self._wall))
        self._open_slab(
            Slab(room.left + side, room.bottom + 0.5 * side, 3.0 * self._wall, self._gap_width(self._any_gap()))
        )

    # --- the grid ----------------------------------------------------------------------------------------------------

    def _on_grid(self, width: float, height: float) -> Building:
        """Return all that was drawn, turned by the building's tilt."""
        cos, sin = math.cos(self._tilt), math.sin(self._tilt)
        span = width * cos + height * sin + 2.0 * OUTSIDE, width * sin + height * cos + 2.0 * OUTSIDE
        cols, rows = (math.ceil(side / self._point) for side in span)
        across = (np.arange(cols) + 0.5) * self._point - 0.5 * span[0]
        up = ((np.arange(rows) + 0.5) * self._point - 0.5 * span[1])[:, None]
        x = across * cos + up * sin + 0.5 * width
        y = up * cos - across * sin + 0.5 * height
        free = np.zeros((rows, cols), dtype=np.bool_)
        for slab, is_free in self._drawn:
            free[_inside_slab(slab, x, y)] = is_free
        free &= (x > 0.0) & (x < width) & (y > 0.0) & (y < height)
        return Building(free, self._point)


def _inside_slab(slab: Slab, x: NDArray[np.float64], y: NDArray[np.float64]) -> BoolGrid:
    cos, sin = math.cos(slab.angle), math.sin(slab.angle)
    along = (x - slab.x) * cos + (y - slab.y) * sin
    across = (y - slab.y) * cos - (x - slab.x) * sin
    inside: BoolGrid = (np.abs(along) <= 0.5 * slab.length) & (np.abs(across) <= 0.5 * slab.width)
    return inside


if __name__ == "__main__":
    for path, (seed, radius, point) in STORED.items():
        random_building(seed, radius, point).write(path.parent, path.stem)
