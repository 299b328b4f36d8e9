"""The common plan: a patrol of point robots that every robot simulates, and in which it takes its own part.

Ground, roster, speeds, key and time are known to all, so all find the same plan without a message. What is heard does
not change it, and what is lost does not part it.

- *Stations* (`patrol.tours.round`) are to be visited, each by one robot.
- The *routes* of all robots together lead to every station. They cost the sum of the eighth powers of the stations'
  ages when they are visited. So old stations weigh most, and no station is put off for ever.
- *The draw*: once a robot has seen its station, the routes are compared in which it goes to each of the near ones next.
  Each is improved by small moves (`agent.kernels.plan`). One is drawn; the less it is behind the best, the likelier.
- A *visit* is what a robot does from one draw to the next: it drives towards a place, and sees points on the way
  (`agent.policies.common_plan.robots`).

For example, the best routes cost 40.0 s (the root of their cost) and begin with the first of three stations; with the
second one first they would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38
and 0 %. So the ground stays fresh, and an intruder that has watched for long is left to guess where the robot turns.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import compare, guess_ways, improve
from agent.policies.common_plan.robots import PlannedGround, PlannedRobot, Visit
from agent.policies.common_plan.stations import NO_WAY_M
from agent.policies.pursuit import STILL_STALE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from agent.policies.common_plan.robots import Ages
    from agent.policies.common_plan.stations import KnownStations
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from patrol.scenario import RobotSpec

SPREAD = 0.3
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

MEMORY = 2.0
"""Time for which visits are remembered, in times between two robots on the tour."""

Routes = NDArray[np.int64]


class CommonPlan:
    """The patrol of some robots on a round, as all of them simulate it from a tick on.

    At tick 0 robots begin where the scenario has them start, and later spread over the round, as if they had followed
    it.
    """

    def __init__(self, setup: PolicySetup, known: KnownStations, robots: Sequence[RobotSpec], origin: int) -> None:
        """Plan the first visits; ``origin`` is the first tick."""
        prepared, self._step = setup.ground.prepared, setup.fleet.step
        self._terrain, self._known = prepared.terrain, known
        self.origin = self.tick = origin
        self._draws = 0
        self._chance: Callable[..., float] = setup.fleet.chance
        self.interval_s = known.length_m / sum(spec.speed for spec in robots)
        self._paces = np.array([1.0 / spec.speed for spec in robots])
        station_s = known.length_m / len(known) * float(self._paces.mean())
        self._spread_s = SPREAD * setup.options.unpredictability * station_s * min(1.0, FEW / len(robots))
        self._ground = PlannedGround(setup.ground, self._step, known, list(robots))
        self._routes = np.zeros((len(robots), len(known)), dtype=np.int64)
        self._counts = np.zeros(len(robots), dtype=np.int64)
        places = [(start.x, start.y) for start in (prepared.starts[spec.number - 1] for spec in robots)]
        if origin > 0:
            places = self._spread_over_round(robots)
        self.robots = [
            PlannedRobot(spec, place, Visit(-1, origin), place) for spec, place in zip(robots, places, strict=True)
        ]
        self._least_s = 0.0  # weighted age from which on points are worth a visit
        for robot in self.robots:
            self._ground.look(robot, origin, self._least_s)
        self._begin()
        self._visits = {robot.spec.number: robot.visit for robot in self.robots}  # the oldest that may be asked for

    def visit_at(self, number: int, tick: int) -> Visit:
        """Return the visit that a robot makes at a tick, which the plan has come to lately."""
        visit = self._visits[number]
        while visit.then is not None and visit.ended is not None and visit.ended <= tick:
            visit = visit.then
        return visit

    def finish(self, visit: Visit) -> int:
        """Work the plan out until a visit is over; return the tick at which it is."""
        while visit.ended is None:
            self.advance()
        return visit.ended

    def advance_to(self, tick: int) -> None:
        """Work the plan out up to a tick, unless it has been."""
        while self.tick < tick:
            self.advance()

    def advance(self) -> None:
        """Go on by a tick."""
        self.tick += 1
        for robot in self.robots:
            self._ground.drive(robot)
            robot.visit.trail.append(robot.place)
            self._ground.look(robot, self.tick, self._least_s)
        arrived = [row for row, robot in enumerate(self.robots) if self._is_done(robot)]
        if arrived:
            self._draw_stations(arrived)
            oldest = round(self.tick - MEMORY * self.interval_s / self._step)
            self._visits = {number: self.visit_at(number, oldest) for number in self._visits}

    def _spread_over_round(self, robots: Sequence[RobotSpec]) -> list[Spot]:
        """Put robots on the round, whose points were seen as they would have passed them."""
        known, turn = self._known, len(self._known.points)
        passed = np.cumsum([0.0, *(spec.speed for spec in robots)])
        heads = [known.span(int(share * len(known))).start for share in (passed[:-1] / passed[-1]).tolist()]
        for head, end in zip(heads, [*heads[1:], turn], strict=True):
            ahead = np.arange(head, end)
            # What lies right before the next robot was seen last by that one, and so is freshest.
            shares = (end - ahead) / max(end - head, 1)
            ticks = self.tick - np.ceil(shares * self.interval_s / self._step).astype(np.int64)
            self._ground.last_seen.flat[known.points[ahead]] = np.maximum(ticks, 0)
        return [self._terrain.centre(*divmod(int(known.stands[head]), self._terrain.width)) for head in heads]

    def _is_done(self, robot: PlannedRobot) -> bool:
        """Return True if a robot's station has been seen; send it on to where another part of it is seen from."""
        span = self._known.span(robot.visit.station)
        oldest = slice(robot.oldest, robot.oldest + 1)
        if robot.corners and self._is_stale(robot, self._ground.ages_s(oldest, self.tick)):
            return False
        if not robot.corners:
            # So each stand of the station is gone to once at most.
            self._ground.see_from_stand(robot, self.tick, self._least_s)
        ages = self._ground.ages_s(span, self.tick)
        robot.oldest = span.start + int(ages.argmax())
        if not self._is_stale(robot, ages):
            return True
        if not robot.corners:
            self._ground.send(robot, int(self._known.stands[robot.oldest]))
        return False

    def _is_stale(self, robot: PlannedRobot, ages: Ages) -> bool:
        age_s = float(ages.max())
        return age_s >= STILL_STALE * robot.age_s and age_s > self._least_s

    def _leads_s(self) -> NDArray[np.float64]:
        """Return about how long each robot takes to each station, float64 (robots, stations), s."""
        known, places = self._known, [robot.place for robot in self.robots]
        around = np.array([known.around[self._terrain.nearest_point(*place)] for place in places], dtype=np.int64)
        spots = np.array([self._terrain.centre(*divmod(spot, self._terrain.width)) for spot in known.spots.tolist()])
        ways = np.empty((len(places), len(known)))
        guess_ways(np.array(places), around, spots, known.apart_m, NO_WAY_M, 1.0, ways)
        return np.ascontiguousarray(ways * self._paces[:, None])

    def _begin(self) -> None:
        """Make the first routes: always the robot that is free first goes to the best station that is left."""
        ages, leads = self._ground.oldest_s(self.tick), self._leads_s()
        rows: list[list[int]] = [[] for _ in self.robots]
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
        for row, route in enumerate(rows):
            self._routes[row, : len(route)], self._counts[row] = route, len(route)
        _fill_empty_routes(self._routes, self._counts)
        pinned = np.zeros(len(rows), dtype=np.bool_)
        inputs = (leads, self._known.apart_m, self._paces, ages, self._known.near)
        improve(self._routes, self._counts, pinned, *inputs, MOVES_FIRST * len(ages), self._make_seed())
        self._draw_stations(list(range(len(rows))))

    def _draw_stations(self, drawing: Sequence[int]) -> None:
        """Draw the next station of some robots, by row, one after the other."""
        known, robots = self._known, self.robots
        ages, leads = self._ground.oldest_s(self.tick), self._leads_s()
        self._least_s = STALE * min(self.interval_s, float(ages.max()))
        begins = robots[drawing[0]].visit.station < 0
        if not begins:
            for row in drawing:
                self._go_on(row, ages)
        _fill_empty_routes(self._routes, self._counts)
        pinned = np.ones(len(robots), dtype=np.bool_)
        pinned[list(drawing)] = False
        inputs = (leads, known.apart_m, self._paces, ages, known.near)
        for row in drawing:
            # The first stations of the others are theirs, and the one that it has just seen is fresh.
            occupied = [*self._routes[pinned, 0].tolist(), *([] if begins else [robots[row].visit.station])]
            choices = np.union1d(
                self._list_choices(ages > self._least_s, leads, row, occupied),
                self._routes[row, : self._counts[row]][:1],
            )
            plans = np.zeros((len(choices), *self._routes.shape), dtype=np.int64)
            counts, costs = np.zeros((len(choices), len(robots)), dtype=np.int64), np.zeros(len(choices))
            self._draws += 1
            compare(
                self._routes,
                self._counts,
                pinned,
                row,
                choices,
                *inputs,
                MOVES,
                self._make_seed(),
                plans,
                counts,
                costs,
            )
            # The least cost after Gumbel noise: a choice is drawn with the weight exp(-cost / spread).
            drawn = int((costs + self._spread_s * self._draw_chances(choices)).argmin())
            self._routes, self._counts = plans[drawn].copy(), counts[drawn].copy()
            # The robots that draw after it plan with this choice.
            pinned[row] = True
            robots[row].age_s = float(ages[choices[drawn]])
        for row in drawing:
            self._begin_visit(robots[row], int(self._routes[row, 0]))

    def _begin_visit(self, robot: PlannedRobot, station: int) -> None:
        """End a robot's visit, and send it to another station."""
        span = self._known.span(station)
        robot.oldest = span.start + int(self._ground.ages_s(span, self.tick).argmax())
        robot.begin(Visit(station, self.tick))
        self._ground.send(robot, int(self._known.stands[robot.oldest]))

    def _go_on(self, row: int, ages: Ages) -> None:
        """Put the station at the head of a route to its end, and those after it that are not worth a visit.

        For example, of the route 3, 5, 2, where 5 is fresh and 2 is stale, it becomes 2, 3, 5.
        """
        route = self._routes[row, : self._counts[row]]
        worth = np.flatnonzero(ages[route[1:]] > self._least_s)
        self._routes[row, : self._counts[row]] = np.roll(route, -(1 + (int(worth[0]) if worth.size else 0)))

    def _list_choices(
        self, worth: NDArray[np.bool_], leads: NDArray[np.float64], row: int, occupied: Sequence[int]
    ) -> Routes:
        """Return the nearest stations that are worth a visit and to which no other robot has a shorter way."""
        worth = worth & (leads[row] <= leads.min(axis=0))
        worth[list(occupied)] = False
        stations = np.flatnonzero(worth)
        return stations[np.argsort(leads[row, stations], kind="stable")[:CHOICES]]

    def _draw_chances(self, choices: Routes) -> NDArray[np.float64]:
        """Return the draws of a robot's choices: less their Gumbel-distributed worth, in spreads."""
        drawn = [self._chance(self.origin, self._draws, choice + 1) for choice in choices.tolist()]
        # A draw may be 0, which has no logarithm, so half of the smallest step is added. The largest one then rounds to
        # 1, whose logarithm is 0.
        shares = [min(0.5**54 + share, 1.0 - 0.5**53) for share in drawn]
        return np.array([math.log(-math.log(share)) for share in shares])

    def _make_seed(self) -> int:
        return int(self._chance(self.origin, self._draws, 0) * 2.0**53)


def _fill_empty_routes(routes: Routes, counts: Routes) -> None:
    """Give a robot without a station the last one of the robot that has most."""
    for row in np.flatnonzero(counts == 0).tolist():
        longest = int(counts.argmax())
        if counts[longest] > 1:
            counts[longest] -= 1
            routes[row, 0], counts[row] = routes[longest, counts[longest]], 1
