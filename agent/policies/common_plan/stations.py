"""The stations of a round, the ways between them, and the groups of robots that share them.

In a large fleet groups of neighbours plan for themselves, each on a stretch of the round, so that what a robot works
out does not grow with the fleet. The roster says who is in which group. When half of a group is lost, all that live
are put into groups anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from agent.kernels.plan import oldest_ages, weighted_ages
from patrol.latest import latest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from agent.policies.common_plan.turns import Turns
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import RobotSpec
    from patrol.tours.round import Round

NEAR = 8
"""Stations that moves put beside each other are at most so many nearest ones apart."""

NO_WAY_M = 1e6
"""Length that stands for no way at all, m."""

MOST_TOGETHER = 16
"""Robots of the largest group that plans together."""

STATIONS_TOGETHER = 2_000
"""About how many stations a group plans at most where there are enough robots."""

MOST_DIVISIONS = 4
"""Divisions of the robots into groups that are kept, such as that of all while one is silent."""

Ages = NDArray[np.float64]

FindWays = Callable[[NDArray[np.int64]], NDArray[np.float64]]
"""Returns how long the way from each to each of some points is, m, by their flat indices."""

FindTurns = Callable[[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]], "Turns"]
"""Returns the turns on the ways (m) between some points, by their flat indices, and the headings there, rad."""

NO_WEIGHTS = np.zeros(0)
"""Given to the kernels where all points count the same."""


class KnownStations:
    """The stations of a round, or of a stretch of it, and the ways between them."""

    def __init__(
        self,
        laid_out: Round,
        find_ways: FindWays,
        weights: NDArray[np.float64] | None = None,
        find_turns: FindTurns | None = None,
    ) -> None:
        """Take those of a round; ``weights`` (height, width) are None where all points count alike."""
        self.points, self.stands, self.length_m = laid_out.points, laid_out.stands, laid_out.length_m
        self.spots, self.begins, self.around = laid_out.spots, laid_out.begins, laid_out.around
        # In which each point is seen from its stand, rad; NaN: towards it. None for any heading.
        self._headings: NDArray[np.float64] | None = None
        if laid_out.headings.size:
            of_place = laid_out.headings[laid_out.place_of]
            self._headings = np.where(self.stands == laid_out.places[laid_out.place_of], of_place, np.nan)
        self.first = 0  # number in the round of the first point
        # Of each point; and by how much the weighted age of each station grows in a second, by its heaviest point.
        self.weights, self.rates = NO_WEIGHTS, np.ones(len(self))
        if weights is not None and len(self):
            self.weights = weights.reshape(-1)[self.points]
            self.rates = np.maximum.reduceat(self.weights, self.begins[:-1])
            # So most stations count as without weights, and draws are as far behind the best as there.
            usual = np.sort(self.rates)[(len(self) - 1) // 2]
            self.weights, self.rates = self.weights / usual, self.rates / usual
        self.drawings: dict[tuple[int, ...], Any] = {}  # of some robots on them
        self._find_ways, self._known_ways_m, self._find_turns = find_ways, laid_out.apart_m, find_turns

    @cached_property
    def ways_m(self) -> NDArray[np.float64]:
        """Length of the way from each station to each, m."""
        ways_m = self._known_ways_m if len(self._known_ways_m) == len(self) else self._find_ways(self.spots)
        return np.ascontiguousarray(np.minimum(ways_m, NO_WAY_M))

    @cached_property
    def turns(self) -> Turns | None:
        """The turns on these ways; None where they cost nothing."""
        if self._headings is None or self._find_turns is None:
            return None
        # The stops of a station look in nearly the same direction.
        first = np.array([self._heading_at(station) for station in range(len(self))])
        return self._find_turns(self.ways_m, self.spots, first)

    def _heading_at(self, station: int) -> float:
        assert self._headings is not None
        headings = self._headings[self.span(station)]
        known = headings[~np.isnan(headings)]
        return float(known[0]) if known.size else math.nan

    @cached_property
    def apart_m(self) -> NDArray[np.float64]:
        """Length of these ways with the turns on them, m."""
        return self.ways_m if self.turns is None else np.minimum(self.ways_m + self.turns.between_m, NO_WAY_M)

    @cached_property
    def near(self) -> NDArray[np.int64]:
        """The nearest stations of each."""
        nearest = np.argsort(self.apart_m, axis=1, kind="stable")
        # Each station is the nearest to itself.
        return np.ascontiguousarray(nearest[:, 1 : NEAR + 1] if len(nearest) > 1 else nearest)

    def __len__(self) -> int:
        return len(self.spots)

    def heading_of(self, index: int, stand: int) -> float | None:
        """Return the heading, rad, in which a point is seen from a stand; None towards the point, or for any."""
        if self._headings is None or self.stands[index] != stand or math.isnan(self._headings[index]):
            return None
        return float(self._headings[index])

    def span(self, station: int) -> slice:
        """Return where the points of a station are among those of the round."""
        return slice(*self.begins[station : station + 2].tolist())

    def stretch(self, first: int, until: int) -> KnownStations:
        """Return some stations in a row as if there were no others."""
        part = object.__new__(KnownStations)
        points = slice(int(self.begins[first]), int(self.begins[until]))
        part.points, part.stands, part.spots = self.points[points], self.stands[points], self.spots[first:until]
        part.begins = self.begins[first : until + 1] - self.begins[first]
        part._headings = None if self._headings is None else self._headings[points]
        is_within = (self.around >= first) & (self.around < until)
        part.around = np.where(is_within, self.around - np.int32(first), np.int32(-1))
        part.length_m = self.length_m * (until - first) / len(self)
        part.rates, part.weights = self.rates[first:until], self.weights[points]
        part.first, part.drawings = self.first + points.start, {}
        part._find_ways, part._known_ways_m = self._find_ways, self._known_ways_m[first:until, first:until]
        part._find_turns = self._find_turns
        return part


class StationAges:
    """The ages of the stations, by when each point was last seen."""

    def __init__(self, known: KnownStations, step: float) -> None:
        """Keep what tells at most looks how old a station is; ``step`` is in s per tick."""
        self._known, self._step = known, step
        self._counted: NDArray[np.bool_] | None = None
        self._witnesses = np.empty((len(known), 2), dtype=np.int64)

    def of_points(self, some: slice, tick: int, counted: NDArray[np.bool_], last_seen: NDArray[np.int32]) -> Ages:
        """Return the weighted ages of some of the round's points, s; 0 for those that do not count, and in view."""
        points = self._known.points[some]
        ages = np.empty(points.size)
        weights = self._known.weights[some] if self._known.weights.size else NO_WEIGHTS
        weighted_ages(points, counted, last_seen, weights, tick, self._step, ages)
        return ages

    def of_stations(self, tick: int, counted: NDArray[np.bool_], last_seen: NDArray[np.int32]) -> Ages:
        """Return the weighted age of the oldest point of each station, s."""
        known = self._known
        if known.weights.size:
            return np.maximum.reduceat(self.of_points(slice(None), tick, counted, last_seen), known.begins[:-1])
        if counted is not self._counted:
            self._counted, self._witnesses[:] = counted, -1
        ages = np.empty(len(known))
        oldest_ages(known.points, known.begins, counted, last_seen, tick, self._step, self._witnesses, ages)
        return ages


