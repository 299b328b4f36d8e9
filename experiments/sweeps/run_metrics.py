"""Metrics taken while a run is made: the error of robots' beliefs, and intruder games."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.standing import ATTACKS_S, intruder_games
from patrol.errors import BadInput
from patrol.journal.records import Status
from patrol.pose import Pose

if TYPE_CHECKING:
    from agent.mind import Mind
    from experiments.intruders.game import Game
    from experiments.intruders.sightings import Sightings
    from patrol.journal import TickRecord
    from worldsim.world import World

EVERY = 50
"""Ticks between two comparisons."""


class BeliefError:
    """Compares the fog that living robots believe in with the true fog, every `EVERY` ticks.

    A robot that misses a position believes that points are staler than they are; a robot that believes a forged
    position believes that points are fresher. Both are measured over the points that the robot itself could see.
    """

    def __init__(self) -> None:
        self._looks = 0
        self._error_s = 0.0
        self._fresher = 0.0

    def look(self, world: World, minds: Mapping[int, Mind]) -> None:
        """Compare, if it is time to; called after each tick by `fogwatch.inprocess.run_in_process`."""
        if world.tick % EVERY:
            return
        true = np.maximum(world.truth.fog.last_seen, 0)
        for number in world.living:
            fog = minds[number].belief.fog
            patrolled = fog.patrolled.view(np.bool_)
            later = np.maximum(fog.last_seen[patrolled], 0) - true[patrolled]
            self._looks += 1
            self._error_s += float(np.mean(np.abs(later))) * world.step
            self._fresher += float(np.count_nonzero(later > 0)) / fog.points

    def metrics(self) -> dict[str, float | None]:
        """Return the error so far, as means over comparisons, robots and points.

        ``belief_error_s`` is the absolute difference between the believed and the true age of a point in s,
        ``believed_fresher`` the share of the points that are believed fresher than they are. Both are None for a run
        too short to compare.
        """
        if self._looks == 0:
            return {"belief_error_s": None, "believed_fresher": None}
        return {"belief_error_s": self._error_s / self._looks, "believed_fresher": self._fresher / self._looks}


INTRUDERS = ("random", "waiting", "statistical", "worst")
"""The intruders whose shares of successes are metrics."""


def game_metric(intruder: str, attack_s: float, on: str = "ground") -> str:
    """Return the name of the metric of an intruder's successes, such as ``intruder_worst_75s_percent``.

    Attacks are on the "ground", or on "nodes", the vertices of the graph.
    """
    return f"{'nodes_' if on == 'nodes' else ''}intruder_{intruder}_{attack_s:g}s_percent"


GAINED = "intruder_moving_gain_points"
"""Name of the metric of what watching gains, in percentage points."""


def moving_metric(predictor: str) -> str:
    """Return the name of the metric of the moving intruder's successes, such as ``intruder_moving_blind_percent``."""
    return f"intruder_moving_{predictor}_percent"


class GameLog:
    """Writes down which places are seen while a run is made, and plays intruder games on it afterwards."""

    def __init__(self, infiltrator: Infiltrator | None = None) -> None:
        self._infiltrator = infiltrator or Infiltrator()
        self.sightings: Sightings | None = None  # stays None with a sensor that it does not watch
        self._ticks = 0
        self._step = math.nan

    def watch(self, world: World) -> Callable[[TickRecord], None]:
        """Begin with the world before its first tick; return a function for each tick's record (`run_in_process`).

        That does nothing with a sensor that leaves some of a point's age: it is open then what such a sensor has seen.
        """
        # Here, as it loads kernels, and pages need names of metrics only.
        from experiments.intruders.sightings import Sightings

        footprint = world.truth.footprint
        if footprint.leaves_age:
            return lambda _: None
        has_graph = world.scenario.terrain.graph is not None  # as `nodes` in the summary
        graph = world.prepared.make_graph() if has_graph else None
        sightings = Sightings(world.prepared, footprint, graph, world.ticks, self._infiltrator)
        self.sightings = sightings
        self._step = world.scenario.step

        def on_tick(record: TickRecord) -> None:
            self._ticks = record.k + 1
            alive = (row for row in record.robots if row.status is Status.ALIVE)
            sightings.look(record.k, ((row.number, Pose(row.x, row.y, row.heading)) for row in alive))

        return on_tick

    def game(self) -> Game:
        """Return the moving intruder's game on the run, or raise BadInput where it cannot be played."""
        if self.sightings is None:
            raise BadInput("a moving intruder cannot be played: nothing was written down")
        return self.sightings.game()

    def metrics(self) -> dict[str, float | None]:
        """Return the shares of attacks that succeed, by the names of `game_metric`, `moving_metric` and `GAINED`.

        The moving intruder has none in runs that are too short for it, and where only vertices are patrolled.
        """
        from experiments.intruders.game import infiltration  # here, likewise

        if self.sightings is None:
            return {}
        places = {"ground": self.sightings.seen, "nodes": self.sightings.visited}
        shares = {
            game_metric(intruder, successes.attack_s, on): None if share is None else 100.0 * share
            for on, sightings in places.items()
            if sightings.shape[1]
            for successes in intruder_games(sightings[: self._ticks], self._step, ATTACKS_S)
            for intruder in INTRUDERS
            for share in [getattr(successes, intruder)]
        }
        try:
            played = infiltration(self.game())
        except BadInput:
            return shares
        moving = {moving_metric(name): share.percent for name, share in played.once.items()}
        return {**shares, **moving, GAINED: played.gain.watching.percent}
