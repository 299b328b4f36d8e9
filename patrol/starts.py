"""The starts of a scenario's robots: at given places, or at random ones in a part of the ground worth patrolling.

Random starts all lie in one part of the free space, the largest. Free space outside a building is no place to patrol
although it is often the largest, so a part that the map's border bounds gives way to an enclosed one, unless that is
less than a tenth of its size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.changing.ground import with_closed
from patrol.errors import BadInput
from patrol.ground.cspace import TOLERANCE, cspace_of, parts_of, planning_radius
from patrol.ground.fields import anchor
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.clearance import nearest
from patrol.maps.fitting import fits_no_door, fits_nowhere, no_room_for_all
from patrol.pose import TAU, Pose, wrap
from patrol.random import Purpose, draw
from patrol.scenario.sections import DEFAULT_RADIUS

if TYPE_CHECKING:
    from patrol.changing.ground import Parts
    from patrol.ground.doors import Door
    from patrol.scenario import RobotSpec

ENCLOSED_SHARE = 0.1
"""An enclosed part is preferred when it has at least this share of the largest part at the border."""

ROOMY_SHARE = 0.9
"""A part that covers this share of the free space it is joined to is no place to be shut in."""

DRAWS = 200
"""Places drawn for a robot before all places that are left are looked at."""

SPACING = 2.0
"""Points that bodies at random starts keep between them."""


def starts_of(roster: Sequence[RobotSpec], seed: int, terrain: Terrain, closable: Parts) -> tuple[Pose, ...]:
    """Place the robots, clear of all ground that closes at times.

    Raises BadInput, which names the part of the ground that takes the room.
    """
    if not closable:
        return tuple(place_starts(terrain, roster, seed))
    try:
        return tuple(place_starts(terrain, roster, seed, with_closed(terrain, closable.values())))
    except BadInput:
        place_starts(terrain, roster, seed)  # raises the same where that ground is not to blame
    number, (largest, points) = max(enumerate(closable.items()), key=lambda part: part[1][1].size)
    robots = sum(not spec.spare for spec in roster)
    fleet = f"{robots} {'robot' if robots == 1 else 'robots'}"
    room = f"no room on {terrain.name} for the starts of {fleet}, which are clear of closures"
    try:
        place_starts(terrain, roster, seed, with_closed(terrain, [points]))
    except BadInput:
        why = f"closures.{number}.polygon: {largest} leaves {room}; make it smaller, or start fewer robots"
    else:
        why = f"closures: together they leave {room}; make some smaller, or start fewer robots"
    raise BadInput(why)


def place_starts(
    terrain: Terrain, roster: Sequence[RobotSpec], seed: int, all_closed: Terrain | None = None
) -> list[Pose]:
    """Choose the starts of the robots, in roster order.

    Explicit starts are checked: the body on the terrain, clear of walls and of the other bodies. The others are drawn,
    headings too, from one part of the widest body's C-space, with two points to spare between bodies: the part that
    holds the first explicit start, or else the preferred one. They are clear of what closes: `all_closed` is the
    ground with all of it closed, None without any. A draw depends on the seed and the robot's number. Spare robots
    are placed last, so that the others start where they would without spare ones that are no wider. A spare robot for
    which there is no room left gets a drawn place all the same, because it waits until no robot stands there.
    """
    placed = _Placed(terrain, max(spec.radius for spec in roster), all_closed)
    for spec in roster:
        if spec.start is not None:
            _check_explicit(terrain, spec, spec.start, placed)
            placed.add(spec.number, spec.start, spec.radius)
    waiting = [spec for spec in roster if spec.start is None]
    if waiting:
        widest = max(spec.radius for spec in waiting)
        first = next((spec.start for spec in roster if spec.start is not None), None)
        part = starting_part(terrain, widest, first)
        if first is None:
            _check_not_shut_in(terrain, widest, part)
        _check_area(terrain, roster, part)
        places = np.flatnonzero(part)
        for spec in sorted(waiting, key=lambda spec: (spec.spare, -spec.radius, spec.number)):
            pose = _place_robot(terrain, spec, seed, places, placed, all_closed)
            if pose is None:
                fleet = sum(not robot.spare for robot in roster)
                why = f"no place is left for a body of radius {spec.radius:g} m after {len(placed.bodies)}"
                raise BadInput(no_room_for_all(terrain, spec.radius, fleet, why))
            placed.add(spec.number, pose, spec.radius)
    return [placed.bodies[spec.number][0] for spec in roster]


class _Placed:
    """The bodies placed so far, and the places that they leave, found without looking at all of them.

    Bodies lie in squares of a side that no two bodies need to keep apart, so only those of nine squares can be too near
    to a place. The places left for bodies of a radius are kept as a grid from the first time that they are needed.
    `bodies` has pose and radius (m) by robot number.
    """

    def __init__(self, terrain: Terrain, widest: float, all_closed: Terrain | None) -> None:
        self.bodies: dict[int, tuple[Pose, float]] = {}
        self._terrain = terrain
        self._all_closed = all_closed
        self._side = 2.0 * widest + SPACING * terrain.point
        self._squares: dict[tuple[int, int], list[int]] = {}
        self._left: dict[float, BoolGrid] = {}

    def add(self, number: int, pose: Pose, radius: float) -> None:
        """Place a body."""
        self.bodies[number] = pose, radius
        self._squares.setdefault(self._square_of(pose.x, pose.y), []).append(number)
        for other_radius, free_cells in self._left.items():
            self._take_places(free_cells, other_radius, pose, radius)

    def near(self, x: float, y: float) -> list[int]:
        """Return the numbers of the bodies that may be too near to a place, as they were placed."""
        col, row = self._square_of(x, y)
        around = ((col + across, row + up) for across in (-1, 0, 1) for up in (-1, 0, 1))
        return [number for square in around for number in self._squares.get(square, ())]

    def is_apart(self, x: float, y: float, radius: float) -> bool:
        """Return True if a body would have its distance from all others."""
        spacing = SPACING * self._terrain.point - TOLERANCE
        for number in self.near(x, y):
            neighbour, other_radius = self.bodies[number]
            if math.hypot(x - neighbour.x, y - neighbour.y) < radius + other_radius + spacing:
                return False
        return True

    def is_full(self, radius: float) -> bool:
        """Return True if `left` is known to return nothing."""
        return radius in self._left and not self._left[radius].any()

    def left(self, radius: float, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the places for a body of some radius, of all those that there are, as flat indices."""
        if radius not in self._left:
            free_cells = np.zeros(self._terrain.shape, dtype=np.bool_)
            free_cells.flat[places] = (
                True if self._all_closed is None else cspace_of(self._all_closed, radius).flat[places]
            )
            for pose, other_radius in self.bodies.values():
                self._take_places(free_cells, radius, pose, other_radius)
            self._left[radius] = free_cells
        return np.flatnonzero(self._left[radius])

    def _square_of(self, x: float, y: float) -> tuple[int, int]:
        return math.floor(x / self._side), math.floor(y / self._side)

    def _take_places(self, left: BoolGrid, radius: float, pose: Pose, other_radius: float) -> None:
        """Take the places from a grid that are too near to a body."""
        terrain = self._terrain
        spaced = other_radius + radius + SPACING * terrain.point
        row0, col0 = terrain.point_at(pose.x - spaced, pose.y - spaced)
        row1, col1 = terrain.point_at(pose.x + spaced, pose.y + spaced)
        rows = np.arange(max(row0, 0), min(row1 + 1, terrain.height))
        cols = np.arange(max(col0, 0), min(col1 + 1, terrain.width))
        xs = terrain.origin[0] + (cols + 0.5) * terrain.point
        ys = terrain.origin[1] + (rows + 0.5) * terrain.point
        far = np.hypot(xs[None, :] - pose.x, ys[:, None] - pose.y) >= spaced - TOLERANCE
        left[max(row0, 0) : row1 + 1, max(col0, 0) : col1 + 1] &= far


