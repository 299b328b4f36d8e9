"""Intruder games on a finished run: on points of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.game import Game, Infiltration, infiltration
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.learned import Advance, Learned, Trials, Watched, learned_games
from experiments.intruders.sightings import Sightings
from experiments.intruders.standing import Successes, intruder_games
from monitor.replay.replay import Watcher, play
from monitor.replay.run import Run
from patrol.errors import BadInput
from patrol.graph import Graph
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint, View
from patrol.ground.terrain import ALL_WAYS
from patrol.ground.ways import lengths_along
from patrol.journal.records import Status
from patrol.kernels.ways import FAR
from patrol.prepare import sensor_footprint

Features = NDArray[np.float32]


def nearness_and_approach(run: Run, places: Sequence[tuple[int, int]], pixel: float) -> tuple[Features, Features]:
    """Return the robots' nearness and approach to places, float32 (ticks, places) each.

    Distances are ways over free ground in units of `pixel` (m), and at least 1. Nearness is the sum over robots of 1 /
    distance, in 1 / px. Approach is that of the speed towards the place over the last second / distance, in 1 / s. For
    example, with pixels of 0.075 m, a robot 1.5 m (20 px) from a place that drives there at 1 m/s (13.3 px/s) has
    nearness 0.05 and approach 0.67.

    Places are row and column. Without a way to a place, or off the terrain, both features are 0.
    """
    terrain = run.prepared.terrain
    cells = np.floor((run.poses[:, :, :2] - terrain.origin) / terrain.point)
    cells = np.clip(np.nan_to_num(cells), -1, [terrain.width, terrain.height]).astype(np.int64) + 1
    alive = run.status == Status.ALIVE
    stride = max(round(1.0 / run.step), 1)
    nearness, approach = (np.zeros((run.ticks, len(places)), dtype=np.float32) for _ in range(2))
    for index, (row, col) in enumerate(places):
        if not (terrain.inside(row, col) and terrain.free[row, col]):
            continue
        ways = lengths_along(terrain.free, ALL_WAYS, [(row, col)], FAR // 2)[cells[:, :, 1], cells[:, :, 0]]
        is_known = alive & (ways < FAR)
        pixels = np.maximum(ways * (terrain.point / 100.0 / pixel), 1.0)
        nearness[:, index] = (is_known / pixels).sum(axis=1)
        towards = (pixels[:-stride] - pixels[stride:]) / (stride * run.step)
        known_twice = is_known[:-stride] & is_known[stride:]
        approach[stride:, index] = (known_twice * towards / pixels[stride:]).sum(axis=1)
    return nearness, approach


MOST_LEARNED = 100
"""Of the points, those on which the learned intruder plays: its networks grow with the square of their number."""


@dataclass(frozen=True, slots=True)
class Games:
    """The games on a run."""

    points: int  # how many points of the ground were played on
    ground: list[Successes]  # on these; a point is seen when it is in a robot's view
    learned_points: int  # how many of these the learned intruder played on
    learned_ground: list[Learned]
    vertices: int  # of the scenario's graph, or of the one that is made from the ground
    nodes: list[Successes]  # on these; visited when a robot comes close (`patrol.graph.Graph.visit_reach`)
    learned_nodes: list[Learned]
    moving: Infiltration | None = None
    no_moving: str = ""  # why it was not played; empty where it was, or was not asked for


@dataclass(frozen=True, slots=True)
class Moving:
    """The moving intruder to play."""

    infiltrator: Infiltrator
    again: bool = False  # whether it also plans again every second
    advance: Advance = lambda _share: None  # called with the share of its work that is done
    prepare: Callable[[Game], None] = lambda _game: None  # called before the game is played, to add predictors


class Looks(Watcher):
    """Notes the sightings of each tick while a run is replayed; a `Watcher`."""

    def __init__(
        self, run: Run, graph: Graph | None, infiltrator: Infiltrator | None, footprint: Footprint | None = None
    ) -> None:
        """Begin before the first tick; raise BadInput as `Sightings` does.

        Without a footprint, that of the run is computed.
        """
        self.footprint = footprint or sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self.sightings = Sightings(run.prepared, self.footprint, graph, run.ticks, infiltrator)
        self._run = run

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - a Watcher gets it
        """See `Watcher`."""
        self.sightings.look(k, self._run.alive(k))


def games_of(
    run: Run,
    attacks_s: Sequence[float],
    trials: Trials | None = None,
    advance: Advance = lambda _share: None,
    moving: Moving | None = None,
) -> Games:
    """Play the games on a run; those of the learned intruder, which take long, only with trials.

    Raises BadInput where `Trials.check` does, for a zone that the scenario does not have, and where `moving.prepare`
    does. `advance` is that of the learned intruder.
    """
    if trials is not None:
        trials.check(run.ticks, run.step)
    graph = run.prepared.graph
    looks = Looks(run, graph, None if moving is None else moving.infiltrator)
    sightings = looks.sightings
    play(run, [looks], looks.footprint)
    points = list(zip(sightings.rows.tolist(), sightings.cols.tolist(), strict=True))
    learned_ground: list[Learned] = []
    learned_nodes: list[Learned] = []
    some = slice(None, None, max(-(-len(points) // MOST_LEARNED), 1))
    if trials is not None:
        terrain = run.prepared.terrain
        vertices = [terrain.point_at(x, y) for x, y in graph.places.tolist()]
        on_points, on_vertices = (
            nearness_and_approach(run, targets, graph.pixel) for targets in (points[some], vertices)
        )
        ground = Watched(sightings.seen[:, some], *on_points, run.step)
        nodes = Watched(sightings.visited, *on_vertices, run.step)
        learned_ground = learned_games(ground, attacks_s, trials, lambda share: advance(0.5 * share))
        learned_nodes = learned_games(nodes, attacks_s, trials, lambda share: advance(0.5 + 0.5 * share))
    outcome, no_moving = None, ""
    if moving is not None:
        try:
            game = sightings.game()
        except BadInput as why:
            no_moving = str(why)
        else:
            moving.prepare(game)
            outcome = infiltration(game, moving.again, moving.advance)
    return Games(
        len(points),
        intruder_games(sightings.seen, run.step, attacks_s),
        len(points[some]) if learned_ground else 0,
        learned_ground,
        graph.size,
        intruder_games(sightings.visited, run.step, attacks_s),
        learned_nodes,
        outcome,
        no_moving,
    )


def moving_game(run: Run, infiltrator: Infiltrator) -> Game:
    """Return the moving intruder's game on a run, or raise BadInput where it cannot be played."""
    looks = Looks(run, None, infiltrator)
    play(run, [looks], looks.footprint)
    return looks.sightings.game()
