"""Patrols that choose a neighbour by Bayes' rule.

Sources: Portugal and Rocha, "Distributed multi-robot patrol: a scalable and fault-tolerant framework" (Robotics and
Autonomous Systems 2013), for GBS and SEBS; "Cooperative multi-robot patrol with Bayesian learning" (Autonomous Robots
2016), for CBLS. Constants are those of the authors' program patrolling_sim.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pydantic import Field

from experiments.rivals.graph_patrol import GraphOptions, GraphPatrol
from experiments.rivals.known import Known

if TYPE_CHECKING:
    from agent.ports import PolicySetup

G1 = 0.1
OWN_SHARE = 0.75
"""Weight of a vertex's own mean idleness in CBLS's prior; the rest is its best neighbour's."""

LEAST, MOST = 0.5, 2.0
"""Bounds of CBLS's counts of arcs."""


class GainOptions(GraphOptions):
    """Settings of GBS and SEBS."""

    g2: float = Field(100.0, gt=0.0, description="gain from which a choice counts fully; patrolling_sim has a table")
    edge_min: float = Field(1.0, gt=0.0, description="pixels, the least length of an edge that counts")


class GreedyBayesian(GraphPatrol):
    """GBS: the neighbour with the greatest gain, which is its idleness per length of the edge."""

    Options = GainOptions
    options: GainOptions

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest G1 exp(ln(1 / G1) / G2 gain)."""
        return [known.pick(known.neighbours, [self.chance(known, vertex) for vertex in known.neighbours])]

    def chance(self, known: Known, vertex: int) -> float:
        """Return the probability of going to a neighbour, as far as its gain decides it."""
        pixels = max(known.length(vertex) / known.graph.pixel, self.options.edge_min)
        gain = float(known.idleness[vertex]) / pixels
        return 1.0 if gain >= self.options.g2 else G1 * math.exp(math.log(1.0 / G1) / self.options.g2 * gain)


class StateExchangeBayesian(GreedyBayesian):
    """SEBS: as GBS, but the less likely the more others are going there."""

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest product of GBS's chance and 2^(n - k) / (2^n - 1)."""
        aims, n = Counter(known.aims.values()), known.team
        scores = [
            self.chance(known, vertex) * (2.0 ** (n - aims[vertex]) / (2.0**n - 1.0) if aims[vertex] else 1.0)
            for vertex in known.neighbours
        ]
        return [known.pick(known.neighbours, scores)]


class ConcurrentBayesianLearning(GraphPatrol):
    """CBLS: learns which arcs lead to vertices that are visited too seldom.

    The rule is the paper's: patrolling_sim takes every candidate for the least and the most visited one.
    """

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self._arcs: dict[tuple[int, int], float] = {
            (vertex, neighbour): 1.0 for vertex, row in enumerate(self.known.graph.edges) for neighbour, _ in row
        }
        self._last: tuple[int, list[int], float] | None = None

    def route(self, known: Known) -> Sequence[int]:
        """Choose the neighbour with the greatest prior times likelihood, among those that no other robot goes to."""
        self._learn_arcs(known)
        aims = set(known.aims.values())
        candidates = [vertex for vertex in known.neighbours if vertex not in aims]
        if not candidates:  # then nothing beyond counts either
            candidates, aims = known.neighbours, set(range(known.graph.size))
        if candidates == [known.at]:
            return candidates
        prior = [self._prior_gain(known, vertex, aims) for vertex in candidates]
        total = sum(self._arcs.values())
        scores = [p * self._arcs[known.at, v] / total for p, v in zip(prior, candidates, strict=True)]
        best = max(scores)
        equal = [(known.length(v), v) for v, score in zip(candidates, scores, strict=True) if score == best]
        entropy = _choice_entropy(scores)
        self._last = (known.at, candidates, entropy) if len(candidates) > 1 else None
        return [min(equal)[1]]

    def _prior_gain(self, known: Known, vertex: int, aims: set[int]) -> float:
        """Weigh the mean idleness of a vertex, this visit included, with that of its best free neighbour."""
        means = known.mean_idleness
        mean = float(means[vertex])
        best = max(
            (float(means[neighbour]) for neighbour, _ in known.graph.edges[vertex] if neighbour not in aims),
            default=0.0,
        )
        if len(known.graph.edges[vertex]) == 1 or best == 0.0:
            return mean
        return OWN_SHARE * mean + (1.0 - OWN_SHARE) * best

    def _learn_arcs(self, known: Known) -> None:
        """Reward the arc to the candidate that was visited least for its degree, and punish that to the most visited.

        Of several that were visited least the stalest is rewarded, and of several visited most the freshest punished.
        """
        if self._last is None:
            return
        begin, candidates, entropy = self._last
        share = {vertex: int(known.visits[vertex]) / len(known.graph.edges[vertex]) for vertex in candidates}
        idle = {vertex: float(known.idleness[vertex]) for vertex in candidates}
        seldom = [vertex for vertex in candidates if share[vertex] == min(share.values())]
        often = [vertex for vertex in candidates if share[vertex] == max(share.values())]
        stalest, freshest = max(idle[vertex] for vertex in seldom), min(idle[vertex] for vertex in often)
        for vertex in candidates:
            sign = 0
            if vertex in often and idle[vertex] == freshest:
                sign = -1
            elif vertex in seldom and idle[vertex] == stalest:
                sign = 1
            changed = self._arcs[begin, vertex] + sign * (1.0 - entropy)
            self._arcs[begin, vertex] = min(max(changed, LEAST), MOST)


def _choice_entropy(scores: Sequence[float]) -> float:
    """Return the entropy of a choice as a share of the greatest possible."""
    total = sum(scores)
    if len(scores) < 2 or total <= 0.0:
        return 1.0
    shares = [score / total for score in scores if score > 0.0]
    return -sum(share * math.log(share) for share in shares) / math.log(len(scores))