def _check_area(terrain: Terrain, roster: Sequence[RobotSpec], part: BoolGrid) -> None:
    """Refuse bodies that, with half their spacing around each, have more area than the ground of `part`.

    Then they cannot all find a place, wherever that is.
    """
    around = 0.5 * SPACING * terrain.point
    fleet = [spec for spec in roster if not spec.spare]
    taken_m2 = sum(math.pi * (spec.radius + around) ** 2 for spec in fleet if spec.start is None)
    if taken_m2 <= np.count_nonzero(part) * terrain.point_area:
        return
    labels, _ = parts_of(terrain.free)
    ground = labels == labels.flat[np.flatnonzero(part)[0]]
    wider = np.pad(ground, 1)
    for axis in (0, 1):  # by a point, as the distance may reach beyond the ground
        wider = wider | np.roll(wider, 1, axis) | np.roll(wider, -1, axis)
    if taken_m2 > np.count_nonzero(wider) * terrain.point_area:
        area_m2 = np.count_nonzero(ground) * terrain.point_area
        needed = f"with the distance that they keep they take {taken_m2:.0f} m²"
        why = f"{needed}, and {area_m2:.0f} m² are free where they start"
        raise BadInput(no_room_for_all(terrain, max(spec.radius for spec in fleet), len(fleet), why))


