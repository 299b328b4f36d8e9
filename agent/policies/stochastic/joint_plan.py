"""A plan for the whole fleet that every robot works out for itself, and in which each next station is drawn.

No robot says where it is going. All believe nearly the same fog, hear where the others are, and draw the same numbers,
so each can work out what *all* will do, and take its own part:

- *Stations* (`patrol.ground.tour.stations`) are to be visited, each by one robot.
- A *plan* is a route for each robot; together they visit every station. It costs the sum of the eighth powers of the
  stations' ages when they are visited. So old stations weigh most, and no station is put off for ever.
- *The draw*: once a robot has seen its station, the plans are compared in which it goes to each of the near ones next.
  Each is improved by small moves (`agent.policies.stochastic.kernels.plan`). One is drawn; the less it is behind the
  best, the likelier.
- *Beginning anew*: at the begin of a period, and whenever other robots are heard, all plan from where the robots are.
  So robots that have believed different things agree again.

For example, the best plan costs 40.0 s (the root of its cost) and begins with the first of three stations; with the
second one first it would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38 and
0 %. So the ground stays fresh, and an intruder that has watched for long is left to guess where the robot turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from hashlib import blake2b
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policies.commitment.commitment import Target
from agent.policies.commitment.stands import RoundStands
from agent.policies.stochastic.kernels.ages import weighted_ages
from agent.policies.stochastic.kernels.plan import compare, improve
from patrol.kernels.elementary import exp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from agent.policies.commitment.given_up import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.ground.tour.round import Round
    from patrol.ground.tour.stations import Stations

SPREAD = 0.28
"""Cost by which a plan may be behind the best one to be drawn 1/e times as often, as a share of the time between two
robots on the tour, for each station that a robot visits in that time; times `unpredictability`."""

CHOICES = 8
"""Number of the nearest stations that are compared."""

CROWDED = 0.25
"""Least ground for each robot, as a share of what a sensor sees around it on open ground: with less, most of what a
robot would plan to see another one sees before."""

STALE = 0.35
"""Share of the time between two robots on the tour, or of the stalest point's age, from which on a station is worth a
visit."""

STILL_STALE = 0.5
"""A station counts as seen once its age is below this share of what it was when it was drawn."""

MOVES_FIRST = 400
"""Moves by which a new plan is improved, times the number of stations."""

MOVES = 600
"""Moves by which each of the compared plans is improved."""

NEAR = 8
"""Stations that moves put beside each other are at most so many nearest ones apart."""

NO_WEIGHTS = np.zeros((0, 0))
"""Given to the kernels where all points count the same."""

NO_WAY_M = 1e6
"""Length that stands for no way at all, m."""

PERIOD_S = 300.0
"""Time after which all robots begin anew, s."""

LATE, LATE_S = 3.0, 15.0
"""A station that is not seen after so many times the way there, and so many seconds, is taken as given up."""

MOST_KNOWN = 64
"""Draws that a process remembers: its robots often work out the same ones."""

Routes = NDArray[np.int64]
Ages = NDArray[np.float64]
Facts = tuple[NDArray[np.float64], NDArray[np.float64], Ages, Routes]
"""What both kernels know: leads, ways, ages, near stations (`improve`)."""


@dataclass(slots=True)
class Part:
    """The part of one robot in the plan.

    Attributes:
        route: Its stations in order; it is on the way to the first.
        age_s: Weighted age of that one when it was drawn, s.
        until: Tick from which on the station is taken as given up.
        oldest: Number of a point of the station among those of the round, the oldest one when all were looked at last.
    """

    route: list[int]
    age_s: float = 0.0
    until: int = 0
    oldest: int = 0


class Question(NamedTuple):
    """The draw of one robot's next station: all that it depends on but for chance.

    Attributes:
        routes: int64 (robots, stations), the plan.
        counts: int64 (robots,), how many stations are in each route.
        pinned: bool (robots,), the robots that are on the way to a station.
        row: Of the robot.
        choices: int64 (n,), stations to choose from.
        facts: What the kernels know.
    """

    routes: Routes
    counts: Routes
    pinned: NDArray[np.bool_]
    row: int
    choices: Routes
    facts: Facts

    @property
    def digest(self) -> bytes:
        """A hash of all of it."""
        asked = blake2b(repr((self.row, len(self.choices))).encode(), digest_size=16)
        for array in (self.routes, self.counts, self.pinned, self.choices, *self.facts):
            asked.update(array.tobytes())
        return asked.digest()


class JointPlan:
    """The plan of one robot for all robots that share its ground.

    Attributes:
        parts: By robot number; empty before the first tick, and where there are too many robots for a plan.
        robots: Numbers of the robots that share the stations.
    """

    def __init__(
        self, setup: PolicySetup, laid_out: Round, stations: Stations, weights: NDArray[np.float64] | None
    ) -> None:
        """Begin without a plan.

        Args:
            setup: The policy's.
            laid_out: The round to which the stations belong.
            stations: The stations.
            weights: float64 (height, width), by how much points count more than others; None where all count the same.
        """
        self.parts: dict[int, Part] = {}
        self.robots: frozenset[int] = frozenset()
        self._round, self._stations = laid_out, stations
        self._number, self._step, self._width = setup.spec.number, setup.step, setup.terrain.width
        self._pace = 1.0 / setup.spec.speed
        self._chance = setup.fleet_chance
        self._spread = SPREAD * setup.options.unpredictability
        self._apart_m = np.minimum(stations.apart_m, NO_WAY_M)
        self._apart_s = np.ascontiguousarray(self._apart_m * self._pace)
        nearest = np.argsort(self._apart_m, axis=1, kind="stable")
        self._near = np.ascontiguousarray(nearest[:, 1 : NEAR + 1] if len(nearest) > 1 else nearest)
        self._spots = np.array([setup.terrain.centre(*divmod(spot, self._width)) for spot in stations.spots.tolist()])
        self._stands = RoundStands(setup, laid_out)
        self._weights = NO_WEIGHTS if weights is None else weights / weights.reshape(-1)[laid_out.points].min()
        ground_m2 = len(laid_out.points) * setup.terrain.point_area
        self._most_robots = ground_m2 / (CROWDED * math.pi * setup.sight.range_m**2)
        self._period = -1
        self._interval_s = math.inf
        self._least_s = 0.0

    @property
    def station(self) -> int | None:
        """Number of the robot's own next station; None without one."""
        own = self.parts.get(self._number)
        return own.route[0] if own is not None and own.route else None

    def update(self, view: View) -> None:
        """Go on with the plan: draw the next station of each robot that has seen its own.

        Args:
            view: Of this tick.
        """
        robots = sorted({self._number, *(number for number in view.peers if number in self.robots)})
        period = int(view.tick * self._step / PERIOD_S)
        if len(robots) > self._most_robots:
            self.parts = {}
            return
        self._interval_s = self._round.length_m * self._pace / len(robots)
        if robots != sorted(self.parts) or period != self._period:
            self._period = period
            self._begin(view, robots)
            return
        done = [number for number in robots if self._is_done(view, self.parts[number])]
        if done:
            self._draw(view, done, self._oldest_s(view), self._leads_s(view, robots))

    def visit(self, view: View, given_up: GivenUp) -> Target | None:
        """Return the oldest point of the robot's station that it has not given up; None where there is none.

        Args:
            view: Of this tick.
            given_up: What is left out.
        """
        if self.station is None:
            return None
        part = self._points_of(self.station)
        ages = self._ages_s(view, part)
        stands, usable = self._stands.of(view, given_up, part)
        ages[~usable] = -1.0
        oldest = int(ages.argmax())
        if ages[oldest] < 0.0:
            return None
        point, stand = int(self._round.points[part][oldest]), int(stands[oldest])
        age = view.tick - max(int(view.fog.last_seen.flat[point]), 0)
        return Target(divmod(point, self._width), divmod(stand, self._width), max(age, 1))

    def _points_of(self, station: int) -> slice:
        """Return where the points of a station are among those of the round."""
        return slice(*self._stations.begins[station : station + 2].tolist())

    def _ages_s(self, view: View, part: slice) -> Ages:
        """float64, the weighted ages of some of the round's points, s; 0 for what is in view or out of reach now."""
        points, fog = self._round.points[part], view.fog
        ages = np.empty(points.size)
        weighted_ages(points, fog.patrolled, fog.last_seen, fog.looked, self._weights, view.tick, self._step, ages)
        return ages

    def _oldest_s(self, view: View) -> Ages:
        """float64 (stations,), the weighted age of the oldest point of each station, s."""
        return np.maximum.reduceat(self._ages_s(view, slice(None)), self._stations.begins[:-1])

    def _is_done(self, view: View, part: Part) -> bool:
        """Return True if a robot's station has been seen, or is taken as given up."""
        if view.tick >= part.until or not part.route:
            return True
        whole = self._points_of(part.route[0])
        # Most often a look at one point shows that the station is not done.
        looks = [slice(part.oldest, part.oldest + 1)] if whole.start <= part.oldest < whole.stop else []
        for points in (*looks, whole):
            ages = self._ages_s(view, points)
            part.oldest = points.start + int(ages.argmax())
            oldest_s = float(ages.max())
            if oldest_s >= STILL_STALE * part.age_s and oldest_s > self._least_s:
                return False
        return True

    def _begin(self, view: View, robots: Sequence[int]) -> None:
        """Make a new plan: always the robot that is free first goes to the best station that is left."""
        ages, leads = self._oldest_s(view), self._leads_s(view, robots)
        rows: list[list[int]] = [[] for _ in robots]
        free_at = np.zeros(len(robots))
        left = np.ones(len(ages), dtype=np.bool_)
        for _ in range(len(ages)):
            row = int(free_at.argmin())
            ways = leads[row] if not rows[row] else self._apart_s[rows[row][-1]]
            best = int(np.where(left, ways - 0.1 * ages, np.inf).argmin())
            left[best] = False
            rows[row].append(best)
            free_at[row] += ways[best]
        self.parts = {number: Part(row) for number, row in zip(robots, rows, strict=True)}
        self._draw(view, robots, ages, leads, MOVES_FIRST * len(ages))

    def _leads_s(self, view: View, robots: Sequence[int]) -> NDArray[np.float64]:
        """float64 (robots, stations), about how long each robot takes to each station, s."""
        leads = np.empty((len(robots), len(self._spots)))
        for row, number in enumerate(robots):
            pose = view.reported if number == self._number else view.peers[number].pose
            away = np.sqrt((self._spots[:, 0] - pose.x) ** 2 + (self._spots[:, 1] - pose.y) ** 2)
            here = int(self._stations.around[view.point_of((pose.x, pose.y))])
            here = here if here >= 0 else int(away.argmin())
            # The way by the station from which the place is seen, and the shortest that there could be.
            longest = np.minimum(self._apart_m[here] + away[here], NO_WAY_M)
            leads[row] = 0.5 * (longest + np.maximum(away, self._apart_m[here] - away[here]))
        return leads * self._pace

    def _draw(
        self, view: View, done: Sequence[int], ages: Ages, leads: NDArray[np.float64], moves_first: int = 0
    ) -> None:
        """Draw the next station of some robots, one after the other.

        Args:
            view: Of this tick.
            done: Numbers of the robots.
            ages: float64 (stations,), weighted, s.
            leads: Of `_leads_s`, for all robots.
            moves_first: Moves by which the plan is improved before.
        """
        robots, size = sorted(self.parts), len(ages)
        routes, counts = np.zeros((len(robots), size), dtype=np.int64), np.zeros(len(robots), dtype=np.int64)
        self._least_s = STALE * min(self._interval_s, float(ages.max()))
        for row, number in enumerate(robots):
            route = self.parts[number].route
            route = _gone_on(route, ages, self._least_s) if number in done and not moves_first else route
            routes[row, : len(route)], counts[row] = route, len(route)
        _fill(routes, counts)
        pinned = np.array([number not in done for number in robots])
        facts = (leads, self._apart_s, ages, self._near)
        if moves_first:
            improve(routes, counts, pinned, *facts, moves_first, self._seed(view, 0))
        for number in done:
            row, seen = robots.index(number), self.parts[number].route[:1]
            taken = [*routes[pinned, 0].tolist(), *([] if moves_first else seen)]
            choices = np.union1d(self._choices(ages, leads, row, taken), routes[row, : counts[row]][:1])
            if not choices.size:
                continue  # there are fewer stations than robots
            drawn = self._drawn(view, number, Question(routes, counts, pinned.copy(), row, choices, facts))
            station, routes, counts = int(choices[drawn[0]]), drawn[1].copy(), drawn[2].copy()
            pinned[row] = True
            late_s = LATE * float(leads[row, station]) + LATE_S
            self.parts[number].age_s = float(ages[station])
            self.parts[number].until = view.tick + math.ceil(late_s / self._step)
        for row, number in enumerate(robots):
            self.parts[number].route = routes[row, : counts[row]].tolist()

    def _choices(self, ages: Ages, leads: NDArray[np.float64], row: int, taken: Sequence[int]) -> Routes:
        """int64, the nearest stations that are worth a visit and to which no other robot has a shorter way."""
        worth = (ages > self._least_s) & (leads[row] <= leads.min(axis=0))
        worth[list(taken)] = False
        stations = np.flatnonzero(worth)
        return stations[np.argsort(leads[row, stations], kind="stable")[:CHOICES]]

    def _seed(self, view: View, number: int) -> int:
        return int(self._chance(view.tick, number, 0) * 2.0**53)

    def _drawn(self, view: View, number: int, question: Question) -> tuple[int, Routes, Routes]:
        """Draw one of the choices: its number, its routes and how many stations are in each."""
        spread_s = max(self._spread * self._interval_s * len(self.parts) / len(self._spots), 1e-9)
        chance = spread_s, self._seed(view, number), self._chance(view.tick, number, 1)
        known = question.digest, *chance
        if known not in _known:
            if len(_known) >= MOST_KNOWN:
                _known.clear()
            _known[known] = _draw_one(question, *chance)
        return _known[known]


