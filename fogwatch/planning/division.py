"""A division of the ground among robots, with one closed tour for each.

The time between two visits of a robot that has ground of its own is the time of its tour, so the longest tour is to be
short. It is found in three steps:

1. *On a graph* (`patrol.graph`), whose vertices together see all of the ground. The common tour through
   them is cut into stretches of equal lengths. Then single vertices move to other robots as long as that lowers the sum
   of `POWER`-th powers of the tours' lengths, which the longest tour dominates.
2. *On the ground.* A point goes to a robot that has a vertex from which it is seen, and of several to the one with the
   shortest tour. The tour of each robot's ground is searched for as the common one is (`patrol.tours.search`).
3. *Relief.* The robot with the longest tour gives away what others see on their tours anyway, and its tour is searched
   for anew, until that no longer shortens it.

The first step is repeated with other places to cut the common tour at. The best few divisions of the graph are tried on
the ground, and the best of these is kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.graph import closed_tour, graph_from_ground, tour_length
from patrol.measures.best_tour import own_grounds
from patrol.prepare import sensor_footprint
from patrol.tours.cover import Looks
from patrol.tours.round import Tour
from patrol.tours.search import SAMPLES, find_tour

if TYPE_CHECKING:
    from patrol.graph import Graph
    from patrol.ground.fields import StaticFields
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import BoolGrid, Terrain
    from patrol.measures.best_tour import OwnGround
    from patrol.prepare import Prepared

POWER = 8.0
"""Power of the tours' lengths in the sum that moves of vertices lower."""

OFFSETS = 6
"""Number of places, within one stretch, from which the common tour is cut."""

TRIED = 3
"""How many of the divisions of the graph are tried on the ground, the best first."""

GAIN_M = 0.01
"""Least gain in length of a search that is repeated, m."""


@dataclass(frozen=True, eq=False, slots=True)
class Territory:
    """The ground of one robot."""

    ground: BoolGrid  # (height, width), patrolled points that the robot is to see
    tour: Tour  # closed; all of the ground is seen on it


class Divider:
    """Divides the ground of one body among fleets of different sizes.

    A graph is made once for each ground; all fleets that start on it share it.
    """

    def __init__(self) -> None:
        """Know no graph yet."""
        self._graphs: dict[bytes, Graph] = {}

    def divide(self, prepared: Prepared) -> tuple[Territory, ...] | None:
        """Divide the ground among all robots of a fleet.

        The robots must have one body, and a sensor that looks all around and leaves no age. The territories do not
        overlap and together are all patrolled ground; they are fewer than the robots where some have nothing to do.
        None where the ground of one robot is too large for a tour.
        """
        fields, terrain = prepared.fields[1], prepared.terrain
        footprint = sensor_footprint(prepared.scenario, terrain)
        key = np.packbits(fields.reach).tobytes()
        if key not in self._graphs:
            self._graphs[key] = graph_from_ground(terrain, fields, footprint)
        grounds = own_grounds(prepared)
        robots: dict[int, int] = {}
        for ground in grounds.values():
            robots[id(ground)] = robots.get(id(ground), 0) + 1
        territories: list[Territory] = []
        for ground in {id(ground): ground for ground in grounds.values()}.values():
            search = _Search(terrain, footprint, fields, ground)
            some = search.divide(self._graphs[key], robots[id(ground)])
            if some is None:
                return None
            territories += some
        return tuple(territories)


def seen_along(terrain: Terrain, footprint: Footprint, tour: Tour) -> BoolGrid:
    """Return all points that are seen on a tour, (height, width), by a sensor that looks all around."""
    looks = Looks(terrain, footprint)
    visible = np.zeros(terrain.shape, dtype=np.bool_)
    stride = max(SAMPLES * footprint.range_m, terrain.point)
    for (x, y), (to_x, to_y) in pairwise([*tour.way, tour.way[0]]):
        count = max(1, math.ceil(math.dist((x, y), (to_x, to_y)) / stride))
        for share in np.arange(count) / count:
            row, col = terrain.point_at(x + share * (to_x - x), y + share * (to_y - y))
            rows, cols, mask = looks.window(row * terrain.width + col, 1)
            visible[rows, cols] |= mask
    return visible


