"""Patrols that assign vertices to robots one task at a time.

Source: Farinelli, Iocchi and Nardi, "Distributed on-line dynamic task assignment for multi-robot patrolling"
(Autonomous Robots 2017), for DTAG and DTAP. Their robots exchange idleness, requests and bids. Here each robot works
out from the positions that it hears what the others would answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agent.policies.rivals.graph_patrol import GraphPatrol
from agent.policies.rivals.known import Known

DISTANCE = 0.75
"""Weight of the way in pixels against idleness in s (DTAG)."""

HOME = 5.0
"""Weight of the distance to the robot's start in m (DTAG)."""

HOPS = 2.0
"""Weight of the number of edges, times the number of vertices, against idleness in s (DTAP)."""

STALE = 2.0
"""Standard deviations above the mean from which a vertex counts as very stale (DTAP)."""


class GreedyAssignment(GraphPatrol):
    """DTAG: the vertex with the best sum of idleness, way and distance to the robot's start, that nobody else takes."""

    _home: int | None = None

    def route(self, known: Known) -> Sequence[int]:
        """Choose the vertex with the greatest I - 0.75 d - 5 |v - start|."""
        graph = known.graph
        if self._home is None:
            self._home = known.at
        taken = set(known.aims.values())
        home = graph.places[self._home]
        vertices = [vertex for vertex in known.reached if vertex not in taken] or known.reached
        scores = [
            float(known.idleness[vertex])
            - DISTANCE * known.length(vertex) / graph.pixel
            - HOME * float(np.hypot(*(graph.places[vertex] - home)))
            for vertex in vertices
        ]
        return graph.way(known.at, known.pick(vertices, scores)) if vertices else [known.at]


class AuctionAssignment(GraphPatrol):
    """DTAP: takes the best vertex for which no other robot would bid less."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose by I - 2 hops |V|; a bid is the way to the vertex.

        A vertex that another robot is nearer to is taken all the same where it is a neighbour and very stale.
        """
        graph, idle = known.graph, known.idleness
        vertices = known.reached
        if not vertices:
            return [known.at]
        taken = set(known.aims.values())
        stale = float(idle.mean() + STALE * idle.std())
        score = {v: float(idle[v]) - HOPS * float(graph.hops[known.at, v]) * graph.size for v in vertices}
        for vertex in sorted(vertices, key=lambda v: (-score[v], v)):
            others = [float(graph.lengths[other.at, vertex]) for other in known.others.values()]
            if vertex not in taken and known.length(vertex) <= min(others, default=np.inf):
                return graph.way(known.at, vertex)
            if vertex in known.neighbours and float(idle[vertex]) > stale and vertex not in taken:
                return graph.way(known.at, vertex)
        return graph.way(known.at, max(vertices, key=lambda v: (score[v], -v)))
