"""The ground that robots can see with what is closed now, and the ages of points while they were open to view.

A point is *closed out* while no robot gets to a place from which it could be seen, and one would with nothing closed.
For example, when the door of a room closes behind all robots, the room is closed out until the door opens, but for what
is in sight through a gap or a window; while one robot is inside, it is not.

The *open age* of a point counts the ticks since it was last seen in which it was not closed out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.fields import anchor, proxies_of
from patrol.ground.terrain import BoolGrid, Terrain

if TYPE_CHECKING:
    from patrol.prepare import Prepared

Place = tuple[float, float]
"""x and y in m."""

NEVER_OUT = -1


class OpenGround:
    """The ground that each robot can get to and see, tick by tick.

    A robot changes the part of the ground that it is in only when something closes or opens, or when it appears. So
    nothing is computed in other ticks.

    Attributes:
        closed_out: bool (height, width), the patrolled points that no robot can get to and see, and one could with
            nothing closed. Without robots there are none.
    """

    def __init__(self, prepared: Prepared) -> None:
        """Begin with nothing closed.

        Args:
            prepared: The scenario, its terrain and the bodies' static fields.
        """
        self._prepared = prepared
        self.closed_out: BoolGrid = np.zeros(prepared.terrain.shape, dtype=np.bool_)
        self._known: tuple[frozenset[str], frozenset[int]] | None = None
        self._out: dict[int, BoolGrid] = {}
        self._last_out: dict[int, NDArray[np.int32]] = {}

    def tick(self, k: int, terrain: Terrain, closed: Collection[str], places: Mapping[int, Place]) -> None:
        """Take in a tick.

        Args:
            k: The tick.
            terrain: The ground as it is now.
            closed: Names of the closures that are closed.
            places: x and y in m of the robots that are driven, by number.
        """
        now = frozenset(closed), frozenset(places)
        if now == self._known:
            return
        self._known = now
        for number, out in self._out.items():
            last_out = self._last_out.setdefault(number, np.full(out.shape, NEVER_OUT, dtype=np.int32))
            last_out[out] = k - 1
        self._out = {}
        if not closed:
            self.closed_out = np.zeros(terrain.shape, dtype=np.bool_)
            return
        patrolled = self._prepared.patrolled
        would, seen = self._seen(self._prepared.terrain, places), self._seen(terrain, places)
        self._out = {number: patrolled & would[number] & ~seen[number] for number in places}
        nobody = np.zeros(terrain.shape, dtype=np.bool_)
        self.closed_out = np.logical_or.reduce([nobody, *self._out.values()])
        self.closed_out &= ~np.logical_or.reduce([nobody, *seen.values()])

    def last_seen_or_out(self, number: int, k: int, last_seen: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return when a robot last had no reason to go and see each point, int32 (height, width).

        Args:
            number: Of the robot.
            k: Now.
            last_seen: int32 (height, width), when each point was last seen.

        Returns:
            The later one of when the point was seen and when the robot could not get to see it.
        """
        last_out, out = self._last_out.get(number), self._out.get(number)
        grid = last_seen if last_out is None else np.maximum(last_seen, last_out)
        return grid if out is None else np.where(out, np.int32(k), grid)

    def shut_in(self) -> list[int]:
        """Return the numbers of the robots that can get to see less than half of the patrolled ground, ascending."""
        half = 0.5 * np.count_nonzero(self._prepared.patrolled)
        return sorted(number for number, out in self._out.items() if np.count_nonzero(out) > half)

    def _seen(self, terrain: Terrain, places: Mapping[int, Place]) -> dict[int, BoolGrid]:
        """Return what each robot can get to and see, by number."""
        scenario = self._prepared.scenario
        labels: dict[float, tuple[BoolGrid, NDArray[np.int32]]] = {}
        parts: dict[tuple[float, int], BoolGrid] = {}
        seen = {}
        for number, place in places.items():
            radius = scenario.roster[number - 1].radius
            if radius not in labels:
                cspace = cspace_of(terrain, radius)
                labels[radius] = cspace, parts_of(cspace)[0]
            cspace, labelled = labels[radius]
            joined = anchor(terrain, cspace, *place)
            part = 0 if joined is None else int(labelled[joined])
            if (radius, part) not in parts:
                reach = (labelled == part) & cspace
                proxy = proxies_of(terrain, reach, scenario.sensor.range, scenario.sensor.line_of_sight)
                parts[radius, part] = reach | (proxy >= 0)
            seen[number] = parts[radius, part]
        return seen


class OpenAges:
    """The ages of points while they were open to view.

    Attributes:
        points: int64 (points,), flat indices of the points that count.
        now: int32 (points,), their open ages in the last tick, ticks.
        greatest: The greatest open age in each tick, ticks.
        closed_share: Share of the patrolled ground that is closed out, in each tick.
    """

    def __init__(self, patrolled: BoolGrid) -> None:
        """Begin before the first tick.

        Args:
            patrolled: bool (height, width), the points that count.
        """
        self.points = np.flatnonzero(patrolled)
        self.now: NDArray[np.int32] = np.zeros(self.points.size, dtype=np.int32)
        self._out = np.zeros_like(self.now)
        self.greatest: list[int] = []
        self.closed_share: list[float] = []

    def tick(self, k: int, closed_out: BoolGrid, last_seen: NDArray[np.int32]) -> None:
        """Take in a tick after its observations.

        Args:
            k: The tick.
            closed_out: bool (height, width), of `OpenGround`.
            last_seen: int32 (height, width), when each point was last seen.
        """
        out = closed_out.reshape(-1)[self.points]
        ages = k - np.maximum(last_seen.reshape(-1)[self.points], 0)
        self._out += out
        self._out[ages == 0] = 0
        self.now = np.maximum(ages - self._out, 0)
        self.greatest.append(int(self.now.max()))
        self.closed_share.append(float(np.mean(out)))
