"""Patrols on closed tours: one for all, evenly spaced or not, or one for each robot.

Sources: Chevaleyre, "Theoretical analysis of the multi-agent patrolling problem" (IAT 2004), for tours and partitions;
Goeckner et al., "Attrition-aware adaptation for multi-agent patrolling" (Robotics and Automation Letters 2024), for
AHPA. A tour is the shortest that 2-opt and Or-opt find, by the ways of the graph.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from experiments.rivals.graph_patrol import GraphPatrol
from experiments.rivals.known import Known
from patrol.graph import closed_tour, tour_length

if TYPE_CHECKING:
    from agent.ports import PolicySetup


class Tour(GraphPatrol):
    """Follows one tour with all others, in one direction, from where it is: spacing is left to chance."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.tour: list[int] = []
        self._next = 0

    def plan(self, known: Known) -> None:
        """Find the tour through all vertices that a way leads to."""
        self.tour = closed_tour(known.graph, [known.at, *known.reached])
        self._next = self.tour.index(known.at)

    def route(self, known: Known) -> Sequence[int]:
        """Go to the next vertex of the tour; at the start, to the one where the robot is."""
        if not self.tour:
            self.plan(known)
        else:
            self._next = (self._next + 1) % len(self.tour)
        return [self.tour[self._next]]


class EvenTour(Tour):
    """Follows one tour with all others, evenly spaced.

    In an evenly spaced patrol of n robots a vertex that the tour leads to once has been visited T / n before, T being
    the time of a round. A robot that finds it visited later than that is too close to the one before it, and waits for
    the difference. So gaps become equal; they close after a death, and open for a newcomer.
    """

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self._once: set[int] = set()
        self._round_s = 0.0
        self._passed: dict[int, tuple[float, float]] = {}
        self._waited_s = 0.0
        self._until_s = 0.0
        self._waiting_at = -1

    def plan(self, known: Known) -> None:
        """Find the tour, and the vertices to wait at."""
        super().plan(known)
        walk = [v for index, vertex in enumerate(self.tour) for v in known.graph.way(self.tour[index - 1], vertex)]
        self._once = {vertex for vertex, times in Counter(walk).items() if times == 1}
        self._round_s = tour_length(known.graph, self.tour) / self.speed

    def route(self, known: Known) -> Sequence[int]:
        """Wait where the vertex was visited too lately, and then go to the next one."""
        if self.tour and known.at == self.tour[self._next] and known.at in self._once:
            self._come_to(known)
        if known.now_s < self._until_s:
            return ()
        return super().route(known)

    def _come_to(self, known: Known) -> None:
        """Take note of the time of the last round, and of how long to wait."""
        if self._waiting_at == known.at:
            return
        self._waiting_at = known.at
        if (last := self._passed.get(known.at)) is not None:
            self._round_s = known.now_s - last[0] - (self._waited_s - last[1])
        short_s = self._round_s / (1 + len(known.others)) - float(known.found_s[known.at])
        self._passed[known.at] = known.now_s, self._waited_s
        self._until_s = known.now_s + max(short_s, 0.0)
        self._waited_s += max(short_s, 0.0)


class OwnTours(GraphPatrol):
    """A patrol in which each robot follows a tour through vertices of its own; `cell` says which those are."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self._homes: dict[int, int] = {}
        self._team: frozenset[int] = frozenset()
        self._tour: list[int] = []
        self._next = 0

    def cell(self, known: Known, homes: dict[int, int]) -> list[int]:
        """Return the vertices of this robot.

        ``homes`` has the vertices at which the living robots were first heard, by robot number; only robots that are on
        the same connected part of the graph.
        """
        raise NotImplementedError

    def route(self, known: Known) -> Sequence[int]:
        """Go to the next vertex of the own tour; the tour is made anew when a robot comes or goes."""
        living = frozenset({known.number, *known.others})
        self._homes.setdefault(known.number, known.at)
        for number, rival in known.others.items():
            self._homes.setdefault(number, rival.at)
        if living != self._team:
            self._team = living
            part = {known.at, *known.reached}
            homes = {number: self._homes[number] for number in sorted(living) if self._homes[number] in part}
            cell = [vertex for vertex in self.cell(known, homes) if vertex in part]
            self._tour = closed_tour(known.graph, cell or [known.at])
            self._next = min(range(len(self._tour)), key=lambda at: known.length(self._tour[at])) - 1
        self._next = (self._next + 1) % len(self._tour)
        return [self._tour[self._next]]


class VoronoiTours(OwnTours):
    """AHPA: each robot follows a tour through the vertices that are nearest to its start.

    The original's tour is by Christofides' method. A robot that is silent counts as gone.
    """

    def cell(self, known: Known, homes: dict[int, int]) -> list[int]:
        """Return the vertices to whose starts no other robot's is nearer; of equal ones the lower number's."""
        lengths = known.graph.lengths
        return [
            vertex
            for vertex in range(known.graph.size)
            if min((float(lengths[home, vertex]), number) for number, home in homes.items())[1] == known.number
        ]


class PartitionTours(OwnTours):
    """Each robot follows a tour through a stretch of the common tour; all stretches are equally long."""

    def cell(self, known: Known, homes: dict[int, int]) -> list[int]:
        """Cut the common tour into as many stretches as there are robots, and give them out in the order of starts."""
        tour = closed_tour(known.graph, [known.at, *known.reached])
        lengths = known.graph.lengths
        along = np.cumsum([0.0, *[float(lengths[a, b]) for a, b in pairwise(tour)]])
        lap = float(along[-1] + lengths[tour[-1], tour[0]]) or 1.0
        order = sorted(homes, key=lambda number: (tour.index(homes[number]), number))
        begin = float(along[tour.index(homes[order[0]])])
        own_part = order.index(known.number)
        return [
            vertex
            for vertex, distance in zip(tour, along.tolist(), strict=True)
            if min(math.floor((distance - begin) % lap / lap * len(order)), len(order) - 1) == own_part
        ]