class _Search:
    """The search for the territories on one connected part of the ground."""

    def __init__(self, terrain: Terrain, footprint: Footprint, fields: StaticFields, own: OwnGround) -> None:
        self._terrain = terrain
        self._footprint = footprint
        self._proxy = fields.proxy
        self._own = own

    def divide(self, graph: Graph, robots: int) -> list[Territory] | None:
        """Divide the part among some robots; None if it is too large for a tour."""
        points = [self._terrain.point_at(*spot) for spot in graph.places.tolist()]
        vertices = [vertex for vertex, (row, col) in enumerate(points) if self._own.reach[row, col]]
        divisions: dict[frozenset[frozenset[int]], list[list[int]]] = {}
        for offset in range(OFFSETS if robots > 1 else 1):
            tours = shared_out(graph, vertices, robots, offset / OFFSETS)
            divisions.setdefault(frozenset(frozenset(tour) for tour in tours), tours)
        best: list[Territory] | None = None
        for tours in sorted(divisions.values(), key=lambda tours: _longest_of(graph, tours))[:TRIED]:
            tours.sort(key=lambda tour: tour_length(graph, tour))
            territories = self._on_the_ground([[points[vertex] for vertex in tour] for tour in tours])
            if territories is None:
                return None
            if best is None or longest_m(territories) < longest_m(best):
                best = territories
        return best

    def _on_the_ground(self, tours: list[list[tuple[int, int]]]) -> list[Territory] | None:
        """Find the territories of robots that can see all ground from some points, given as rows and columns."""
        looks = Looks(self._terrain, self._footprint)
        remaining = self._own.patrolled.copy()
        territories = []
        for tour in tours:
            ground = np.zeros(self._terrain.shape, dtype=np.bool_)
            for row, col in tour:
                rows, cols, mask = looks.window(row * self._terrain.width + col, 1)
                ground[rows, cols] |= mask & remaining[rows, cols]
            remaining &= ~ground
            territory = self._with_tour(ground)
            if territory is None:
                return None
            territories.append(territory)
        return self._relieve_longest([territory for territory in territories if territory.ground.any()])

    def _with_tour(self, ground: BoolGrid) -> Territory | None:
        if not ground.any():
            return Territory(ground, Tour(0.0, ()))
        tour = find_tour(self._terrain, self._own.reach, ground, self._proxy, self._footprint)
        return None if tour is None else Territory(ground, tour)

    def _relieve_longest(self, territories: list[Territory]) -> list[Territory]:
        """Let the robot with the longest tour give away ground that others see, until that shortens it no more."""
        visible = [seen_along(self._terrain, self._footprint, territory.tour) for territory in territories]
        while len(territories) > 1:
            longest = max(range(len(territories)), key=lambda at: territories[at].tour.length_m)
            old = territories[longest]
            remaining = old.ground.copy()
            gains: dict[int, BoolGrid] = {}
            for at in range(len(territories)):
                if at != longest:
                    gains[at] = remaining & visible[at]
                    remaining &= ~visible[at]
            shorter = self._with_tour(remaining)
            if shorter is None or shorter.tour.length_m > old.tour.length_m - GAIN_M:
                return territories
            for at, ground in gains.items():
                territories[at] = Territory(territories[at].ground | ground, territories[at].tour)
            if not remaining.any():
                del territories[longest], visible[longest]
                continue
            territories[longest] = shorter
            visible[longest] = seen_along(self._terrain, self._footprint, shorter.tour)
        return territories


def longest_m(territories: Sequence[Territory]) -> float:
    """Return the length of the longest tour of some territories, m."""
    return max(territory.tour.length_m for territory in territories)


