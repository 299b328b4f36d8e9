"""The default policy: visit the stations of the ground in an order that is drawn.

A patrol that follows a tour is the freshest, and an intruder that watches it knows where it will be. This one draws
each next station from good plans for the whole fleet, and keeps to it until it has been seen
(`agent.policies.commitment`). With a fleet key the draws come from the key, so only the fleet can compute them
(`agent.chance`).

Where there is no tour (`patrol.measures.best_tour`), as in a fleet of several speeds or with a sensor that does not
look all around, each choice is free. So it is where robots are crowded (`most_planned`), where many positions are lost,
and for a robot for which no station is left.

Every robot works out the plan for the whole fleet for itself. No robot says where it is going. All believe nearly the
same fog, hear where the others are, and draw the same numbers, so each can work out what *all* will do, and take its
own part:

- *Stations* (`patrol.tours.round`) are to be visited, each by one robot.
- A *plan* is a route for each robot; together they visit every station. It costs the sum of the eighth powers of the
  stations' ages when they are visited. So old stations weigh most, and no station is put off for ever.
- *The draw*: once a robot has seen its station, the plans are compared in which it goes to each of the near ones next.
  Each is improved by small moves (`agent.kernels.plan`). One is drawn; the less it is behind the
  best, the likelier.
- *Agreeing again*: a lost position makes robots believe different things. So a draw stays the same for a while, and a
  robot that is seen to go elsewhere than was worked out is worked out anew. Where many positions are lost, each robot
  chooses freely. At the begin of a period, and whenever other robots are heard, all plan from where the robots are.

For example, the best plan costs 40.0 s (the root of its cost) and begins with the first of three stations; with the
second one first it would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38 and
0 %. So the ground stays fresh, and an intruder that has watched for long is left to guess where the robot turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import compare, guess_ways, improve, oldest_ages, weighted_ages
from agent.policies.pursuit import STILL_STALE, Target
from agent.policies.shared_round import Loss, RoundStands, SharedRound
from patrol.measures.best_tour import most_planned
from patrol.radio.peers import columns_of
from patrol.scenario import StochasticOptions
from patrol.zones.division import KEPT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from agent.policies.commitment import Choice
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Round, Stations
    from patrol.zones.division import Divisions, Group, ZonedGround


SPREAD = 0.28
"""Cost by which a plan may be behind the best one to be drawn 1/e times as often, as a share of the time between two
robots on the tour, for each station that a robot visits in that time; times `unpredictability`."""

CHOICES = 8
"""Number of the nearest stations that are compared."""

STALE = 0.35
"""Share of the time between two robots on the tour, or of the stalest point's age, from which on a station is worth a
visit."""

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

SPELL = 0.1
"""Time for which the draw of a robot and a station stays the same, as a share of the time between two robots on the
tour. So robots that believe slightly different things still draw the same."""

TURNED = 0.4
"""A robot whose way to its station has become so much longer again, in ranges of the sensor, has drawn another one."""

STUCK_S = 30.0
"""Time for which a robot has to stand still to be left out of the plan, s."""

LATE, LATE_S = 3.0, 15.0
"""A station that is not seen after so many times the way there, and so many seconds, is taken as given up."""

Routes = NDArray[np.int64]
Ages = NDArray[np.float64]


@dataclass(slots=True)
class Part:
    """The part of one robot in the plan."""

    route: list[int]  # its stations in order; it is on the way to the first
    age_s: float = 0.0  # weighted age of that one when it was drawn
    until: int = 0  # tick from which on the station is taken as given up
    oldest: int = 0  # number in the round of the station's oldest point, when all were looked at last
    least_way_s: float = math.inf  # shortest way to the station that the robot has had since


_FIELDS_OF_PART = attrgetter(*(member.name for member in fields(Part)))


@dataclass(slots=True, eq=False)
class FleetPlan:
    """The plan of all robots as of one tick. Robots of one process that have worked out the same one share it."""

    parts: dict[int, Part]  # by robot number; empty before the first tick, and while each choice is free
    period: int = -1
    least_s: float = 0.0  # age of a station from which on it is worth a visit


NO_PLAN = FleetPlan({})


@dataclass(slots=True)
class WorkedOut:
    """The plans that the robots of one process have worked out in a tick, by all that they follow from."""

    tick: int = -1
    plans: dict[tuple[object, ...], FleetPlan] = field(default_factory=dict)


class KnownStations:
    """The stations of a round, as one robot gets to them and sees them."""

    def __init__(
        self, setup: PolicySetup, laid_out: Round, stations: Stations, weights: NDArray[np.float64] | None
    ) -> None:
        """Find the ways between them; ``weights`` (height, width) are None where all points count the same."""
        terrain = setup.ground.terrain
        self._stations, self._points = stations, laid_out.points
        self._stands = RoundStands(setup, laid_out)
        self._step, self._width = setup.fleet.step, terrain.width
        self._pace = 1.0 / setup.robot.spec.speed
        self._apart_m = np.minimum(stations.apart_m, NO_WAY_M)
        self.apart_s = np.ascontiguousarray(self._apart_m * self._pace)
        nearest = np.argsort(self._apart_m, axis=1, kind="stable")
        # Each station is the nearest to itself.
        self.near = np.ascontiguousarray(nearest[:, 1 : NEAR + 1] if len(nearest) > 1 else nearest)
        self._spots = np.array([terrain.centre(*divmod(spot, self._width)) for spot in stations.spots.tolist()])
        self._leaves_age = setup.ground.sight.leaves_age
        self._patrolled: NDArray[np.bool_] | None = None  # for which the witnesses were found
        self._witnesses = np.empty((len(self), 2), dtype=np.int64)
        self._weights = NO_WEIGHTS if weights is None else weights / weights.reshape(-1)[self._points].min()

    def __len__(self) -> int:
        return len(self._spots)

    def points_of(self, station: int) -> slice:
        """Return where the points of a station are among those of the round."""
        return slice(*self._stations.begins[station : station + 2].tolist())

    def ages_s(self, view: View, some: slice | Sequence[int]) -> Ages:
        """Return the weighted ages of some of the round's points, s; 0 for those in view or out of reach now."""
        points, fog = self._points[some], view.fog
        ages = np.empty(points.size)
        weighted_ages(points, fog.patrolled, fog.last_seen, fog.looked, self._weights, view.tick, self._step, ages)
        return ages

    def oldest_s(self, view: View) -> Ages:
        """Return the weighted age of the oldest point of each station, s."""
        fog, begins = view.fog, self._stations.begins
        if not self._weights.size and not self._leaves_age:
            if fog.patrolled is not self._patrolled:
                self._patrolled, self._witnesses[:] = fog.patrolled, -1
            ages = np.empty(len(self))
            at = view.tick, self._step, self._witnesses
            oldest_ages(self._points, begins, fog.patrolled, fog.last_seen, *at, ages)
            return ages
        return np.maximum.reduceat(self.ages_s(view, slice(None)), begins[:-1])

    def ways_s(self, view: View, places: Sequence[Spot]) -> NDArray[np.float64]:
        """Return about how long a robot takes from each of some places to each station, float64 (places, stations)."""
        seen_from = np.array([self._stations.around[view.point_of(place)] for place in places], dtype=np.int64)
        ways = np.empty((len(places), len(self)))
        guess_ways(np.array(places), seen_from, self._spots, self._apart_m, NO_WAY_M, self._pace, ways)
        return ways

    def visit(self, view: View, station: int, given_up: GivenUp) -> Target | None:
        """Return the oldest point of a station that the robot has not given up; None where there is none."""
        span = self.points_of(station)
        ages = self.ages_s(view, span)
        stands, usable = self._stands.of(view, given_up, span)
        # Below every age, so that no stand that is not usable is chosen.
        ages[~usable] = -1.0
        oldest = int(ages.argmax())
        if ages[oldest] < 0.0:
            return None
        point, stand = int(self._points[span][oldest]), int(stands[oldest])
        age = view.tick - max(int(view.fog.last_seen.flat[point]), 0)
        return Target(divmod(point, self._width), divmod(stand, self._width), max(age, 1))