def starting_part(terrain: Terrain, radius: float, first: Pose | None = None) -> BoolGrid:
    """Return the part of a body's C-space that random starts are drawn from, bool (h, w).

    It is the part at `first`, where the body has one there. BadInput if the body fits nowhere.
    """
    cspace = cspace_of(terrain, radius)
    if not cspace.any():
        raise BadInput(fits_nowhere(terrain, radius, radius == DEFAULT_RADIUS))
    labels, count = parts_of(cspace)
    start_point = None if first is None else anchor(terrain, cspace, first.x, first.y)
    part = preferred_part(terrain, labels, count, radius) if start_point is None else int(labels[start_point])
    mask: BoolGrid = labels == part
    return mask


def preferred_part(terrain: Terrain, labels: NDArray[np.int32], count: int, radius: float) -> int:
    """Return the number of the part where robots start unless the scenario says otherwise.

    `labels` numbers the parts from 1 to `count`.
    """
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    bounded = np.zeros(count + 1, dtype=np.bool_)
    # A part at the border comes as near to it as a centre may.
    beside = math.ceil((planning_radius(radius, terrain.point) - TOLERANCE) / terrain.point - 0.5)
    for line in (labels[beside], labels[-1 - beside], labels[:, beside], labels[:, -1 - beside]):
        bounded[line] = True
    outer = int(np.argmax(np.where(bounded, sizes, 0)))
    inner = int(np.argmax(np.where(bounded, 0, sizes)))
    return inner if sizes[inner] > 0 and sizes[inner] >= ENCLOSED_SHARE * sizes[outer] else outer


def _check_explicit(terrain: Terrain, spec: RobotSpec, start: Pose, placed: _Placed) -> None:
    where = f"robots: start ({start.x:g}, {start.y:g}) of {spec.name}"
    if not terrain.contains(start.x, start.y):
        raise BadInput(f"{where}: not on {terrain.name}, which {terrain.span}")
    clear = clearance_at(terrain, start.x, start.y, spec.radius)
    if clear < spec.radius - TOLERANCE:
        raise BadInput(
            f"{where}: a wall, a keep-out or the edge is {clear:.3g} m away, nearer than the "
            f"radius of {spec.radius:g} m; move it"
        )
    for number in sorted(placed.near(start.x, start.y)):
        other_pose, radius = placed.bodies[number]
        gap = math.hypot(other_pose.x - start.x, other_pose.y - start.y)
        if gap < radius + spec.radius - TOLERANCE:
            raise BadInput(f"{where}: overlaps robot {number}, {gap:.3g} m away; move one")


