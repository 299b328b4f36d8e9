"""The draw: which station each robot of a fleet visits next.

- *Stations* (`patrol.tours.round`) are to be visited, each by one robot.
- The *routes* of all robots together lead to every station. They cost the sum of the eighth powers of the stations'
  ages when they are visited. So old stations weigh most, and no station is put off for ever.
- *The draw*: once a robot has seen its station, the routes are compared in which it goes to each of the near ones next.
  Each is improved by small moves (`agent.kernels.plan`). One is drawn; the less it is behind the best, the likelier.

For example, the best routes cost 40.0 s (the root of their cost) and begin with the first of three stations; with the
second one first they would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38
and 0 %. So the ground stays fresh, and an intruder that has watched for long is left to guess where the robot turns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import compare, guess_ways, improve
from agent.policies.common_plan.stations import NO_WAY_M
from agent.policies.pursuit import STILL_STALE

if TYPE_CHECKING:
    from agent.policies.common_plan.stations import Ages, KnownStations
    from agent.ports import PolicySetup
    from patrol.scenario import RobotSpec

SPREAD = 0.28
"""Cost by which routes may be behind the best ones to be drawn 1/e times as often, in times that a robot takes for a
station's share of the tour; times `unpredictability`."""

FEW = 4
"""Robots of the largest fleet with that spread; it falls with the time between robots in larger ones."""

CHOICES = 8
"""Number of the nearest stations that are compared."""

STALE = 0.35
"""Share of the time between two robots on the tour, or of the stalest point's age, from which on a station is worth a
visit."""

MOVES_FIRST = 400
"""Moves by which the first routes are improved, times the number of stations."""

MOVES = 600
"""Moves by which each of the compared routes is improved."""

MOVES_BEST = 8_000
"""Moves by which routes are improved each time where nothing is drawn."""

LATE, LATE_S = 3.0, 15.0
"""A station that is not seen after so many times the way there, and so many seconds, is taken as given up."""

PERIOD_S = 300.0
"""Time after which all routes begin anew, s: those that were improved again and again are easier to predict."""

PERIOD_BEST_S = 3600.0
"""The same where nothing is drawn, s."""

SPELL = 0.1
"""Time for which the draw of a robot and a station stays the same, as a share of the time between two robots on the
tour. So what was not drawn is not drawn a moment later, and robots that believe slightly different things draw alike.
"""

Routes = NDArray[np.int64]
Leads = NDArray[np.float64]
"""About how long each robot takes to each station, float64 (robots, stations), s."""

Inputs = tuple[Leads, Leads, Leads, Leads, Leads, Routes]
"""What `agent.kernels.plan` takes from `leads` to `near`."""

Draw = Callable[[int, int], float]
"""A number in [0, 1) for a robot, by number, and a choice, which is the same for all that ask."""


@dataclass(slots=True)
class Part:
    """The part of one robot in the routes."""

    route: list[int]  # its stations in order; it is on the way to the first
    age_s: float = 0.0  # weighted age of that one when it was drawn
    until: int = 0  # tick from which on the station is taken as given up
    oldest: int = 0  # number in the round of the station's oldest point, when all were looked at last
    least_way_s: float = math.inf  # shortest way to the station that the robot has had since


@dataclass(slots=True, eq=False)
class Parts:
    """The parts of all robots as of one tick."""

    each: dict[int, Part] = field(default_factory=dict)  # by robot number
    least_s: float = 0.0  # weighted age from which on a point is worth a visit

    def copy(self) -> Parts:
        """Return a copy that may be changed."""
        return Parts(
            {number: replace(part, route=list(part.route)) for number, part in self.each.items()}, self.least_s
        )