class JointPlan:
    """The plan of one robot for all robots that share its ground, and its own choices in it."""

    def __init__(
        self,
        setup: PolicySetup,
        laid_out: Round,
        stations: KnownStations,
        free: Choice,
        robots: frozenset[int],  # those that share the stations
        team: float,  # how many there are of them without spare ones
        most_robots: float,  # that plan; in a larger fleet choices are free
    ) -> None:
        """Begin without a plan."""
        self._plan = NO_PLAN
        self._worked_out: WorkedOut = setup.ground.scratch.setdefault("plans", WorkedOut())
        self._round = laid_out
        self._robots, self._team, self._most_robots = robots, team, most_robots
        self._known, self._free = stations, free
        self._number, self._step = setup.robot.spec.number, setup.fleet.step
        self._length_m, self._pace = laid_out.length_m, 1.0 / setup.robot.spec.speed
        self._chance = setup.fleet.chance
        self._spread = SPREAD * setup.options.unpredictability
        self._turned_s = TURNED * setup.ground.sight.range_m * self._pace
        self._stood: dict[int, tuple[float, float, int]] = {}
        self._loss = Loss(setup.fleet.step)

    @property
    def parts(self) -> dict[int, Part]:
        """The parts of all robots in the plan, by number."""
        return self._plan.parts

    @property
    def station(self) -> int | None:
        """Number of the robot's own next station; None without one."""
        own_part = self.parts.get(self._number)
        return own_part.route[0] if own_part is not None and own_part.route else None

    def follow_with(self, robots: frozenset[int]) -> None:
        """Share the stations with other robots, none of which is spare."""
        self._robots, self._team = robots, float(len(robots))

    def forget(self) -> None:
        """Make a new plan at the next tick."""
        self._plan = NO_PLAN

    def waits(self, view: View) -> bool:
        """Return False: a robot that is early goes on to its next station."""
        del view
        return False

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the oldest point of the robot's station, and return the way there, or that of a free choice."""
        if self.station is not None:
            visit = self._known.visit(view, self.station, pursuit.given_up)
            if visit is not None and (way := pursuit.go_to(view, start, visit)) is not None:
                return way
        # No way leads there now. Another robot may stand in the door, and the two would wait for each other.
        return self._free.next(view, start, pursuit)

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Go on with the plan; return True if no station is left for the robot, so that it chooses freely."""
        before = self.station
        self._go_on(view)
        if (station := self.station) != before:
            pursuit.target = None
        return station is None

    def _go_on(self, view: View) -> None:
        """Draw the next station of each robot that has seen its own."""
        # A peer as an object takes longer than all that is asked of it here.
        peers = columns_of(view.peers)
        rows = zip(peers.numbers.tolist(), peers.places.tolist(), peers.ticks.tolist(), strict=True)
        heard_at: list[int] = []
        places: dict[int, Spot] = {}
        for number, (x, y), tick in rows:
            if number in self._robots and not self._is_stuck(view, number, (x, y)):
                heard_at.append(tick)
                places[number] = x, y
        places[self._number] = view.reported.x, view.reported.y
        robots = sorted(places)
        self._loss.note(view.tick, heard_at)
        if self._loss.is_lossy or len(robots) > self._most_robots:
            # It would leave to others what they take as seen.
            self._plan = NO_PLAN
            return
        spots = [places[number] for number in robots]
        ground = (view.fog.identity, self._round, view.weighing)
        question = (*ground, self._plan, self._team, view.spec.speed, *robots, *spots)
        if self._worked_out.tick != view.tick:
            self._worked_out.tick, self._worked_out.plans = view.tick, {}
        plans = self._worked_out.plans
        if question not in plans:
            plans[question] = self._work_out(view, robots, spots)
        self._plan = plans[question]

    def _work_out(self, view: View, robots: Sequence[int], spots: Sequence[Spot]) -> FleetPlan:
        """Return the plan after this one, in which each robot that has seen its station goes to another."""
        before, period = self._plan, int(view.tick * self._step / PERIOD_S)
        leads = self._known.ways_s(view, spots)
        if robots != sorted(before.parts) or period != before.period:
            return self._begin_plan(view, period, robots, leads)
        parts = {number: Part(*_FIELDS_OF_PART(part)) for number, part in before.parts.items()}
        plan = FleetPlan(parts, before.period, before.least_s)
        arrived = self._list_arrived(view, plan, robots)
        ways = dict(zip(robots, leads, strict=True))
        turned = [
            number for number in robots if number not in arrived and self._has_turned(plan.parts[number], ways[number])
        ]
        if arrived or turned:
            idle = [number for number in robots if not plan.parts[number].route]
            drawing = sorted([*arrived, *turned, *idle])
            self._draw_stations(view, plan, drawing, arrived, self._known.oldest_s(view), leads)
        return plan

    def _list_arrived(self, view: View, plan: FleetPlan, robots: Sequence[int]) -> list[int]:
        """Return the robots whose station has been seen, or is taken as given up."""
        parts = [plan.parts[number] for number in robots]
        # Most often a look at one point shows that the station is not done.
        oldest_s = self._known.ages_s(view, [part.oldest for part in parts]).tolist()
        return [
            number
            for number, part, age_s in zip(robots, parts, oldest_s, strict=True)
            if part.route and (view.tick >= part.until or self._is_done(view, plan, part, age_s))
        ]

    def _is_done(self, view: View, plan: FleetPlan, part: Part, oldest_s: float) -> bool:
        """Return True if a robot's station has been seen; `oldest_s` is the age of the point that was its oldest."""
        points = self._known.points_of(part.route[0])
        if points.start <= part.oldest < points.stop and _is_stale(plan, part, oldest_s):
            return False
        ages = self._known.ages_s(view, points)
        part.oldest = points.start + int(ages.argmax())
        return not _is_stale(plan, part, float(ages.max()))

    def _is_stuck(self, view: View, number: int, place: Spot) -> bool:
        """Return True if another robot has stood still for long: it will not see the stations left to it."""
        x, y, since = self._stood.get(number, (math.inf, math.inf, 0))
        if math.hypot(place[0] - x, place[1] - y) > view.stride:
            self._stood[number] = *place, view.tick
            return False
        return (view.tick - since) * self._step > STUCK_S

    def _has_turned(self, part: Part, ways_s: NDArray[np.float64]) -> bool:
        """Return True if a robot goes away from its station, as where its fog differs and it has drawn another one."""
        if not part.route:
            return False
        way_s = float(ways_s[part.route[0]])
        part.least_way_s = min(part.least_way_s, way_s)
        return way_s > part.least_way_s + self._turned_s

    def _begin_plan(self, view: View, period: int, robots: Sequence[int], leads: NDArray[np.float64]) -> FleetPlan:
        """Make a new plan: always the robot that is free first goes to the best station that is left."""
        ages = self._known.oldest_s(view)
        rows: list[list[int]] = [[] for _ in robots]
        free_at = np.zeros(len(robots))
        unassigned = np.ones(len(ages), dtype=np.bool_)
        for _ in range(len(ages)):
            row = int(free_at.argmin())
            ways = leads[row] if not rows[row] else self._known.apart_s[rows[row][-1]]
            # Ten seconds of age weigh as much as one second of way.
            best = int(np.where(unassigned, ways - 0.1 * ages, np.inf).argmin())
            unassigned[best] = False
            rows[row].append(best)
            free_at[row] += ways[best]
        plan = FleetPlan({number: Part(row) for number, row in zip(robots, rows, strict=True)}, period)
        self._draw_stations(view, plan, robots, (), ages, leads, MOVES_FIRST * len(ages))
        return plan

    def _draw_stations(
        self,
        view: View,
        plan: FleetPlan,  # changed in place
        drawing: Sequence[int],
        done: Sequence[int],  # those of them that have seen their station, or given it up
        ages: Ages,  # of all stations
        leads: NDArray[np.float64],  # of `KnownStations.ways_s`, for all robots
        moves_first: int = 0,  # moves by which the plan is improved before
    ) -> None:
        """Draw the next station of some robots, one after the other."""
        robots, size = sorted(plan.parts), len(ages)
        interval_s = self._length_m * self._pace / len(robots)
        routes, counts = np.zeros((len(robots), size), dtype=np.int64), np.zeros(len(robots), dtype=np.int64)
        plan.least_s = STALE * min(interval_s, float(ages.max()))
        for row, number in enumerate(robots):
            route = plan.parts[number].route
            route = _gone_on(route, ages, plan.least_s) if number in done else route
            routes[row, : len(route)], counts[row] = route, len(route)
        _fill_empty_routes(routes, counts)
        pinned = np.array([number not in drawing for number in robots])
        inputs = (leads, self._known.apart_s, ages, self._known.near)
        if moves_first:
            improve(routes, counts, pinned, *inputs, moves_first, self._make_seed(view, 0))
        spread_s = self._spread * interval_s * len(robots) / len(self._known)
        for number in drawing:
            row, visited = robots.index(number), plan.parts[number].route[:1] if number in done else []
            # The first stations of the others are theirs, and the one that it has just seen is fresh.
            occupied = [*routes[pinned, 0].tolist(), *visited]
            choices = np.union1d(
                self._list_choices(ages > plan.least_s, leads, row, occupied), routes[row, : counts[row]][:1]
            )
            if not choices.size:
                continue  # there are fewer stations than robots
            plans = np.zeros((len(choices), *routes.shape), dtype=np.int64)
            plan_counts, costs = np.zeros((len(choices), len(routes)), dtype=np.int64), np.zeros(len(choices))
            seed = self._make_seed(view, number)
            compare(routes, counts, pinned, row, choices, *inputs, MOVES, seed, plans, plan_counts, costs)
            # The least cost after Gumbel noise: a choice is drawn with the weight exp(-cost / spread).
            drawn = int((costs + spread_s * self._draw_chances(view, number, choices)).argmin())
            station, routes, counts = int(choices[drawn]), plans[drawn], plan_counts[drawn]
            # The robots that draw after it plan with this choice.
            pinned[row] = True
            late_s = LATE * float(leads[row, station]) + LATE_S
            plan.parts[number].age_s, plan.parts[number].least_way_s = float(ages[station]), math.inf
            plan.parts[number].until = view.tick + math.ceil(late_s / self._step)
        for row, number in enumerate(robots):
            plan.parts[number].route = routes[row, : counts[row]].tolist()

    def _list_choices(
        self, worth: NDArray[np.bool_], leads: NDArray[np.float64], row: int, taken: Sequence[int]
    ) -> Routes:
        """Return the nearest stations that are worth a visit and to which no other robot has a shorter way."""
        worth = worth & (leads[row] <= leads.min(axis=0))
        worth[list(taken)] = False
        stations = np.flatnonzero(worth)
        return stations[np.argsort(leads[row, stations], kind="stable")[:CHOICES]]

    def _draw_chances(self, view: View, number: int, choices: Routes) -> NDArray[np.float64]:
        """Return the draws of one robot's choices: less their Gumbel-distributed worth, in spreads."""
        drawn = [self._chance(self._find_spell(view), number, choice + 1) for choice in choices.tolist()]
        # A draw may be 0, which has no logarithm, so half of the smallest step is added. The largest one then rounds to
        # 1, whose logarithm is 0.
        shares = [min(0.5**54 + share, 1.0 - 0.5**53) for share in drawn]
        return np.array([math.log(-math.log(share)) for share in shares])

    def _make_seed(self, view: View, number: int) -> int:
        return int(self._chance(self._find_spell(view), number, 0) * 2.0**53)

    def _find_spell(self, view: View) -> int:
        """Return the number of the time in which draws stay the same."""
        return int(view.tick * self._step * self._team / (SPELL * self._length_m * self._pace))


