"""The ground that robots can see with what is in their way now, and the ages of points while they were open to view.

A point is *closed out* while no robot gets to a place from which it could be seen, and one would with nothing closed
and no wreck in its way. For example, when the door of a room closes behind all robots, or one of them dies in it, the
room is closed out until the door opens or the wreck is removed, but for what is in sight through a gap or a window;
while one robot is inside, it is not.

The *open age* of a point counts the ticks since it was last seen in which it was not closed out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.cspace import cspace_of, parts_of, planning_radius
from patrol.ground.fields import anchor, proxies_of
from patrol.ground.shapes import points_near
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import Status

if TYPE_CHECKING:
    from patrol.journal.records import RobotTick

Place = tuple[float, float]
"""x and y in m."""

NEVER_OUT = -1

STANDING = Status.PAUSED, Status.DEAD, Status.LOST
"""The statuses of a robot whose body stands somewhere without a driver, unless it is removed."""


class OpenGround:
    """The ground that each robot can get to and see, tick by tick.

    `closed_out` marks the patrolled points that are closed out now; without robots there are none. A robot changes the
    part of the ground that it is in only when something closes or opens, when another one becomes a wreck, when it
    appears, or when it gets past a wreck, which bars nothing from then on. So nothing is computed in other ticks.
    """

    def __init__(
        self, terrain: Terrain, patrolled: BoolGrid, radii: Mapping[int, float], range_m: float, line_of_sight: bool
    ) -> None:
        """Begin with nothing closed; `radii` are the robots' by number, m, and the last two those of their sensor."""
        self._terrain, self._patrolled, self._radii = terrain, patrolled, radii
        self._sensor = range_m, line_of_sight
        self.closed_out: BoolGrid = np.zeros(terrain.shape, dtype=np.bool_)
        self._known: tuple[object, ...] | None = None
        self._passed: set[tuple[int, Place]] = set()  # the wrecks that stood where a robot got past one
        self._labels: dict[float, NDArray[np.int32]] = {}  # the parts of the ground now, by radius
        self._parts: dict[int, int] = {}  # the part that each robot is in, by number
        self._beside: set[int] = set()  # the robots that stood where no centre may be, such as beside a wreck
        self._out: dict[int, BoolGrid] = {}
        self._last_out: dict[int, NDArray[np.int32]] = {}

    def tick(
        self,
        k: int,
        terrain: Terrain,
        closed: Collection[str],
        places: Mapping[int, Place],
        wrecks: Mapping[int, Place],
    ) -> None:
        """Take in a tick: the ground as it is now, and the names of closed parts.

        Of the robots in the world, `places` has those that are driven, and `wrecks` the others: dead, lost or paused.
        """
        state = frozenset(closed), frozenset(places), frozenset(wrecks.items())
        if state == self._known:
            moved = set() if self._passed.issuperset(wrecks.items()) else self._find_moved(places)
            if not moved:
                return
            # On which side of a wreck a robot is that stands right beside it shows only later.
            if not moved <= self._beside:
                self._passed.update(wrecks.items())
        self._known = state
        wrecks = {number: place for number, place in wrecks.items() if (number, place) not in self._passed}
        # Robots that could get to the same ground share their grids: there may be a thousand.
        grids: dict[tuple[int, int], NDArray[np.int32]] = {}
        for number, out in self._out.items():
            last_out = self._last_out.get(number)
            if (question := (id(last_out), id(out))) not in grids:
                # The state ended with the tick before this one.
                before = np.int32(NEVER_OUT) if last_out is None else last_out
                grids[question] = np.where(out, np.int32(k - 1), before)
            self._last_out[number] = grids[question]
        self._out = {}
        if not closed and not wrecks:
            self.closed_out = np.zeros(terrain.shape, dtype=np.bool_)
            return
        would, visible = self._visible_ground(self._terrain, places), self._visible_ground(terrain, places, wrecks)
        outs: dict[tuple[int, int], BoolGrid] = {}
        for number in places:
            if (pair := (id(would[number]), id(visible[number]))) not in outs:
                outs[pair] = self._patrolled & would[number] & ~visible[number]
            self._out[number] = outs[pair]
        nobody = np.zeros(terrain.shape, dtype=np.bool_)
        self.closed_out = np.logical_or.reduce([nobody, *outs.values()])
        # Closed out for one robot, but another still sees it.
        self.closed_out &= ~np.logical_or.reduce([nobody, *{id(seen): seen for seen in visible.values()}.values()])

    def last_seen_or_out(self, number: int, k: int, last_seen: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the tick in which a robot last had no reason to go and see each point, int32 (height, width).

        That is when the point was last seen or, if later, when the robot could not get to see it; `k` is now.
        """
        last_out, out = self._last_out.get(number), self._out.get(number)
        grid = last_seen if last_out is None else np.maximum(last_seen, last_out)
        return grid if out is None else np.where(out, np.int32(k), grid)

    def shut_in(self) -> list[int]:
        """Return the numbers of the robots that can get to see less than half of the patrolled ground, ascending."""
        half = 0.5 * np.count_nonzero(self._patrolled)
        return sorted(number for number, out in self._out.items() if np.count_nonzero(out) > half)

    def _visible_ground(
        self, terrain: Terrain, places: Mapping[int, Place], wrecks: Mapping[int, Place] | None = None
    ) -> dict[int, BoolGrid]:
        """Return the points that each robot can get to and see, by number."""
        labels: dict[float, tuple[BoolGrid, NDArray[np.int32]]] = {}
        parts: dict[tuple[float, int], BoolGrid] = {}
        visible = {}
        for number, place in places.items():
            radius = self._radii[number]
            if radius not in labels:
                cspace = cspace_of(terrain, radius)
                # Robots have no sensor for a wreck, so they know its place only about, and keep a point off it.
                needed_m = planning_radius(radius, terrain.point) + terrain.point
                for other, at in (wrecks or {}).items():
                    cspace = cspace & ~points_near(terrain, at, needed_m + self._radii[other])
                labels[radius] = cspace, parts_of(cspace)[0]
            cspace, labelled = labels[radius]
            joined = anchor(terrain, cspace, *place)
            part = 0 if joined is None else int(labelled[joined])
            if (radius, part) not in parts:
                reach = (labelled == part) & cspace
                proxy = proxies_of(terrain, reach, *self._sensor)
                parts[radius, part] = reach | (proxy >= 0)
            visible[number] = parts[radius, part]
            self._parts[number] = part
        self._labels = {radius: labelled for radius, (_, labelled) in labels.items()}
        self._beside = {number for number, place in places.items() if self._label(number, place) == 0}
        return visible

    def _find_moved(self, places: Mapping[int, Place]) -> set[int]:
        """Return the robots that are in another part of the ground than when it was computed last."""
        return {
            number for number, place in places.items() if self._label(number, place) not in (0, self._parts[number])
        }

    def _label(self, number: int, place: Place) -> int:
        """Return the part of the ground that a place is in; 0 where the robot's centre may not be."""
        return int(self._labels[self._radii[number]][self._terrain.nearest_point(*place)])


def by_driver(rows: Iterable[RobotTick]) -> tuple[dict[int, Place], dict[int, Place]]:
    """Return the places of the robots that are driven, and of those that stand without a driver, by number."""
    driven, standing = dict[int, Place](), dict[int, Place]()
    for row in rows:
        if row.status is Status.ALIVE:
            driven[row.number] = row.x, row.y
        elif row.status in STANDING:
            standing[row.number] = row.x, row.y
    return driven, standing


class OpenAges:
    """The ages of points while they were open to view."""

    def __init__(self, patrolled: BoolGrid) -> None:
        self.points = np.flatnonzero(patrolled)  # flat indices
        self.now: NDArray[np.int32] = np.zeros(self.points.size, dtype=np.int32)  # by point, ticks
        self._out = np.zeros_like(self.now)
        self.greatest: list[int] = []  # in each tick, ticks
        self.closed_share: list[float] = []  # of the patrolled ground, in each tick

    def tick(self, k: int, closed_out: BoolGrid, last_seen: NDArray[np.int32]) -> None:
        """Take in a tick after its observations; `closed_out` is that of `OpenGround`."""
        out = closed_out.reshape(-1)[self.points]
        ages = k - np.maximum(last_seen.reshape(-1)[self.points], 0)
        self._out += out
        # A point in view counts anew, even if it was closed out before.
        self._out[ages == 0] = 0
        self.now = np.maximum(ages - self._out, 0)
        self.greatest.append(int(self.now.max()))
        self.closed_share.append(float(np.mean(out)))