class Drawing:
    """The draws of some robots on the stations of a round."""

    def __init__(self, setup: PolicySetup, known: KnownStations, robots: Sequence[RobotSpec]) -> None:
        """Take the robots in the order of their numbers."""
        self._known, self._step = known, setup.fleet.step
        self.numbers = [spec.number for spec in robots]
        self.interval_s = known.length_m / sum(spec.speed for spec in robots)  # between two robots on the tour
        self._paces = np.array([1.0 / spec.speed for spec in robots])
        station_s = known.length_m / len(known) * float(self._paces.mean())
        self._spread_s = SPREAD * setup.options.unpredictability * station_s * min(1.0, FEW / len(robots))
        self._is_best = self._spread_s == 0.0  # nothing is drawn
        self.period_s = PERIOD_BEST_S if self._is_best else PERIOD_S
        terrain = setup.ground.prepared.terrain
        self._terrain = terrain
        self._spots = np.array([terrain.centre(*divmod(spot, terrain.width)) for spot in known.spots.tolist()])

    def leads_s(self, poses: NDArray[np.float64]) -> Leads:
        """Return about how long each robot takes to each station; poses are float64 (robots, 3), x, y and heading."""
        known, places = self._known, np.ascontiguousarray(poses[:, :2])
        around = [int(known.around[self._terrain.nearest_point(*place)]) for place in places.tolist()]
        ways_m = np.empty((len(places), len(known)))
        guess_ways(places, np.array(around), self._spots, known.ways_m, NO_WAY_M, ways_m)
        if (turns := known.turns) is not None:
            for row, pose in enumerate(poses):
                ways_m[row] += turns.from_pose_m(pose, ways_m[row], self._terrain.point)
        return np.ascontiguousarray(ways_m * self._paces[:, None])

    def begin(self, tick: int, ages: Ages, leads: Leads, draw: Draw) -> Parts:
        """Make the first routes, and draw the first stations."""
        rows = self._follow_round(leads) if self._is_best else self._go_to_nearest(ages, leads)
        parts = Parts({number: Part(route) for number, route in zip(self.numbers, rows, strict=True)})
        self.draw(parts, self.numbers, (), tick, ages, leads, draw, MOVES_FIRST * len(ages))
        return parts

    def _go_to_nearest(self, ages: Ages, leads: Leads) -> list[list[int]]:
        """Return routes in which always the robot that is free first goes to the best station that is left."""
        rows: list[list[int]] = [[] for _ in self.numbers]
        free_at = np.zeros(len(rows))
        unassigned = np.ones(len(ages), dtype=np.bool_)
        for _ in range(len(ages)):
            row = int(free_at.argmin())
            ways = leads[row] if not rows[row] else self._known.apart_m[rows[row][-1]] * self._paces[row]
            # Ten seconds of age weigh as much as one second of way.
            best = int(np.where(unassigned, ways - 0.1 * ages, np.inf).argmin())
            unassigned[best] = False
            rows[row].append(best)
            free_at[row] += ways[best]
        return rows

    def _follow_round(self, leads: Leads) -> list[list[int]]:
        """Return routes along the round, as long as robots are fast, which begin where the last robot is soonest."""
        size = leads.shape[1]
        order = np.argsort(leads.argmin(axis=1), kind="stable")  # of the robots, along the round
        passed = np.cumsum([0.0, *(1.0 / self._paces[order])])
        ends = np.rint(size * passed / passed[-1]).astype(np.int64)
        heads = (np.arange(size)[:, None] + ends[:-1]) % size
        first = int(leads[order, heads].max(axis=1).argmin())
        routes = [(np.arange(begin, end) + first) % size for begin, end in pairwise(ends.tolist())]
        return [routes[place].tolist() for place in np.argsort(order).tolist()]

    def is_done(self, parts: Parts, part: Part, ages_s: Callable[[slice], Ages]) -> bool:
        """Return True if a robot's station has been seen; note its oldest point. ``ages_s`` are those of points."""
        points = self._known.span(part.route[0])
        # Most often a look at one point shows that the station is not done.
        oldest = slice(part.oldest, part.oldest + 1)
        if points.start <= part.oldest < points.stop and self._is_stale(parts, part, ages_s(oldest)):
            return False
        ages = ages_s(points)
        part.oldest = points.start + int(ages.argmax())
        return not self._is_stale(parts, part, ages)

    def _is_stale(self, parts: Parts, part: Part, ages: Ages) -> bool:
        """Return True if some of a station's points still have to be seen."""
        age_s = float(ages.max())
        return age_s >= STILL_STALE * part.age_s and age_s > parts.least_s

    def draw(
        self,
        parts: Parts,  # changed in place
        drawing: Sequence[int],  # numbers of the robots that draw
        done: Sequence[int],  # those of them that have seen their station, or given it up
        tick: int,
        ages: Ages,  # of all stations
        leads: Leads,
        draw: Draw,
        moves_first: int = 0,  # moves by which the routes are improved before; where nothing is drawn, `MOVES_BEST`
    ) -> None:
        """Draw the next station of some robots, one after the other."""
        known = self._known
        parts.least_s = STALE * min(self.interval_s, float(ages.max()))
        worth = ages > parts.least_s
        rows = [list(parts.each[number].route) for number in self.numbers]
        for number in done:
            _put_behind(rows, self.numbers.index(number), worth, known.apart_m)
        routes, counts = _fill_routes(rows, len(ages))
        pinned = np.array([number not in drawing for number in self.numbers])
        inputs = (leads, known.apart_m, self._paces, ages, known.rates, known.near)
        if moves := MOVES_BEST if self._is_best else moves_first:
            improve(routes, counts, pinned, *inputs, moves, int(draw(0, 0) * 2.0**53))
        for number in drawing:
            row, part = self.numbers.index(number), parts.each[number]
            if not self._is_best:
                # The first stations of the others are theirs, and the one that it has just seen is fresh.
                occupied = [*routes[pinned & (counts > 0), 0].tolist(), *(part.route[:1] if number in done else [])]
                choices = np.union1d(self._list_choices(worth, leads, row, occupied), routes[row, : counts[row]][:1])
                if choices.size:
                    routes, counts = self._draw_route(routes, counts, pinned, row, choices, inputs, draw)
            elif counts[row]:
                # What lies before the first station that is worth a visit comes last, and so does one that is given up.
                route = routes[row, : counts[row]]
                left = part.route[0] if number in done else -1
                is_next = worth[route] & (route != left)
                route[:] = np.roll(route, -int(is_next.argmax()))
            if not counts[row]:
                continue  # there are fewer stations than robots
            station = int(routes[row, 0])
            # The robots that draw after it plan with this choice.
            pinned[row] = True
            part.age_s, part.least_way_s = float(ages[station]), math.inf
            part.until = tick + math.ceil((LATE * float(leads[row, station]) + LATE_S) / self._step)
        for row, number in enumerate(self.numbers):
            parts.each[number].route = routes[row, : counts[row]].tolist()

    def _draw_route(
        self,
        routes: Routes,
        counts: Routes,
        pinned: NDArray[np.bool_],
        row: int,
        choices: Routes,
        inputs: Inputs,
        draw: Draw,
    ) -> tuple[Routes, Routes]:
        """Return the routes in which a robot goes to one of some stations next, which is drawn."""
        plans = np.zeros((len(choices), *routes.shape), dtype=np.int64)
        plan_counts, costs = np.zeros((len(choices), len(routes)), dtype=np.int64), np.zeros(len(choices))
        number = self.numbers[row]
        seed = int(draw(number, 0) * 2.0**53)
        compare(routes, counts, pinned, row, choices, *inputs, MOVES, seed, plans, plan_counts, costs)
        # The least cost after Gumbel noise: a choice is drawn with the weight exp(-cost / spread).
        drawn = int((costs + self._spread_s * _draw_chances(draw, number, choices)).argmin())
        return plans[drawn], plan_counts[drawn]

    def _list_choices(self, worth: NDArray[np.bool_], leads: Leads, row: int, occupied: Sequence[int]) -> Routes:
        """Return the nearest stations that are worth a visit and to which no other robot has a shorter way."""
        worth = worth & (leads[row] <= leads.min(axis=0))
        worth[list(occupied)] = False
        stations = np.flatnonzero(worth)
        return stations[np.argsort(leads[row, stations], kind="stable")[:CHOICES]]


