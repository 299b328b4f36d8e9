"""Intruder games on a finished run: on points of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from experiments.intruders.game import Game, Infiltration, infiltration
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.sightings import Sightings
from experiments.intruders.standing import Successes, intruder_games
from monitor.replay.replay import Watcher, play
from monitor.replay.run import Run
from patrol.errors import BadInput
from patrol.graph import Graph
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint, View
from patrol.prepare import sensor_footprint


@dataclass(frozen=True, slots=True)
class Games:
    """The games on a run."""

    points: int  # how many points of the ground were played on
    ground: list[Successes]  # on these; a point is seen when it is in a robot's view
    vertices: int  # of the scenario's graph, or of the one that is made from the ground
    nodes: list[Successes]  # on these; visited when a robot comes close (`patrol.graph.Graph.visit_reach`)
    moving: Infiltration | None = None
    no_moving: str = ""  # why it was not played; empty where it was, or was not asked for


@dataclass(frozen=True, slots=True)
class Moving:
    """The moving intruder to play."""

    infiltrator: Infiltrator
    again: bool = False  # whether it also plans again every second
    advance: Callable[[float], None] = lambda _share: None  # called with the share of its work that is done
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


def games_of(run: Run, attacks_s: Sequence[float], moving: Moving | None = None) -> Games:
    """Play the games on a run.

    Raises BadInput for a zone that the scenario does not have, and where `moving.prepare` does.
    """
    graph = run.prepared.make_graph()
    looks = Looks(run, graph, None if moving is None else moving.infiltrator)
    sightings = looks.sightings
    play(run, [looks], looks.footprint)
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
        len(sightings.rows),
        intruder_games(sightings.seen, run.step, attacks_s),
        graph.size,
        intruder_games(sightings.visited, run.step, attacks_s),
        outcome,
        no_moving,
    )


def moving_game(run: Run, infiltrator: Infiltrator) -> Game:
    """Return the moving intruder's game on a run, or raise BadInput where it cannot be played."""
    looks = Looks(run, None, infiltrator)
    play(run, [looks], looks.footprint)
    return looks.sightings.game()