def _is_stale(plan: FleetPlan, part: Part, age_s: float) -> bool:
    return age_s >= STILL_STALE * part.age_s and age_s > plan.least_s


def _gone_on(route: list[int], ages: Ages, least_s: float) -> list[int]:
    """Put the station at the head of a route to its end, and those after it that are not worth a visit.

    For example, of the route 3, 5, 2, where 5 is fresh and 2 is stale, it becomes 2, 3, 5.
    """
    for first in range(1, len(route)):
        if ages[route[first]] > least_s:
            return route[first:] + route[:first]
    return route[1:] + route[:1]


def _fill_empty_routes(routes: Routes, counts: Routes) -> None:
    """Give a robot without a station the last one of the robot that has most."""
    for row in np.flatnonzero(counts == 0).tolist():
        longest = int(counts.argmax())
        if counts[longest] > 1:
            counts[longest] -= 1
            routes[row, 0], counts[row] = routes[longest, counts[longest]], 1


class Stochastic(SharedRound):
    """Draws its next station."""

    Options = StochasticOptions

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> Choice:
        del view
        if laid_out.stations is None:
            return self._free
        setup, ground, fleet = self._setup, self._setup.ground, self._setup.fleet
        weights, team, most_robots = None, float(len(robots)), math.inf
        if self.division is not None:
            weights = _with_margin(self.division.divisions.zoned)  # free choices are not bound to the ground of a zone
        else:
            team /= len(fleet.roster) / fleet.team
            most_robots = most_planned(len(laid_out.points) * ground.terrain.point_area, ground.sight.range_m)
        stations = KnownStations(setup, laid_out, laid_out.stations, weights)
        return JointPlan(setup, laid_out, stations, self._free, robots, team, most_robots)

    def _round_of(self, divisions: Divisions, group: Group) -> Round:
        return divisions.zoned.rounds[group.classes]  # what weighs more is visited more often without being there twice


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
