"""The pursuit of one target: a robot goes to one place until it has seen it, or gives it up.

The paper's robot chooses its direction anew at each tick, from sums over directions that may hardly differ. Between two
rooms with equally stale points it turns round again and again, and sees neither. A committed robot goes to one point,
its target:

- *Commitment*: it keeps the target until half of its age or more has gone, because a robot has seen it.
- *Giving up*: a target that comes no nearer for a while is left out for some time, with its surroundings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping

    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.pose import Command
    from patrol.radio.peers import Peer


LEFT_OUT_S = 20.0
"""Time for which a robot leaves out a target's surroundings, s; doubled each time that it gives them up again."""

LONGEST_S = 960.0
"""Upper bound of the same, s; also how long a robot remembers that it left them out."""

AROUND_RADII = 2.0
"""Radius of a place's surroundings, in radii of the robot."""

MOST_PLACES = 64
"""Places that are left out at a time, or remembered."""

NONE: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)

NO_NEARER_S = 15.0
"""A robot that has come no nearer to its target for so long gives it up, s."""

AT_HAND_S = 3.0
"""The same for a robot that is less than a stride away from where it wanted to be, s; at least `AT_HAND_STEPS`."""

AT_HAND_STEPS = 3

TRIES = 3
"""Number of targets that are tried in one tick, where no way leads to the first ones."""

NEARER = 0.1
"""Least share of a stride by which a way must get shorter to count as progress."""

STILL_STALE = 0.5
"""A target counts as seen once its age is below this share of what it was when it was chosen."""

Point = tuple[int, int]
"""Row and column of the terrain."""


class GivenUp:
    """The places that one robot leaves out."""

    def __init__(self, radius: float, point: float, step: float) -> None:
        # Row, column, the tick until which it is left out, and for how many ticks.
        self.places: list[tuple[int, int, int, int]] = []
        self._around = math.ceil((AROUND_RADII * max(radius, point) / point) ** 2)
        self._least, self._most = (round(bound / step) for bound in (LEFT_OUT_S, LONGEST_S))

    def add(self, tick: int, point: Point) -> None:
        """Leave a point and its surroundings out from now on."""
        remembered = [entry for entry in self.places if tick < entry[2] + self._most]
        before = max((entry[3] for entry in remembered if self._is_beside(entry, point)), default=0)
        spell = min(max(2 * before, self._least), self._most)
        elsewhere = [entry for entry in remembered if not self._is_beside(entry, point)]
        self.places = [*elsewhere, (*point, tick + spell, spell)][-MOST_PLACES:]

    def forgive(self, point: Point) -> None:
        """Forget the places given up around a point."""
        self.places = [entry for entry in self.places if not self._is_beside(entry, point)]

    def clear(self) -> None:
        """Forget everything."""
        self.places = []

    def now(self, tick: int) -> NDArray[np.int64]:
        """Return the places left out at a tick: int64 (n, 3), row, column and squared radius in points."""
        rows = [(row, col, self._around) for row, col, until, _ in self.places if tick < until]
        return np.array(rows, dtype=np.int64).reshape(-1, 3) if rows else NONE

    def covers(self, tick: int, stands: NDArray[np.int64], width: int) -> NDArray[np.bool_]:
        """Return which flat indices lie within the places left out at a tick; ``width`` is that of the terrain."""
        rows, cols = stands // width, stands % width
        out = np.zeros(stands.shape, dtype=np.bool_)
        for row, col, squared in self.now(tick).tolist():
            out |= (rows - row) ** 2 + (cols - col) ** 2 <= squared
        return out

    def _is_beside(self, place: tuple[int, int, int, int], point: Point) -> bool:
        """Return True if a point belongs to the surroundings of one that was given up."""
        return (place[0] - point[0]) ** 2 + (place[1] - point[1]) ** 2 <= self._around


@dataclass(frozen=True, slots=True)
class Leg:
    """A piece of a way that was planned."""

    spot: Spot  # its end, x and y in m
    step: Command | None  # the first one, where the robot is on the way
    others: Mapping[int, Peer] | None  # where other robots are now; None for where they were heard
    heading: float | None = None  # in which a robot looks that looks elsewhere than it goes, rad


@dataclass(frozen=True, slots=True)
class Target:
    """A place that a robot goes to see."""

    point: Point
    stand: Point  # the point to go to: the same, or its post where no body fits
    age: int  # of the point when it was chosen, ticks; 0 for a place that is only passed
    free: bool = False  # chosen freely, not on a round or from a plan
    leg: Leg | None = None  # of the plan
    heading: float | None = None  # in which the point is seen from its stand, rad; None: towards the point, or any


class Pursuit:
    """The target of one robot, how it comes nearer to it, and the places given up."""

    def __init__(self, setup: PolicySetup) -> None:
        spec, point, step = setup.robot.spec, setup.ground.terrain.point, setup.fleet.step
        self.target: Target | None = None
        self.given_up = GivenUp(spec.radius, point, step)
        self._step = step
        self._point = point
        self._nearer_m = NEARER * spec.speed * step
        self._at_hand_s = max(AT_HAND_S, AT_HAND_STEPS * step)
        self._expected = 0  # length of the way, and a little more, in hundredths of a point
        self._shortest_m = math.inf
        self._least_age = 0
        self._progress_at = 0

    def keep(self, view: View, start: Element) -> Way | None:
        """Return the way to the present target; None without a target, or if it is time for another."""
        target = self.target
        if target is None:
            return None
        age = age_of(view, target.point)
        if target.age == 0 or age < STILL_STALE * target.age:
            self.given_up.forgive(target.stand)
            return None
        way = self._way_to(view, start, target.stand, self._expected)
        if way is None:
            return None
        if way.length < self._shortest_m - self._nearer_m or age < self._least_age:
            # A look that leaves some of a point's age is progress as well.
            self._shortest_m, self._progress_at = min(self._shortest_m, way.length), view.tick
        self._least_age = age
        stood_s = (view.tick - self._progress_at) * self._step
        if stood_s > (self._at_hand_s if way.length <= view.stride else NO_NEARER_S):
            self.given_up.add(view.tick, target.stand)
            return None
        return way

    def go_to(self, view: View, start: Element, target: Target, expected: int = 0) -> Way | None:
        """Commit to a target and return the way there, or None if no way leads there now.

        ``expected`` is a likely length of the way, in hundredths of a point.
        """
        way = self._way_to(view, start, target.stand, expected)
        if way is not None:
            self.target = target
            self._shortest_m, self._least_age, self._progress_at = math.inf, target.age, view.tick
        return way

    def rest(self, tick: int) -> None:
        """Do not count the time until now as time without progress: the robot waits."""
        self._progress_at = tick

    def _way_to(self, view: View, start: Element, stand: Point, expected: int) -> Way | None:
        way = view.routes.way(start, (stand[0] + 1, stand[1] + 1), expected)
        if way.place != view.place_of(stand):
            return None
        self._expected = round(100.0 * (way.length + 2.0 * view.stride) / self._point)
        return way


def age_of(view: View, point: Point) -> int:
    """Return the believed age of a point, ticks."""
    return view.tick - max(view.fog.last_seen.item(point), 0)