def shared_out(graph: Graph, vertices: list[int], robots: int, offset: float = 0.0) -> list[list[int]]:
    """Share vertices of a graph out among robots so that the longest of their closed tours is short.

    There must be at least one vertex, and ways between all of them. `offset` is where the common tour is first cut, 0
    to 1, in stretches of it. Robots without vertices are left out of the result.

    Example: four vertices in a line, 10 m apart, and two robots give [[0, 1], [2, 3]], two tours of 20 m.
    """
    tours = _Tours(graph, _cut_stretches(graph, closed_tour(graph, vertices), robots, offset))
    tours.improve()
    return [tour for tour in tours.tours if tour]


def _longest_of(graph: Graph, tours: list[list[int]]) -> float:
    return max(tour_length(graph, tour) for tour in tours)


def _cut_stretches(graph: Graph, tour: list[int], count: int, offset: float) -> list[list[int]]:
    """Cut a closed tour into stretches of equal lengths, the first from a share of a stretch on."""
    along = np.cumsum([0.0, *(float(graph.lengths[a, b]) for a, b in pairwise(tour))])
    lap = float(along[-1] + graph.lengths[tour[-1], tour[0]]) or 1.0
    stretch = np.floor(along / lap * count - offset).astype(np.int64) % count
    return [[vertex for vertex, part in zip(tour, stretch, strict=True) if part == number] for number in range(count)]


class _Tours:
    """Closed tours through vertices of a graph, between which vertices move.

    `tours` has the vertices of each in order, `lengths` their lengths in m.
    """

    def __init__(self, graph: Graph, groups: list[list[int]]) -> None:
        self._graph = graph
        self.tours = [closed_tour(graph, group) if group else [] for group in groups]
        self.lengths = [tour_length(graph, tour) for tour in self.tours]

    def improve(self) -> None:
        """Move the vertex that lowers the sum of powers most, until none does."""
        while (move := self._best_move()) is not None:
            vertex, giver, taker, position = move
            self._set_tour(giver, [member for member in self.tours[giver] if member != vertex])
            self._set_tour(taker, [*self.tours[taker][:position], vertex, *self.tours[taker][position:]])

    def _best_move(self) -> tuple[int, int, int, int] | None:
        """Return a vertex, the robot that gives it, the one that takes it, and its place in that tour."""
        best, move = 0.0, None
        powers = [length**POWER for length in self.lengths]
        for giver, tour in enumerate(self.tours):
            if not tour:
                continue
            vertices = np.array(tour)
            before, after = np.roll(vertices, 1), np.roll(vertices, -1)
            lengths = self._graph.lengths
            saved = lengths[before, vertices] + lengths[vertices, after] - lengths[before, after]
            less = np.maximum(self.lengths[giver] - saved, 0.0) ** POWER - powers[giver]
            for taker, taker_tour in enumerate(self.tours):
                if taker == giver:
                    continue
                detour, positions = self._tour_detours(vertices, taker_tour)
                change = less + (self.lengths[taker] + detour) ** POWER - powers[taker]
                first = int(change.argmin())
                if change[first] < best - 1e-9 * sum(powers):
                    best, move = float(change[first]), (tour[first], giver, taker, int(positions[first]))
        return move

    def _tour_detours(
        self, vertices: NDArray[np.int64], tour: list[int]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return for each vertex how much longer a tour becomes with it, m, and where it is put in."""
        if not tour:
            return np.zeros(len(vertices)), np.zeros(len(vertices), dtype=np.int64)
        after = np.array(tour)
        before = np.roll(after, 1)
        lengths = self._graph.lengths
        longer = lengths[np.ix_(vertices, before)] + lengths[np.ix_(vertices, after)] - lengths[before, after]
        positions = longer.argmin(axis=1)
        return longer[np.arange(len(vertices)), positions], positions

    def _set_tour(self, number: int, tour: list[int]) -> None:
        """Set a tour, in the given order or in a shorter one."""
        again = closed_tour(self._graph, tour) if tour else []
        self.tours[number] = min((tour, again), key=lambda tour: tour_length(self._graph, tour))
        self.lengths[number] = tour_length(self._graph, self.tours[number])
