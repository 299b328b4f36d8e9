"""The common plan: a patrol of point robots that every robot simulates, and in which it takes its own part.

Ground, roster, speeds, key and time are known to all, so all find the same plan without a message. What is heard does
not change it, and what is lost does not part it. In the plan, point robots drive the shortest ways as fast as the
bodies do, and see a little less far (`BESIDE_STRIDES`), so that what they see is seen in fact too.

- *Stations* (`patrol.tours.round`) are to be visited, each by one robot.
- The *routes* of all robots together lead to every station. They cost the sum of the eighth powers of the stations'
  ages when they are visited. So old stations weigh most, and no station is put off for ever.
- *The draw*: once a robot has seen its station, the routes are compared in which it goes to each of the near ones next.
  Each is improved by small moves (`agent.kernels.plan`). One is drawn; the less it is behind the best, the likelier.
- A *visit* is what a robot does from one draw to the next: it drives towards a place, and sees points on the way.

For example, the best routes cost 40.0 s (the root of their cost) and begin with the first of three stations; with the
second one first they would cost 0.2 s more, with the third one 2 s. With a spread of 0.4 s they are drawn with 62, 38
and 0 %. So the ground stays fresh, and an intruder that has watched for long is left to guess where the robot turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import compare, guess_ways, improve, oldest_ages, take_stale, weighted_ages
from agent.policies.pursuit import STILL_STALE
from patrol.ground.footprint import REMEMBERED
from patrol.ground.ways import framed
from patrol.kernels.ways import FAR, is_clear, way_between
from patrol.own_sensor import make_footprint
from patrol.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from patrol.scenario import RobotSpec
    from patrol.tours.round import Flat, Round, Stations

SPREAD = 0.22
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

NEAR = 8
"""Stations that moves put beside each other are at most so many nearest ones apart."""

BESIDE_STRIDES, BESIDE_TURNS = 0.0, 0.8
"""How much less far the plan's robots see: in strides, as bodies see from where a tick ends, and for cars in turning
radii, as they drive beside the way."""

LEAST_SIGHT = 0.5
"""Lower bound of what they see, as a share of the sensor's range."""

DEVIATION = 2.0
SLACK = 0.97
TURNING_RADII = 0.5
"""Way that a body which does not move sideways loses for each radian by which it turns, in radii of the body."""

MEMORY = 2.0
"""Time for which visits are remembered, in times between two robots on the tour."""

NO_WAY_M = 1e6
"""Length that stands for no way at all, m."""

NO_WEIGHTS = np.zeros((0, 0))
"""Given to the kernels where all points count the same."""

Routes = NDArray[np.int64]
Ages = NDArray[np.float64]


class Visit:
    """A visit of one robot in the plan, and the points that it saw in it which were stale."""

    __slots__ = ("before", "begun", "ended", "points", "station", "then", "trail")

    def __init__(self, station: int, begun: int) -> None:
        self.station = station
        self.begun = begun  # tick
        self.trail: list[Spot] = []  # x and y in m after each tick of it
        self.ended: int | None = None  # tick at which its points were seen; None until then
        self.points: Flat = np.zeros(0, dtype=np.int64)  # flat indices
        self.before: NDArray[np.int64] = self.points  # the ticks at which they had been seen before
        self.then: Visit | None = None  # the robot's next visit


