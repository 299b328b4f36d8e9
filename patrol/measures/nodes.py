"""Measures of the literature on the vertices of a graph: idleness in both families, interference, entropy.

A vertex is visited when a robot is within a tolerance of it, or passes by so close from one tick to the next
(`patrol.graph.Graph.visit_reach`). Its *idleness* is the time since its last visit, and since tick 0 before the
first.

- *Over time* (M2Bench, MAEPS): the mean and the greatest idleness over vertices, averaged over all ticks, or the
  greatest of all.
- *Over visits* (patrolling_sim, and Portugal's papers with it): each vertex's mean of the idleness that its visits end,
  the first one left out; then the mean, the greatest, the median and the deviation over all vertices. A vertex that is
  not visited again has a mean of 0 there, so starving it improves these numbers: `unvisited` and `once` name those.
  The same over all visits, whatever their vertices, are the return times.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.graph import VISIT_M, graph_of
from patrol.journal.records import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from patrol.graph import Graph
    from patrol.journal.records import Header, TickRecord

CLOSE_M = 2.0
"""A robot interferes with one of a lower number that is no farther away than this (patrolling_sim)."""

AGAIN_S = 10.0
"""Time for which a robot does not interfere again (patrolling_sim)."""

RETURNS = (0, 10, 25, 50, 75, 90, 100)
"""Percentages of the distribution of return times."""

WORDS = {
    **dict.fromkeys(("random", "cr", "hcr", "hpcc", "tour", "partition", "ahpa"), (0, 0)),
    "gbs": (3, 0),
    **dict.fromkeys(("sebs", "cbls", "er", "mns"), (4, 0)),
    **dict.fromkeys(("dtag", "dtap"), (3, 1)),
}
"""Words of 16 bits that the original of a policy sends to the others at each arrival, and more for each vertex."""


@dataclass(frozen=True, slots=True)
class Visit:
    """A robot's visit to a vertex."""

    at_s: float  # when it began
    robot: int
    vertex: int
    idle_s: float  # the idleness that it ended
    first: bool  # whether it is the vertex's first one
    interference: int  # interferences of all robots until then