def clearance_at(terrain: Terrain, x: float, y: float, limit: float) -> float:
    """Return the distance in m from a place to the nearest blocked square or the terrain's edge.

    A larger distance than `limit` reads as that.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    clear = max(min(limit, x - xmin, y - ymin, xmax - x, ymax - y), 0.0)
    row0, col0 = terrain.point_at(x - clear, y - clear)
    row1, col1 = terrain.point_at(x + clear, y + clear)
    row0, col0 = max(row0, 0), max(col0, 0)
    rows, cols = np.nonzero(~terrain.free[row0 : row1 + 1, col0 : col1 + 1])
    if rows.size == 0:
        return clear
    half = 0.5 * terrain.point
    across = np.maximum(np.abs(xmin + (cols + col0) * terrain.point + half - x) - half, 0.0)
    along = np.maximum(np.abs(ymin + (rows + row0) * terrain.point + half - y) - half, 0.0)
    return min(clear, float(np.hypot(across, along).min()))


def _check_not_shut_in(terrain: Terrain, radius: float, part: BoolGrid) -> None:
    """Refuse a body that fits through no door of the rooms around `part`, unless that is nearly all there is."""
    door = _shut_door(terrain, radius, part)
    if door is None:
        return

    def is_let_out(finer: Terrain) -> bool:
        return bool(cspace_of(finer, radius).any()) and _shut_door(finer, radius, starting_part(finer, radius)) is None

    raise BadInput(fits_no_door(terrain, radius, door, radius == DEFAULT_RADIUS, is_let_out))


def _shut_door(terrain: Terrain, radius: float, part: BoolGrid) -> Door | None:
    """Return the widest door around `part` where a body fits through none; None where one lets it out or hardly counts.

    A part that is nearly all there is needs no door.
    """
    labels, _ = parts_of(terrain.free)
    around = labels == labels.flat[np.flatnonzero(part)[0]]
    enough = ROOMY_SHARE * np.count_nonzero(around)
    away = (planning_radius(radius, terrain.point) / terrain.point) ** 2
    covered = np.empty(terrain.shape, dtype=np.int32)
    work = np.empty_like(covered)
    nearest(part.view(np.uint8), around.view(np.uint8), math.isqrt(int(away)), int(away), work, covered)
    if np.count_nonzero(covered >= 0) >= enough:
        return None
    from patrol.ground.doors import Rooms  # here, as few starts need its kernels
    from patrol.kernels.doors import ROOM

    rooms = Rooms(terrain, radius, part)
    doors = rooms.doors()
    if not doors or any(door.passes for door in doors):
        return None
    inside = sum(rooms.areas[leaf] for leaf in np.flatnonzero(rooms.reached & (rooms.nodes[:, ROOM] >= 0)))
    if inside >= enough * terrain.point_area:
        return None
    return doors[-1]


def _place_robot(
    terrain: Terrain, spec: RobotSpec, seed: int, places: NDArray[np.int64], placed: _Placed, all_closed: Terrain | None
) -> Pose | None:
    """Draw a random start clear of what closes and of the bodies placed so far, or None when no place is left."""
    heading = wrap(TAU * draw(seed, Purpose.START, spec.number, 0))
    for attempt in range(1, 1 if placed.is_full(spec.radius) else DRAWS + 1):
        index = places[int(draw(seed, Purpose.START, spec.number, attempt) * places.size)]
        x, y = terrain.centre(*divmod(int(index), terrain.width))
        if placed.is_apart(x, y, spec.radius) and _is_clear(all_closed, x, y, spec.radius):
            return Pose(x, y, heading)
    candidates = placed.left(spec.radius, places)
    if candidates.size == 0:
        if not spec.spare:
            return None
        candidates = places
    row, col = divmod(
        int(candidates[int(draw(seed, Purpose.START, spec.number, DRAWS + 1) * candidates.size)]), terrain.width
    )
    return Pose(*terrain.centre(row, col), heading)


def _is_clear(all_closed: Terrain | None, x: float, y: float, radius: float) -> bool:
    """Return True if a body overlaps nothing that closes."""
    if all_closed is None:
        return True
    from patrol.ground.swept_path import line_is_free  # here: it loads kernels, and on little ground something closes

    return line_is_free(all_closed, (x, y), (x, y), radius)