class KnownStations:
    """The stations of a round, and the ways between them."""

    def __init__(self, laid_out: Round, stations: Stations, weights: NDArray[np.float64] | None) -> None:
        """Find which are near; ``weights`` (height, width) are None where all points count the same."""
        self.stations, self.points, self.stands = stations, laid_out.points, laid_out.stands
        self.length_m = laid_out.length_m
        self.number_of = np.full(stations.around.size, -1, dtype=np.int64)  # by flat index, among those of the round
        self.number_of[self.points] = np.arange(self.points.size)
        self.apart_m = np.ascontiguousarray(np.minimum(stations.apart_m, NO_WAY_M))
        nearest = np.argsort(self.apart_m, axis=1, kind="stable")
        # Each station is the nearest to itself.
        self.near = np.ascontiguousarray(nearest[:, 1 : NEAR + 1] if len(nearest) > 1 else nearest)
        self.weights = NO_WEIGHTS if weights is None else weights / weights.reshape(-1)[self.points].min()

    def __len__(self) -> int:
        return len(self.stations.spots)

    def span(self, station: int) -> slice:
        """Return where the points of a station are among those of the round."""
        return slice(*self.stations.begins[station : station + 2].tolist())


@dataclass(slots=True)
class Planned:
    """A robot in the plan."""

    spec: RobotSpec
    place: Spot  # x and y in m
    visit: Visit
    corners: list[Spot] = field(default_factory=list)  # of the rest of its way, the last one first
    course: float | None = None  # direction in which it last drove, rad
    lost_m: float = 0.0  # way that it has still to make up for, by corners and turns
    age_s: float = 0.0  # weighted age of its station when it was drawn
    oldest: int = 0  # number in the round of the station's oldest point, when all were looked at last
    taken: list[NDArray[np.int64]] = field(default_factory=list)  # the stale points that it has seen in its visit


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
        stride_m = max(spec.speed for spec in robots) * self._step
        turns_m = max((spec.turning_radius for spec in robots if spec.model == "car"), default=0.0)
        range_m = setup.ground.sight.range_m
        sight_m = max(range_m - BESIDE_STRIDES * stride_m - BESIDE_TURNS * turns_m, LEAST_SIGHT * range_m)
        sensor = prepared.scenario.sensor.model_copy(update={"range": sight_m})
        self._sight = make_footprint(sensor, self._terrain, REMEMBERED)
        self._full_sight = make_footprint(prepared.scenario.sensor, self._terrain, REMEMBERED)
        widest = max(robots, key=lambda spec: spec.radius)
        self._open = framed(prepared.fields[widest.number].reach)
        self._lengths = np.full(self._open.shape, FAR, dtype=np.int32)
        self._queues = np.empty((2, self._open.size, 2), dtype=np.int32)
        self._way = np.empty(self._open.size, dtype=np.int32)
        self._tracked = np.zeros(self._terrain.shape, dtype=np.bool_)
        self._tracked.flat[known.points] = True
        self._seen = np.zeros(self._terrain.shape, dtype=np.int32)
        self._witnesses = np.full((len(known), 2), -1, dtype=np.int64)
        self._taken = np.empty((2, len(known.points)), dtype=np.int64)
        self._routes = np.zeros((len(robots), len(known)), dtype=np.int64)
        self._counts = np.zeros(len(robots), dtype=np.int64)
        places = [(start.x, start.y) for start in (prepared.starts[spec.number - 1] for spec in robots)]
        if origin > 0:
            places = self._spread(len(robots))
        self.robots = [
            Planned(spec, place, Visit(-1, origin)) for spec, place in zip(robots, places, strict=True)
        ]
        self._least_s = 0.0
        for row, robot in enumerate(self.robots):
            self._look(row, robot)
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
        for row, robot in enumerate(self.robots):
            self._drive(robot)
            robot.visit.trail.append(robot.place)
            self._look(row, robot)
        arrived = [row for row, robot in enumerate(self.robots) if self._is_done(robot)]
        if arrived:
            self._draw_stations(arrived)
            oldest = self.tick - MEMORY * self.interval_s / self._step
            for number, visit in self._visits.items():
                while visit.then is not None and visit.ended is not None and visit.ended < oldest:
                    visit = visit.then
                self._visits[number] = visit

    def _spread(self, robots: int) -> list[Spot]:
        """Put robots at equal distances on the round, whose points were seen as they would have passed them."""
        known = self._known
        heads = [known.span(row * len(known) // robots).start for row in range(robots)]
        turn = len(known.points)
        for number, head in enumerate(heads):
            end = heads[(number + 1) % robots] or turn
            ahead = np.arange(head, end)
            # What lies right before the next robot was seen last by that one, and so is freshest.
            shares = (end - ahead) / max(end - head, 1)
            ticks = self.tick - np.ceil(shares * self.interval_s / self._step).astype(np.int64)
            self._seen.flat[known.points[ahead]] = np.maximum(ticks, 0)
        return [self._terrain.centre(*divmod(int(known.stands[head]), self._terrain.width)) for head in heads]

    def _drive(self, robot: Planned) -> None:
        """Drive on for a tick, straight: not round a corner from before which nothing leads straight to behind it."""
        begun, has_turned = self._cell(robot.place), False
        remaining_m, robot.lost_m = SLACK * robot.spec.speed * self._step - robot.lost_m, 0.0
        while robot.corners and remaining_m > 0.0:
            (x, y), (to_x, to_y) = robot.place, robot.corners[-1]
            away_m = math.hypot(to_x - x, to_y - y)
            if away_m > 0.0 and robot.spec.model != "holonomic":
                course = math.atan2(to_y - y, to_x - x)
                if robot.course is not None:
                    turn = abs(math.remainder(course - robot.course, math.tau))
                    remaining_m -= TURNING_RADII * robot.spec.radius * turn
                robot.course = course
            share = min(max(remaining_m, 0.0) / away_m, 1.0) if away_m > 0.0 else 1.0
            place = x + share * (to_x - x), y + share * (to_y - y)
            if has_turned and not is_clear(self._open, begun, self._cell(place)):
                return
            robot.place = place
            remaining_m -= away_m
            if share == 1.0:
                robot.corners.pop()
                has_turned = away_m > 0.0
            elif robot.spec.model != "holonomic":
                remaining_m = min(remaining_m + (1.0 - share) * away_m, 0.0)
        if robot.spec.model != "holonomic":
            robot.lost_m = max(-remaining_m, 0.0)

    def _cell(self, place: Spot) -> int:
        """Return the flat index, in the framed ground, of the point on which a place lies."""
        row, col = self._terrain.nearest_point(*place)
        return (row + 1) * self._open.shape[1] + col + 1

    def _look(self, row: int, robot: Planned) -> None:
        """Note what a robot sees, and what of it was stale."""
        sight = self._sight if robot.corners else self._full_sight
        view = sight.visible(Pose(*robot.place, 0.0))
        least = self._least_s / self._step
        x, y = robot.place
        bx, by = robot.visit.trail[-2] if len(robot.visit.trail) > 1 else (x, y)
        d = math.hypot(bx - x, by - y)
        share = min(1.0, DEVIATION * robot.spec.radius / d) if d > 0 and robot.corners else 0.0
        other = sight.visible(Pose(x + share * (bx - x), y + share * (by - y), 0.0))
        window = view.mask, view.row0, view.col0, other.mask, other.row0, other.col0
        count = take_stale(*window, self._tracked, self._known.weights, self.tick, least, self._seen, self._taken)
        if count:
            robot.taken.append(self._taken[:, :count].copy())

    def _is_done(self, robot: Planned) -> bool:
        """Return True if a robot's station has been seen, or if it has got there."""
        span = self._known.span(robot.visit.station)
        if robot.corners and self._is_stale(robot, self._ages_s(slice(robot.oldest, robot.oldest + 1))):
            return False
        ages = self._ages_s(span)
        robot.oldest = span.start + int(ages.argmax())
        if not self._is_stale(robot, ages):
            return True
        if robot.corners:
            return False
        # Another part of the station is seen from elsewhere; what is not seen from where it should be counts as seen.
        stands = self._known.stands[span]
        here = self._terrain.nearest_point(*robot.place)
        is_here = stands == here[0] * self._terrain.width + here[1]
        unseen = self._known.points[span][is_here & (ages > self._least_s)]
        robot.taken.append(np.stack([unseen, self._seen.flat[unseen]]))
        self._seen.flat[unseen] = self.tick
        ages[is_here] = 0.0
        if not self._is_stale(robot, ages):
            return True
        robot.oldest = span.start + int(ages.argmax())
        self._send(robot)
        return False

    def _is_stale(self, robot: Planned, ages: Ages) -> bool:
        age_s = float(ages.max())
        return age_s >= STILL_STALE * robot.age_s and age_s > self._least_s

    def _ages_s(self, some: slice) -> Ages:
        """Return the weighted ages of some of the round's points, s; 0 for those in view."""
        points = self._known.points[some]
        ages = np.empty(points.size)
        seen = self._seen
        weighted_ages(points, self._tracked, seen, seen, self._known.weights, self.tick, self._step, ages)
        return ages

    def _oldest_s(self) -> Ages:
        """Return the weighted age of the oldest point of each station, s."""
        known, begins = self._known, self._known.stations.begins
        if known.weights.size:
            return np.maximum.reduceat(self._ages_s(slice(None)), begins[:-1])
        ages = np.empty(len(known))
        at = self.tick, self._step, self._witnesses
        oldest_ages(known.points, begins, self._tracked, self._seen, *at, ages)
        return ages

    def _leads_s(self) -> NDArray[np.float64]:
        """Return about how long each robot takes to each station, float64 (robots, stations), s."""
        stations, places = self._known.stations, [robot.place for robot in self.robots]
        around = np.array([stations.around[self._terrain.nearest_point(*place)] for place in places], dtype=np.int64)
        spots = np.array([self._terrain.centre(*divmod(spot, self._terrain.width)) for spot in stations.spots.tolist()])
        ways = np.empty((len(places), len(self._known)))
        guess_ways(np.array(places), around, spots, self._known.apart_m, NO_WAY_M, 1.0, ways)
        return np.ascontiguousarray(ways * self._paces[:, None])

    def _begin(self) -> None:
        """Make the first routes: always the robot that is free first goes to the best station that is left."""
        ages, leads = self._oldest_s(), self._leads_s()
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
        ages, leads = self._oldest_s(), self._leads_s()
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
                self._routes, self._counts, pinned, row, choices, *inputs, MOVES, self._make_seed(), plans, counts, costs
            )
            # The least cost after Gumbel noise: a choice is drawn with the weight exp(-cost / spread).
            drawn = int((costs + self._spread_s * self._draw_chances(choices)).argmin())
            self._routes, self._counts = plans[drawn].copy(), counts[drawn].copy()
            # The robots that draw after it plan with this choice.
            pinned[row] = True
            robots[row].age_s = float(ages[choices[drawn]])
        for row in drawing:
            self._begin_visit(robots[row], int(self._routes[row, 0]))

    def _begin_visit(self, robot: Planned, station: int) -> None:
        """End a robot's visit, and send it to another station."""
        before, span = robot.visit, self._known.span(station)
        before.ended = self.tick
        if robot.taken:
            before.points, before.before = np.concatenate(robot.taken, axis=1)
            robot.taken = []
        robot.oldest = span.start + int(self._ages_s(span).argmax())
        robot.visit = before.then = Visit(station, self.tick)
        self._send(robot)

    def _send(self, robot: Planned) -> None:
        """Send a robot to where the oldest point of its station is seen from."""
        stand = divmod(int(self._known.stands[robot.oldest]), self._terrain.width)
        first, last = self._cell(robot.place), self._cell(self._terrain.centre(*stand))
        count = way_between(self._open, first, last, self._lengths, self._queues, self._way)
        cells = [divmod(cell, self._open.shape[1]) for cell in self._way[1:count].tolist()]
        robot.corners = [self._terrain.centre(row - 1, col - 1) for row, col in reversed(cells)]

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
