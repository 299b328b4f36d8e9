"""Intruder games on a finished run: on any point of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor.replay.replay import play
from monitor.replay.robot_distances import nearness_and_approach
from monitor.replay.run import Run
from patrol.ground.fog import Fog
from patrol.ground.footprint import View
from patrol.measures.intruders import Successes, intruder_games
from patrol.measures.learned_intruder import Advance, Learned, Trials, Watched, learned_games
from patrol.measures.sightings import Sightings
from patrol.prepare import sensor_footprint

MOST_LEARNED = 100
"""Of the points, those on which the learned intruder plays: its networks grow with the square of their number."""


@dataclass(frozen=True, slots=True)
class Games:
    """The games on a run.

    Attributes:
        points: How many points of the ground were played on.
        ground: On these; a point is seen when it is in a robot's view.
        learned_points: On how many of these the learned intruder played.
        learned_ground: Its outcomes on these.
        vertices: How many vertices the graph has: the scenario's, or the one that is made from the ground.
        nodes: On these; a vertex is visited when a robot comes close (`patrol.graph.graph.Graph.visit_reach`).
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
    """Writes down what is in view in each tick, while a run is replayed."""

    def __init__(self, run: Run, sightings: Sightings) -> None:
        self._run = run
        self._to = sightings

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - a Watcher gets it
        """See `Watcher`."""
        self._to.look(k, self._run.alive(k))

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
        BadInput: A horizon of the trials is longer than the run, or too short for a prediction.
    """
    if trials is not None:
        trials.check(run.ticks, run.step)
    graph = run.prepared.graph
    footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    sightings = Sightings(run.prepared, footprint, graph, run.ticks)
    play(run, [_Looks(run, sightings)], footprint)
    points = list(zip(sightings.rows.tolist(), sightings.cols.tolist(), strict=True))
    learned_ground: list[Learned] = []
    learned_nodes: list[Learned] = []
    some = slice(None, None, max(-(-len(points) // MOST_LEARNED), 1))
    if trials is not None:
        terrain = run.prepared.terrain
        vertices = [terrain.point_at(x, y) for x, y in graph.places.tolist()]
        on_points, on_vertices = (nearness_and_approach(run, each, graph.pixel) for each in (points[some], vertices))
        ground = Watched(sightings.seen[:, some], *on_points, run.step)
        nodes = Watched(sightings.visited, *on_vertices, run.step)
        learned_ground = learned_games(ground, attacks_s, trials, lambda share: advance(0.5 * share))
        learned_nodes = learned_games(nodes, attacks_s, trials, lambda share: advance(0.5 + 0.5 * share))
    return Games(
        len(points),
        intruder_games(sightings.seen, run.step, attacks_s),
        len(points[some]) if learned_ground else 0,
        learned_ground,
        graph.size,
        intruder_games(sightings.visited, run.step, attacks_s),
        learned_nodes,
    )