class Group(NamedTuple):
    """Robots that plan together, and the stations that they share."""

    robots: frozenset[int]
    known: KnownStations


class Groups:
    """The groups of the robots on a round."""

    def __init__(
        self, known: KnownStations, roster: Sequence[RobotSpec], starts: Sequence[Pose], terrain: Terrain
    ) -> None:
        """Take all robots, whose starts are in the order of their numbers."""
        self.known = known
        rows, cols = np.divmod(known.spots, terrain.width)
        self._speeds = {spec.number: spec.speed for spec in roster}
        self._first_station = {}
        for spec, start in zip(roster, starts, strict=True):
            row, col = terrain.nearest_point(start.x, start.y)
            self._first_station[spec.number] = int(((rows - row) ** 2 + (cols - col) ** 2).argmin())
        self._divided: dict[frozenset[int], list[Group]] = {}
        # A robot whose group is found anew goes on with the same stretch, whatever the others of its process ask for.
        self._stretches: WeakValueDictionary[tuple[int, int], KnownStations] = WeakValueDictionary()

    def find(self, number: int, team: frozenset[int], living: frozenset[int]) -> Group:
        """Return the group of a robot that lives, with those of its robots that live.

        ``team`` are the robots that there are when all live.
        """
        groups = self._divide(team or living)
        if not living <= team or any(2 * len(group.robots & living) <= len(group.robots) for group in groups):
            groups = self._divide(living)
        group = next(group for group in groups if number in group.robots)
        return Group(group.robots & living, group.known)

    def _divide(self, robots: frozenset[int]) -> list[Group]:
        return latest(self._divided, robots, lambda: self._divide_anew(robots), MOST_DIVISIONS)

    def _divide_anew(self, robots: frozenset[int]) -> list[Group]:
        """Give groups of robots that start in a row stations in a row, as much weight as they have speed."""
        fewest = math.ceil(len(robots) / MOST_TOGETHER), math.ceil(len(self.known) / STATIONS_TOGETHER)
        count = min(max(fewest), len(robots))
        if count == 1:
            return [Group(robots, self.known)]
        numbers = sorted(robots, key=lambda number: (self._first_station[number], number))
        ends = [(index + 1) * len(numbers) // count for index in range(count)]
        passed = np.cumsum([self._speeds[number] for number in numbers])
        weighed = np.cumsum([0.0, *self.known.rates])
        shares = [weighed[-1] * passed[end - 1] / passed[-1] for end in ends]
        untils = [round(float(np.interp(share, weighed, np.arange(weighed.size)))) for share in shares]
        groups = []
        for begin, end, first, until in zip([0, *ends], ends, [0, *untils], untils, strict=False):
            known = self._stretches.setdefault((first, until), self.known.stretch(first, until))
            groups.append(Group(frozenset(numbers[begin:end]), known))
        return groups
