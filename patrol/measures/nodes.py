"""Measures of the literature on the vertices of a graph: idleness in both families, interference, entropy.

A vertex is visited when a robot is within a tolerance of it, or passes by so close from one tick to the next
(`patrol.graph.graph.Graph.visit_reach`). Its *idleness* is the time since its last visit, and since tick 0 before the
first.

- *Over time* (M2Bench, MAEPS): the mean and the greatest idleness over vertices, averaged over all ticks, or the
  greatest of all.
- *Over visits* (patrolling_sim, and Portugal's papers with it): each vertex's mean of the idleness that its visits end,
  the first one left out; then the mean, the greatest, the median and the deviation over vertices. A vertex that is not
  visited again counts nothing there, so starving it improves these numbers: `once` says how many there are.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.graph.graph import VISIT_M, graph_of
from patrol.journal.records import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from patrol.graph.graph import Graph
    from patrol.journal.records import Header, TickRecord

CLOSE_M = 2.0
"""Two robots that are nearer than this interfere with each other (patrolling_sim)."""

AGAIN_S = 10.0
"""Time within which the same two robots interfere only once (patrolling_sim)."""

RETURNS = (0, 10, 25, 50, 75, 90, 100)
"""Percentages of the distribution of return times."""


class NodeTotals:
    """The running measures on the vertices of a scenario's graph; see `figures`."""

    def __init__(self, graph: Graph, reach: Mapping[int, float], step: float) -> None:
        """Start before the first tick.

        Args:
            graph: The graph.
            reach: Distance within which each robot visits a vertex, m, by number.
            step: Length of a tick, s.
        """
        self._graph = graph
        self._reach = reach
        self._step = step
        self._last: NDArray[np.float64] = np.zeros(graph.size)
        self._intervals: list[list[float]] = [[] for _ in range(graph.size)]
        self._visits = [0] * graph.size
        self._mean: list[float] = []
        self._worst: list[float] = []
        self._places: dict[int, tuple[float, float]] = {}
        self._inside: dict[int, set[int]] = {}
        self._at: dict[int, int] = {}
        self._moves: Counter[tuple[int, int]] = Counter()
        self._close: dict[tuple[int, int], float] = {}
        self._interference = 0

    def tick(self, record: TickRecord) -> None:
        """Add the next tick."""
        now = record.k * self._step
        here: dict[int, tuple[float, float]] = {}
        for row in record.robots:
            if row.status is Status.ALIVE:
                here[row.number] = row.x, row.y
        for number, place in here.items():
            self._visit(number, place, now)
        self._interfere(here, now)
        self._places = here
        idle = now - self._last
        self._mean.append(float(idle.mean()))
        self._worst.append(float(idle.max()))

    def _visit(self, number: int, place: tuple[float, float], now: float) -> None:
        """Note the vertices that a robot visits in a tick; one that it does not leave is visited all the time."""
        visited = self._graph.within(self._places.get(number, place), place, self._reach[number])
        before = self._inside.get(number, set())
        for vertex in visited:
            if vertex not in before:
                if self._visits[vertex]:
                    self._intervals[vertex].append(now - float(self._last[vertex]))
                self._visits[vertex] += 1
                if (at := self._at.get(number)) is not None and at != vertex:
                    self._moves[at, vertex] += 1
                self._at[number] = vertex
            self._last[vertex] = now
        self._inside[number] = set(visited)

    def _interfere(self, here: Mapping[int, tuple[float, float]], now: float) -> None:
        numbers = sorted(here)
        for index, first in enumerate(numbers):
            for second in numbers[index + 1 :]:
                if math.dist(here[first], here[second]) >= CLOSE_M:
                    continue
                if now - self._close.get((first, second), -math.inf) > AGAIN_S:
                    self._interference += 1
                    self._close[first, second] = now

    def figures(self) -> dict[str, Any] | None:
        """Return the measures so far; None before the first tick."""
        if not self._mean:
            return None
        means = [statistics.fmean(each) for each in self._intervals if each]
        pooled = [interval for each in self._intervals for interval in each]
        half = len(self._worst) // 2
        minutes = len(self._mean) * self._step / 60.0
        return {
            "vertices": self._graph.size,
            "visits": sum(self._visits),
            "least_visits": min(self._visits),
            "unvisited": sum(visits == 0 for visits in self._visits),
            "once": sum(visits > 0 and not each for visits, each in zip(self._visits, self._intervals, strict=True)),
            "idleness_mean_s": statistics.fmean(self._mean),
            "idleness_late_s": statistics.fmean(self._mean[half:]),
            "idleness_end_s": self._mean[-1],
            "worst_mean_s": statistics.fmean(self._worst),
            "worst_s": max(self._worst),
            "worst_late_s": max(self._worst[half:]),
            "worst_end_s": self._worst[-1],
            "visits_mean_s": statistics.fmean(means) if means else None,
            "visits_worst_s": max(means) if means else None,
            "visits_median_s": statistics.median(means) if means else None,
            "visits_deviation_s": statistics.pstdev(means) if means else None,
            "return_s": [float(value) for value in np.percentile(pooled, RETURNS)] if pooled else [],
            "interference": self._interference,
            "interference_per_min": self._interference / minutes,
            "entropy_bits": _entropy_rate(self._moves),
        }


def _entropy_rate(moves: Mapping[tuple[int, int], int]) -> float | None:
    """Return how unpredictable the next vertex is, bits per move, given the one that a robot comes from."""
    total = sum(moves.values())
    if not total:
        return None
    begun: Counter[int] = Counter()
    for (begin, _), count in moves.items():
        begun[begin] += count
    return -sum(count * math.log2(count / begun[begin]) for (begin, _), count in moves.items()) / total


def node_totals(header: Header) -> NodeTotals | None:
    """Make the measures for a run; None where its scenario has no graph.

    Args:
        header: Of the run's journal.
    """
    scenario = header.scenario
    given = scenario["terrain"].get("graph")
    if given is None:
        return None
    places, edges = ([tuple(entry) for entry in given[key]] for key in ("vertices", "edges"))
    graph = graph_of(places, edges, visit=given.get("visit", VISIT_M))
    step = float(scenario["step"])
    entries = scenario["robots"]
    speeds = [robots["speed"] for robots in (entries if isinstance(entries, list) else [entries] * len(header.robots))]
    reach = {robot.number: graph.visit_reach(speed, step) for robot, speed in zip(header.robots, speeds, strict=True)}
    return NodeTotals(graph, reach, step)
