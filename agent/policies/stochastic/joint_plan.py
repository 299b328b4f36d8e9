"""A plan for the whole fleet that one robot makes for itself, and its next station by draw.

No robot says where it is going. All believe nearly the same fog and hear where the others are, so each can work out
good routes for *all*, and take its own part:

- *Stations* (`patrol.ground.tour.stations`) are to be visited, each by one robot.
- A *plan* is a route for each robot; together they visit every station. It costs the sum of the eighth powers of the
  stations' ages when they are visited. So old stations weigh most, and no station is put off for ever.
- Small moves that cost nothing improve the plan (`agent.policies.stochastic.kernels.plan`).
- *The draw*: the robot compares the plans in which it goes to each of the near stations first. It draws one of them;
  the less a plan is behind the best one, the likelier.

For example, the best plan costs 40.0 s (the root of its cost) and begins with the first of three stations; with the
second one first it would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38 and
0 %. So the ground stays fresh, and an intruder that has watched for a whole day does not know where the robot turns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policies.stochastic.kernels.plan import compare, improve
from patrol.kernels.elementary import exp
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.policies.commitment.choice import Point
    from agent.policies.commitment.given_up import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.ground.tour.round import Round
    from patrol.ground.tour.stations import Stations

SPREAD = 0.012
"""Cost by which a plan may be behind the best one, as a share of the time between two robots on the tour, to be drawn
1/e times as often; times `unpredictability`."""

CHOICES = 8
"""Number of the nearest stations that are compared."""

STALE = 0.35
"""Share of the time between two robots on the tour from which on a station is worth a visit."""

MOVES = 1200
"""Moves by which a plan is improved before stations are compared."""

MOVES_EACH = 600
"""Moves by which each of the compared plans is improved."""

NEAR = 8
"""Stations that moves put beside each other are at most so many nearest ones apart."""

NO_WAY_M = 1e6
"""Length that stands for no way at all, m."""


class Visit(NamedTuple):
    """A point to be seen.

    Attributes:
        point: Row and column of the point.
        stand: Row and column of where to see it from.
        age: Of the point, ticks.
    """

    point: Point
    stand: Point
    age: int


class JointPlan:
    """The stations of one robot's ground, and its plan for all robots that share them.

    Attributes:
        station: Number of the station that it visits; None before the first one.
    """

    def __init__(self, setup: PolicySetup, laid_out: Round, stations: Stations) -> None:
        """Begin without a plan.

        Args:
            setup: The policy's.
            laid_out: The round to which the stations belong.
            stations: The stations.
        """
        self.station: int | None = None
        self._round, self._stations = laid_out, stations
        self._number, self._step, self._width = setup.spec.number, setup.step, setup.terrain.width
        self._pace = 1.0 / setup.spec.speed
        self._followers, self._zoned = setup.followers(), setup.zoned
        self._spread = SPREAD * setup.options.unpredictability
        apart = np.minimum(stations.apart_m, NO_WAY_M)
        self._apart = np.ascontiguousarray(apart)
        self._near = np.ascontiguousarray(np.argsort(apart, axis=1, kind="stable")[:, 1 : NEAR + 1])
        self._spots = np.array([setup.terrain.centre(*divmod(spot, self._width)) for spot in stations.spots.tolist()])
        points = laid_out.points
        reach = setup.fields.reach.reshape(-1)
        self._own_stands = np.where(reach[points], points, setup.fields.proxy.reshape(-1)[points])
        self._routes: dict[int, list[int]] = {}

    def next(self, view: View, given_up: GivenUp) -> Visit | None:
        """Return the next point to be seen: another one of the same station, or the oldest one of the next station.

        Args:
            view: Of this tick.
            given_up: What is left out.

        Returns:
            None where nothing is to be seen.
        """
        if self.station is not None:
            visit = self._oldest(view, given_up, self._part(self.station), self._least_s(view))
            if visit is not None:
                return visit
        robots = [self._number, *sorted(number for number in view.peers if number in self._followers)]
        ages = self._ages(view, given_up, slice(None))
        oldest = np.maximum.reduceat(ages, self._stations.begins[:-1])
        self.station = self._draw(view, robots, oldest)
        return self._oldest(view, given_up, self._part(self.station), 0.0)

    def _part(self, station: int) -> slice:
        """Return where the points of a station are among those of the round."""
        return slice(*self._stations.begins[station : station + 2].tolist())

    def _least_s(self, view: View) -> float:
        """Return the age from which on a point is worth a visit, s."""
        interval_s = self._round.length_m * self._pace / (1 + len(view.peers))
        return STALE * min(interval_s, view.mfow * self._step)

    def _ages(self, view: View, given_up: GivenUp, part: slice) -> NDArray[np.float64]:
        """float64, the weighted ages of some of the round's points, s; 0 for what is in view or left out."""
        points = self._round.points[part]
        ages = (view.tick - np.maximum(view.fog.last_seen.reshape(-1)[points], 0)) * self._step
        counts = view.fog.looked.reshape(-1)[points] != view.tick
        if view.fog.left_out is not None:
            counts &= ~view.fog.left_out.reshape(-1)[points]
        if given_up.places:
            counts &= ~given_up.covers(view.tick, self._stands(view, given_up, part), self._width)
        if self._zoned is not None:
            ages = ages * self._zoned(view.weighing).weights.reshape(-1)[points]
        return np.where(counts, ages, 0.0)

    def _weights(self, view: View) -> NDArray[np.float64]:
        """float64 (stations,), by how much the weighted age of each grows in a second."""
        if self._zoned is None:
            return np.ones(len(self._spots))
        weights = self._zoned(view.weighing).weights.reshape(-1)[self._round.points]
        return np.maximum.reduceat(weights, self._stations.begins[:-1]).astype(np.float64)

    def _stands(self, view: View, given_up: GivenUp, part: slice) -> NDArray[np.int64]:
        """int64, where to see some of the round's points from: the round's place, or else the point itself."""
        own = self._own_stands[part] if view.fog.stands is None else view.fog.stands[self._round.points[part]]
        stands = self._round.stands[part]
        if view.fog.stands is not None:
            stands = np.where(view.fog.stands[stands] == stands, stands, own)
        return np.where(given_up.covers(view.tick, stands, self._width), own, stands) if given_up.places else stands

    def _oldest(self, view: View, given_up: GivenUp, part: slice, least_s: float) -> Visit | None:
        """Return the oldest of some points; None where it is not old enough."""
        ages = self._ages(view, given_up, part)
        oldest = int(ages.argmax())
        if ages[oldest] <= least_s:
            return None
        point = int(self._round.points[part][oldest])
        stand = int(self._stands(view, given_up, part)[oldest])
        age = view.tick - max(int(view.fog.last_seen.flat[point]), 0)
        return Visit(divmod(point, self._width), divmod(stand, self._width), max(age, 1))

    def _draw(self, view: View, robots: list[int], ages: NDArray[np.float64]) -> int:
        """Draw the station to visit next.

        Args:
            view: Of this tick.
            robots: Numbers of the robots that the plan is for, this one first.
            ages: float64 (stations,), s.
        """
        size = len(ages)
        poses = [view.pose, *(view.peers[number].pose for number in robots[1:])]
        leads = np.array([self._leads_m(view, pose.x, pose.y) for pose in poses]) * self._pace
        paces = np.full(len(robots), self._pace)
        interval_s = self._round.length_m * self._pace / len(robots)
        routes, counts = self._begun(robots, leads, ages, STALE * interval_s)
        weights = self._weights(view)
        seed = int(view.draw(0, Purpose.PLAN) * 2.0**53)
        known = (leads, self._apart, ages, weights, paces, self._near)
        stale = np.flatnonzero(ages >= STALE * min(interval_s, view.mfow * self._step))
        if self.station is not None:
            stale = stale[stale != self.station]
        if size == 1 or not stale.size:
            return int(ages.argmax())
        improve(routes, counts, *known, MOVES, seed)
        choices = np.union1d(stale[np.argsort(leads[0, stale], kind="stable")[:CHOICES]], routes[0, : counts[0]][:1])
        plans = np.zeros((len(choices), *routes.shape), dtype=np.int64)
        plan_counts, costs = np.zeros((len(choices), len(robots)), dtype=np.int64), np.zeros(len(choices))
        compare(routes, counts, 0, choices, *known, MOVES_EACH, seed, plans, plan_counts, costs)
        behind = costs - costs.min()
        spread_s = max(self._spread * interval_s, 1e-9)
        shares = np.cumsum([exp(-cost / spread_s) for cost in behind.tolist()])
        drawn = int(np.searchsorted(shares[:-1], view.draw(1, Purpose.PLAN) * shares[-1], side="right"))
        self._routes = {
            number: plans[drawn, row, : plan_counts[drawn, row]].tolist() for row, number in enumerate(robots)
        }
        return int(choices[drawn])

    def _leads_m(self, view: View, x: float, y: float) -> NDArray[np.float64]:
        """float64 (stations,), about how far it is from a place to each station, m."""
        across, up = self._spots[:, 0] - x, self._spots[:, 1] - y
        away = np.sqrt(across**2 + up**2)
        here = int(self._stations.around[view.point_of((x, y))])
        leads: NDArray[np.float64] = np.maximum(away, self._apart[here if here >= 0 else int(away.argmin())])
        return leads

    def _begun(
        self, robots: list[int], leads: NDArray[np.float64], ages: NDArray[np.float64], least_s: float
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the last plan without what has been visited since, or a new one where the robots are others."""
        size = len(ages)
        if sorted(self._routes) == sorted(robots):
            rows = [self._gone_on(self._routes[number], ages, least_s) for number in robots]
        else:
            rows = [[] for _ in robots]
            until = np.zeros(len(robots))
            left = set(range(size))
            while left:
                row = int(until.argmin())
                ways = leads[row] if not rows[row] else self._apart[rows[row][-1]] * self._pace
                best = min(sorted(left), key=lambda station: ways[station] - 0.1 * ages[station])
                left.discard(best)
                rows[row].append(best)
                until[row] += ways[best]
        for stations in rows:
            if not stations and max(len(other) for other in rows) > 1:
                stations.append(max(rows, key=len).pop())
        routes, counts = np.zeros((len(robots), size), dtype=np.int64), np.array([len(row) for row in rows])
        for number, stations in enumerate(rows):
            routes[number, : len(stations)] = stations
        return routes, counts

    def _gone_on(self, route: list[int], ages: NDArray[np.float64], least_s: float) -> list[int]:
        """Put what is fresh at the beginning of a route to its end."""
        for first, station in enumerate(route):
            if ages[station] >= least_s:
                return route[first:] + route[:first]
        return route