class NodeTotals:
    """The running measures on the vertices of a scenario's graph; see `figures`."""

    def __init__(self, graph: Graph, reach: Mapping[int, float], step: float, policy: str = "") -> None:
        """Start before the first tick, with each robot's reach in m by number (`Graph.visit_reach`)."""
        self.visits: list[Visit] = []
        self.interfered_s: list[float] = []  # when robots interfered with each other
        self.vertices = graph.size
        self._graph = graph
        self._reach = reach
        self._step = step
        self._policy = policy
        self._last: NDArray[np.float64] = np.zeros(graph.size)
        self._mean: list[float] = []
        self._worst: list[float] = []
        self._places: dict[int, tuple[float, float]] = {}
        self._inside: dict[int, set[int]] = {}
        self._at: dict[int, int] = {}
        self._moves: Counter[tuple[int, int]] = Counter()
        self._visited: set[int] = set()
        self._interfered: dict[int, float] = {}

    def tick(self, record: TickRecord) -> None:
        """Add the next tick."""
        now = record.k * self._step
        here: dict[int, tuple[float, float]] = {}
        for row in record.robots:
            if row.status is Status.ALIVE:
                here[row.number] = row.x, row.y
        self._note_interference(here, now)
        for number, position in here.items():
            self._note_visit(number, position, now)
        self._places = here
        idle = now - self._last
        self._mean.append(float(idle.mean()))
        self._worst.append(float(idle.max()))

    def _note_visit(self, number: int, place: tuple[float, float], now: float) -> None:
        """Note the vertices that a robot visits in a tick; one that it does not leave is visited all the time."""
        visited = self._graph.within(self._places.get(number, place), place, self._reach[number])
        before = self._inside.get(number, set())
        for vertex in visited:
            if vertex not in before:
                idle_s, first = now - float(self._last[vertex]), vertex not in self._visited
                self.visits.append(Visit(now, number, vertex, idle_s, first, len(self.interfered_s)))
                self._visited.add(vertex)
                if (previous := self._at.get(number)) is not None and previous != vertex:
                    self._moves[previous, vertex] += 1
                self._at[number] = vertex
            self._last[vertex] = now
        places = self._graph.places
        self._inside[number] = {vertex for vertex in visited if math.dist(places[vertex], place) <= self._reach[number]}

    def _note_interference(self, here: Mapping[int, tuple[float, float]], now: float) -> None:
        for number, position in here.items():
            if now - self._interfered.get(number, -math.inf) < AGAIN_S:
                continue
            if any(
                neighbour < number and math.dist(position, other_position) <= CLOSE_M
                for neighbour, other_position in here.items()
            ):
                self.interfered_s.append(now)
                self._interfered[number] = now

    def intervals(self) -> list[list[float]]:
        """Return the idleness that visits to each vertex ended, without the first one, s."""
        ended: list[list[float]] = [[] for _ in range(self.vertices)]
        for visit in self.visits:
            if not visit.first:
                ended[visit.vertex].append(visit.idle_s)
        return ended

    def figures(self) -> dict[str, Any] | None:
        """Return the measures so far; None before the first tick."""
        if not self._mean:
            return None
        counts = Counter(visit.vertex for visit in self.visits)
        intervals = self.intervals()
        means = [statistics.fmean(series) if series else 0.0 for series in intervals]
        pooled = [interval for series in intervals for interval in series]
        half = len(self._worst) // 2
        minutes = len(self._mean) * self._step / 60.0
        return {
            "vertices": self.vertices,
            "visits": len(self.visits),
            "least_visits": min(counts[vertex] for vertex in range(self.vertices)),
            "unvisited": [vertex for vertex in range(self.vertices) if counts[vertex] == 0],
            "once": [vertex for vertex in range(self.vertices) if counts[vertex] == 1],
            "idleness_mean_s": statistics.fmean(self._mean),
            "idleness_late_s": statistics.fmean(self._mean[half:]),
            "idleness_end_s": self._mean[-1],
            "worst_mean_s": statistics.fmean(self._worst),
            "worst_s": max(self._worst),
            "worst_late_s": max(self._worst[half:]),
            "worst_end_s": self._worst[-1],
            "visits_mean_s": statistics.fmean(means) if pooled else None,
            "visits_worst_s": max(means) if pooled else None,
            "visits_median_s": statistics.median(means) if pooled else None,
            "visits_deviation_s": statistics.pstdev(means) if pooled else None,
            "return_s": [float(value) for value in np.percentile(pooled, RETURNS)] if pooled else [],
            "return_mean_s": statistics.fmean(pooled) if pooled else None,
            "return_deviation_s": statistics.pstdev(pooled) if pooled else None,
            "interference": len(self.interfered_s),
            "interference_per_min": len(self.interfered_s) / minutes,
            "entropy_bits": _entropy_rate(self._moves),
            "original_bytes": self._original_bytes(),
        }

    def _original_bytes(self) -> int | None:
        """Return the bytes that the policy's original would have sent at these visits; None for other policies."""
        words = WORDS.get(self._policy)
        return None if words is None else 2 * (words[0] + words[1] * self.vertices) * len(self.visits)


def _entropy_rate(moves: Mapping[tuple[int, int], int]) -> float | None:
    """Return how unpredictable the next vertex is, bits per move, given the one that a robot comes from."""
    total = sum(moves.values())
    if not total:
        return None
    begun: Counter[int] = Counter()
    for (begin, _), count in moves.items():
        begun[begin] += count
    bits = sum(count * math.log2(count / begun[begin]) for (begin, _), count in moves.items())
    return (0.0 - bits) / total  # not -bits, which is -0.0 where every move is certain


def node_totals(header: Header) -> NodeTotals | None:
    """Make the measures for a run; None where its scenario has no graph."""
    scenario = header.scenario
    spec = scenario["terrain"].get("graph")
    if spec is None:
        return None
    places, edges = ([tuple(entry) for entry in spec[key]] for key in ("vertices", "edges"))
    graph = graph_of(places, edges, visit=spec.get("visit", VISIT_M))
    step = float(scenario["step"])
    entries = scenario["robots"]
    speeds = [robots["speed"] for robots in (entries if isinstance(entries, list) else [entries] * len(header.robots))]
    reach = {robot.number: graph.visit_reach(speed, step) for robot, speed in zip(header.robots, speeds, strict=True)}
    return NodeTotals(graph, reach, step, scenario["patrol"]["policy"])
