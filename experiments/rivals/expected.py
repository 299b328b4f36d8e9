"""Patrols that weigh idleness against distance and the plans of others, one vertex ahead.

Sources: Yan and Zhang, "Multi-robot patrol: a distributed algorithm based on expected idleness" (International Journal
of Advanced Robotic Systems 2016), for ER; Ward, Richards and Hunt (arXiv 2412.11916), for MNS.
"""

from __future__ import annotations

from collections.abc import Sequence

from experiments.rivals.graph_patrol import GraphPatrol
from experiments.rivals.known import Known

MNS = (
    (0.41935197, -1.036573603, -0.21384633),
    (1.02416510, -0.262816527, 2.57125805),
    (-0.43140551, -0.027082452, 0.48526923),
)
"""Weights of idleness and of distance, and the slope below 0, of each of the three parts of MNS."""

TAKEN = 999.0
"""Subtracted for each other robot that is going to a vertex (MNS)."""


class ExpectedReactive(GraphPatrol):
    """ER: the neighbour with the greatest idleness to be expected at the arrival, per travel time."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest |t - L| / (t - now).

        t is the robot's arrival there, and L the vertex's last visit, or the last arrival of the robots that are going
        there.
        """
        arrivals: dict[int, float] = {}
        for rival in known.others.values():
            if rival.aim is not None:
                distance = float(((known.graph.places[rival.aim] - rival.place) ** 2).sum()) ** 0.5
                arrivals[rival.aim] = max(arrivals.get(rival.aim, 0.0), known.now_s + distance / self.speed)
        scores = []
        for vertex in known.neighbours:
            takes = max(known.length(vertex) / self.speed, self.step)
            last = arrivals.get(vertex, float(known.visited_s[vertex]))
            scores.append(abs(known.now_s + takes - last) / takes)
        return [known.pick(known.neighbours, scores)]


class MinimalNetwork(GraphPatrol):
    """MNS: a small network of idleness and distance, which its authors found by optimisation."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the best sum over three parts; a robot alone looks at the whole graph."""
        graph = known.graph
        alone = not known.others
        if not known.reached:
            return [known.at]
        candidates = known.reached if alone else known.neighbours
        stalest, farthest = float(known.idleness.max()) or 1.0, max(known.length(v) for v in known.reached)
        aims = list(known.aims.values())
        scores = []
        for vertex in candidates:
            idle, away = float(known.idleness[vertex]) / stalest, known.length(vertex) / farthest
            parts = ((a * idle + b * away, slope) for a, b, slope in MNS)
            scores.append(sum(x if x > 0.0 else slope * x for x, slope in parts) - TAKEN * aims.count(vertex))
        goal = known.pick(candidates, scores)
        return [graph.step(known.at, goal)] if alone else [goal]