_known: dict[tuple[bytes, float, int, float], tuple[int, Routes, Routes]] = {}
"""Draws of this process by all that they depend on."""


def _draw_one(question: Question, spread_s: float, seed: int, share: float) -> tuple[int, Routes, Routes]:
    routes, counts, pinned, row, choices, facts = question
    plans = np.zeros((len(choices), *routes.shape), dtype=np.int64)
    plan_counts, costs = np.zeros((len(choices), len(routes)), dtype=np.int64), np.zeros(len(choices))
    compare(routes, counts, pinned, row, choices, *facts, MOVES, seed, plans, plan_counts, costs)
    shares = np.cumsum([exp(-behind / spread_s) for behind in (costs - costs.min()).tolist()])
    drawn = int(np.searchsorted(shares[:-1], share * shares[-1], side="right"))
    return drawn, plans[drawn], plan_counts[drawn]


def _gone_on(route: list[int], ages: Ages, least_s: float) -> list[int]:
    """Put the station at the head of a route to its end, and those after it that are not worth a visit."""
    for first in range(1, len(route)):
        if ages[route[first]] > least_s:
            return route[first:] + route[:first]
    return route[1:] + route[:1]


def _fill(routes: Routes, counts: Routes) -> None:
    """Give a robot without a station the last one of the robot that has most."""
    for row in np.flatnonzero(counts == 0).tolist():
        most = int(counts.argmax())
        if counts[most] > 1:
            counts[most] -= 1
            routes[row, 0], counts[row] = routes[most, counts[most]], 1
