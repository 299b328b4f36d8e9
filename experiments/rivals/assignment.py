"""Patrols that assign vertices to robots one task at a time.

Source: Farinelli, Iocchi and Nardi, "Distributed on-line dynamic task assignment for multi-robot patrolling"
(Autonomous Robots 2017), for DTAG and DTAP. Their robots exchange idleness, requests and bids. Here each robot works
out from the positions that it hears what the others would answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experiments.rivals.graph_patrol import GraphPatrol
from experiments.rivals.known import Known

if TYPE_CHECKING:
    from agent.ports import PolicySetup

DISTANCE = 0.75
"""Weight of the way in pixels against idleness in s (DTAG)."""

HOME = 5.0
"""Weight of the distance to the robot's start in m (DTAG)."""

IDLE_AT_FIRST_S = 100.0
"""Idleness of every vertex at the start, s (DTAG)."""

HOPS = 2.0
"""Weight of the number of edges, times the number of vertices, against idleness in s (DTAP).

The same times the number of vertices is the idleness of every vertex at the start, s.
"""

STALE = 2.0
"""Standard deviations above the mean from which a vertex counts as very stale (DTAP)."""


class GreedyAssignment(GraphPatrol):
    """DTAG: of the vertices that no other robot takes, the best by idleness, way and distance to the robot's start."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.known.visited_s[:] = -IDLE_AT_FIRST_S
        self._home: tuple[float, float] | None = None

    def route(self, known: Known) -> Sequence[int]:
        """Choose the vertex with the greatest I - 0.75 d - 5 |v - start|."""
        graph = known.graph
        if self._home is None:
            self._home = known.place
        aims = set(known.aims.values())
        vertices = [vertex for vertex in known.reached if vertex not in aims] or known.reached
        scores = [
            float(known.idleness[vertex])
            - DISTANCE * known.length(vertex) / graph.pixel
            - HOME * float(np.hypot(*(graph.places[vertex] - self._home)))
            for vertex in vertices
        ]
        return graph.way(known.at, known.pick(vertices, scores)) if vertices else [known.at]


class AuctionAssignment(GraphPatrol):
    """DTAP: takes the best vertex for which no other robot would bid less.

    A robot's bid for a vertex is its way from the centre of the robot's tasks, times one more than their number; for
    the vertex that it is going to it is 0. The winners of tasks are not sent here: a robot's tasks are the vertices
    that it visited last, and the one that it is going to. The original keeps the least bid made for a vertex so far,
    and plans one vertex ahead.
    """

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.known.visited_s[:] = -HOPS * self.known.graph.size

    def route(self, known: Known) -> Sequence[int]:
        """Choose by I - 2 hops |V|, and by bids.

        A vertex that another robot bids less for is taken all the same where it is a neighbour and very stale, and no
        robot bids 0. A robot that wins none goes to the best one that no other robot is going to.
        """
        graph, idle = known.graph, known.idleness
        vertices = known.reached
        if not vertices:
            return [known.at]
        aims = set(known.aims.values())
        stale = float(idle.mean() + STALE * idle.std())
        score = {v: float(idle[v]) - HOPS * float(graph.hops[known.at, v]) * graph.size for v in vertices}
        own_bids = bids(known, known.number, known.at)
        other_bids = [bids(known, number, rival.at, rival.aim) for number, rival in known.others.items()]
        lowest = np.min(other_bids, axis=0) if other_bids else np.full(graph.size, np.inf)
        ordered = sorted(vertices, key=lambda v: (-score[v], v))
        for vertex in ordered:
            if own_bids[vertex] <= lowest[vertex] and vertex not in aims:
                return graph.way(known.at, vertex)
            if vertex in known.neighbours and float(idle[vertex]) > stale and lowest[vertex] > 0.0:
                return graph.way(known.at, vertex)
        return graph.way(known.at, next((vertex for vertex in ordered if vertex not in aims), ordered[0]))


def bids(known: Known, number: int, at: int, aim: int | None = None) -> NDArray[np.float64]:
    """Return what a robot would bid for each vertex, m, by the knowledge of the robot that asks.

    ``at`` is the vertex that it visited last, ``aim`` the one that it is going to, None where that is not known.
    """
    tasks = set(np.flatnonzero(known.visitor == number).tolist()) | (set() if aim is None else {aim})
    lengths = known.graph.lengths
    centre = min({at, *tasks}, key=lambda v: (float(lengths[v, sorted(tasks)].sum()), v != at, v))
    bid: NDArray[np.float64] = lengths[centre] * (len(tasks) + 1)
    if aim is not None:
        bid[aim] = 0.0
    return bid
