"""Intruder games on a finished run: on any point of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.replay.replay import play
from monitor.replay.run import Run
from patrol.graph.graph import graph_of, visit_reach
from patrol.ground.fog import Fog
from patrol.ground.footprint import View
from patrol.measures.intruders import Successes, intruder_games

MOST_POINTS = 2000
"""Points of the ground that are played on; of more, every so many are taken, row by row."""


@dataclass(frozen=True, slots=True)
class Games:
    """The games on a run.

    Attributes:
        points: How many points of the ground were played on.
        ground: On these; a point is seen when it is in a robot's view.
        vertices: How many vertices the graph has; 0 without one.
        nodes: On these; a vertex is visited when a robot comes close (`patrol.graph.graph.visit_reach`).
    """

    points: int
    ground: list[Successes]
    vertices: int
    nodes: list[Successes]


class _Looks:
    """Writes down which points are in view in each tick, while a run is replayed."""

    def __init__(self, patrolled: NDArray[np.bool_], ticks: int) -> None:
        every = np.flatnonzero(patrolled)
        self._rows, self._cols = np.divmod(every[:: -(-len(every) // MOST_POINTS)], patrolled.shape[1])
        self.seen = np.zeros((ticks, len(self._rows)), dtype=np.bool_)

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - a Watcher gets it
        """See `Watcher`."""
        for view in views:
            rows, cols = self._rows - view.row0, self._cols - view.col0
            near = (rows >= 0) & (cols >= 0) & (rows < view.mask.shape[0]) & (cols < view.mask.shape[1])
            self.seen[k, near] |= view.mask[rows[near], cols[near]] != 0

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`."""


def games_of(run: Run, attacks_s: Sequence[float]) -> Games:
    """Play the games on a run.

    Args:
        run: The run.
        attacks_s: Durations of attacks, s.
    """
    looks = _Looks(run.prepared.patrolled, run.ticks)
    play(run, [looks])
    visited = _visits(run)
    return Games(
        looks.seen.shape[1],
        intruder_games(looks.seen, run.step, attacks_s),
        visited.shape[1],
        intruder_games(visited, run.step, attacks_s) if visited.shape[1] else [],
    )


def _visits(run: Run) -> NDArray[np.bool_]:
    """bool (ticks, v), whether a robot visits each vertex of the scenario's graph in each tick."""
    given = run.prepared.scenario.terrain.graph
    if given is None:
        return np.zeros((run.ticks, 0), dtype=np.bool_)
    graph = graph_of(given.vertices, given.edges, given.pixel)
    visited = np.zeros((run.ticks, graph.size), dtype=np.bool_)
    reach = {spec.number: visit_reach(spec.speed, run.step) for spec in run.prepared.scenario.roster}
    before: dict[int, tuple[float, float]] = {}
    for k in range(run.ticks):
        here = {number: (pose.x, pose.y) for number, pose in run.alive(k)}
        for number, place in here.items():
            visited[k, graph.within(before.get(number, place), place, reach[number])] = True
        before = here
    return visited
