"""Reactive patrols that go to a neighbour, and those that look at the whole graph.

*Conscientious* patrols (CR, HCR, HPCC) know the robot's own visits alone, as their papers have it.

Sources: Machado, Ramalho, Zucker and Drogoul, "Multi-agent patrolling: an empirical analysis of alternative
architectures" (MABS 2002), for CR; Almeida et al., "Recent advances on multi-agent patrolling" (SBIA 2004), for HPCC;
Portugal and Rocha, "Multi-robot patrolling algorithms: examining performance and scalability" (Advanced Robotics 2013),
for HCR.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np

from experiments.rivals.graph_patrol import GraphPatrol
from experiments.rivals.known import Known


class RandomWalk(GraphPatrol):
    """Goes to any neighbour, each as likely as the others."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose a neighbour at random."""
        return [known.pick(known.neighbours, [0.0] * len(known.neighbours))]


class ConscientiousReactive(GraphPatrol):
    """CR: goes to the neighbour that it has not visited for longest itself; it does not listen to others."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest idleness by this robot's own visits."""
        return [known.pick(known.neighbours, [float(known.own_idleness[vertex]) for vertex in known.neighbours])]


class HeuristicConscientiousReactive(GraphPatrol):
    """HCR: the neighbour with the best sum of idleness and nearness, each by its maximum over the neighbours."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest (w_max - w) / w_max + I / I_max."""
        lengths = [known.length(vertex) for vertex in known.neighbours]
        idle = [float(known.own_idleness[vertex]) for vertex in known.neighbours]
        longest, stalest = max(lengths) or 1.0, max(idle) or 1.0
        scores = [(longest - w) / longest + age / stalest for w, age in zip(lengths, idle, strict=True)]
        return [known.pick(known.neighbours, scores)]


class HeuristicPathfinder(GraphPatrol):
    """HPCC: goes to the vertex with the best sum of idleness and nearness, by a way over stale vertices."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the vertex with the greatest (d_max - d) / d_max + I / I_max, and the way there."""
        idle, vertices = known.own_idleness, known.reached
        if not vertices:
            return [known.at]
        stalest, farthest = float(idle.max()) or 1.0, max(known.length(vertex) for vertex in vertices)
        scores = [(farthest - known.length(vertex)) / farthest + float(idle[vertex]) / stalest for vertex in vertices]
        return stale_way(known, known.pick(vertices, scores), stalest)


def stale_way(known: Known, goal: int, stalest: float) -> list[int]:
    """Find the way to a vertex with the least sum of (I_max - I_j) / I_max + (w_ij - w_min) / (w_max - w_min).

    It begins after the vertex where the robot is, and ends with the goal. ``stalest`` is I_max, s.
    """
    graph, idle = known.graph, known.own_idleness
    lengths = [length for row in graph.edges for _, length in row]
    shortest, span = min(lengths), (max(lengths) - min(lengths)) or 1.0
    costs, before, heap = {known.at: 0.0}, {known.at: known.at}, [(0.0, known.at)]
    while heap:
        cost, vertex = heapq.heappop(heap)
        if vertex == goal:
            break
        if cost > costs[vertex]:
            continue
        for neighbour, length in graph.edges[vertex]:
            total = cost + (stalest - float(idle[neighbour])) / stalest + (length - shortest) / span
            if total < costs.get(neighbour, np.inf):
                costs[neighbour], before[neighbour] = total, vertex
                heapq.heappush(heap, (total, neighbour))
    way = [goal]
    while before[way[-1]] != known.at:
        way.append(before[way[-1]])
    return way[::-1]


class Greedy(GraphPatrol):
    """Goes to the vertex with the greatest idleness per way."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the vertex with the greatest I / d."""
        vertices = known.reached
        if not vertices:
            return [known.at]
        return [known.pick(vertices, [float(known.idleness[v]) / known.length(v) for v in vertices])]