def _draw_chances(draw: Draw, number: int, choices: Routes) -> NDArray[np.float64]:
    """Return the draws of one robot's choices: less their Gumbel-distributed worth, in spreads."""
    drawn = [draw(number, choice + 1) for choice in choices.tolist()]
    # A draw may be 0, which has no logarithm, so half of the smallest step is added. The largest one then rounds to
    # 1, whose logarithm is 0.
    shares = [min(0.5**54 + share, 1.0 - 0.5**53) for share in drawn]
    return np.array([math.log(-math.log(share)) for share in shares])


def _put_behind(rows: list[list[int]], row: int, worth: NDArray[np.bool_], apart_m: NDArray[np.float64]) -> None:
    """Put the station at the head of a route, and those after it that are not worth a visit, to the ends of routes.

    Each is put behind the nearest last station. So on a round a robot leaves what it has seen to the one behind it.
    """
    route = rows[row]
    # A route keeps a station.
    until = next((index for index in range(1, len(route)) if worth[route[index]]), min(1, len(route) - 1))
    seen, rows[row] = route[:until], route[until:]
    for station in seen:
        min((route for route in rows if route), key=lambda route: float(apart_m[route[-1], station])).append(station)


def _fill_routes(rows: list[list[int]], size: int) -> tuple[Routes, NDArray[np.int64]]:
    """Return routes of some stations as arrays, and how many stations each has.

    A robot without a station gets the last one of the robot that has most.
    """
    routes, counts = np.zeros((len(rows), size), dtype=np.int64), np.zeros(len(rows), dtype=np.int64)
    for row, route in enumerate(rows):
        routes[row, : len(route)], counts[row] = route, len(route)
    for row in np.flatnonzero(counts == 0).tolist():
        longest = int(counts.argmax())
        if counts[longest] > 1:
            counts[longest] -= 1
            routes[row, 0], counts[row] = routes[longest, counts[longest]], 1
    return routes, counts
