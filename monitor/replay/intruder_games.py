"""Intruder games on a finished run: on any point of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.replay.replay import play
from monitor.replay.robot_distances import nearness_and_approach
from monitor.replay.run import Run
from patrol.graph.graph import Graph, visit_reach
from patrol.ground.fog import Fog
from patrol.ground.footprint import View
from patrol.measures.intruders import Seen, Successes, intruder_games
from patrol.measures.learned_intruder import Advance, Learned, Trials, Watched, learned_games

MOST_POINTS = 2000
"""Points of the ground that are played on; of more, every so many are taken, row by row."""

MOST_LEARNED = 100
"""Of these, the points on which the learned intruder plays: its networks grow with the square of their number."""


@dataclass(frozen=True, slots=True)
class Games:
    """The games on a run.

    Attributes:
        points: How many points of the ground were played on.
        ground: On these; a point is seen when it is in a robot's view.
        learned_points: On how many of these the learned intruder played.
        learned_ground: Its outcomes on these.
        vertices: How many vertices the graph has: the scenario's, or the one that is made from the ground.
        nodes: On these; a vertex is visited when a robot comes close (`patrol.graph.graph.visit_reach`).
        learned_nodes: The outcomes of the learned intruder on these.
    """

    points: int
    ground: list[Successes]
    learned_points: int
    learned_ground: list[Learned]
    vertices: int
    nodes: list[Successes]
    learned_nodes: list[Learned]


class _Looks:
    """Writes down which points are in view in each tick, while a run is replayed."""

    def __init__(self, patrolled: NDArray[np.bool_], ticks: int) -> None:
        rows, cols = np.nonzero(patrolled)
        apart = -(-len(rows) // MOST_POINTS)
        self._rows, self._cols = rows[::apart], cols[::apart]
        self.seen = np.zeros((ticks, len(self._rows)), dtype=np.bool_)

    @property
    def points(self) -> list[tuple[int, int]]:
        """Row and column of each point."""
        return list(zip(self._rows.tolist(), self._cols.tolist(), strict=True))

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - a Watcher gets it
        """See `Watcher`."""
        for view in views:
            rows, cols = self._rows - view.row0, self._cols - view.col0
            near = (rows >= 0) & (cols >= 0) & (rows < view.mask.shape[0]) & (cols < view.mask.shape[1])
            self.seen[k, near] |= view.mask[rows[near], cols[near]] != 0

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`."""


def games_of(
    run: Run, attacks_s: Sequence[float], trials: Trials | None = None, advance: Advance = lambda _share: None
) -> Games:
    """Play the games on a run.

    Args:
        run: The run.
        attacks_s: Durations of attacks, s.
        trials: Of the learned intruder, which takes long; None without it.
        advance: Called with the share of the learned intruder's work that is done.

    Raises:
        BadInput: The run is shorter than a horizon of the trials.
    """
    if trials is not None:
        trials.check(run.ticks, run.step)
    looks = _Looks(run.prepared.patrolled, run.ticks)
    play(run, [looks])
    graph = run.prepared.graph
    visited = _visits(run, graph)
    learned_ground: list[Learned] = []
    learned_nodes: list[Learned] = []
    some = slice(None, None, max(-(-len(looks.points) // MOST_LEARNED), 1))
    if trials is not None:
        terrain = run.prepared.terrain
        vertices = [terrain.point_at(x, y) for x, y in graph.places.tolist()]
        ground = Watched(looks.seen[:, some], *nearness_and_approach(run, looks.points[some], graph.pixel), run.step)
        nodes = Watched(visited, *nearness_and_approach(run, vertices, graph.pixel), run.step)
        learned_ground = learned_games(ground, attacks_s, trials, lambda share: advance(0.5 * share))
        learned_nodes = learned_games(nodes, attacks_s, trials, lambda share: advance(0.5 + 0.5 * share))
    return Games(
        len(looks.points),
        intruder_games(looks.seen, run.step, attacks_s),
        len(looks.points[some]) if learned_ground else 0,
        learned_ground,
        graph.size,
        intruder_games(visited, run.step, attacks_s),
        learned_nodes,
    )


def _visits(run: Run, graph: Graph) -> Seen:
    """bool (ticks, v), whether a robot visits each vertex of a graph in each tick."""
    visited = np.zeros((run.ticks, graph.size), dtype=np.bool_)
    reach = {spec.number: visit_reach(spec.speed, run.step) for spec in run.prepared.scenario.roster}
    before: dict[int, tuple[float, float]] = {}
    for k in range(run.ticks):
        here = {number: (pose.x, pose.y) for number, pose in run.alive(k)}
        for number, place in here.items():
            visited[k, graph.within(before.get(number, place), place, reach[number])] = True
        before = here
    return visited
