"""Small floor plans for tests, and robots that the world moves through them as their minds command."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.policies.common_plan.stations import KnownStations
from agent.policies.surround import Surround
from agent.ports import Decision, Intent, Policy
from agent.routes.ground import Spot
from agent.view import View
from patrol.ground.fields import compute_fields
from patrol.ground.swept_path import path_is_free
from patrol.ground.terrain import Terrain
from patrol.measures.best_tour import rounds_of
from patrol.pose import Pose, halted
from patrol.prepare import Prepared
from patrol.scenario import load_scenario
from patrol.tours.round import ways_between
from tests.agent.minds import STEP, at
from tests.present import present
from worldsim.robots.bodies import Body, move

POINT = 0.1


def plan(size: Spot, *free: tuple[float, float, float, float], point: float = POINT) -> Terrain:
    """Free rectangles (left, low, right, high), m, in a block of wall of this size."""
    passable = np.zeros((round(size[1] / point), round(size[0] / point)), dtype=np.bool_)
    for left, low, right, high in free:
        passable[round(low / point) : round(high / point), round(left / point) : round(right / point)] = True
    return Terrain("plan", passable, point)


def two_rooms() -> Terrain:
    """Two rooms of 8 x 8 m, joined by a corridor of 6 m."""
    return plan((22.0, 8.0), (0.0, 0.0, 8.0, 8.0), (8.0, 3.0, 14.0, 5.0), (14.0, 0.0, 22.0, 8.0))


def cluttered(seed: int, shape: tuple[int, int], blocks: int, point: float = 0.25) -> Terrain:
    """Blocks on a plain, none of them near the corners."""
    dice = np.random.default_rng(seed)
    passable = np.ones(shape, dtype=np.bool_)
    for _ in range(blocks):
        row, col = (int(dice.integers(6, size - 6)) for size in shape)
        high, wide = (int(extent) for extent in dice.integers(1, 9, 2))
        passable[row : row + high, col : min(col + wide, shape[1] - 6)] = False
    return Terrain("cluttered", passable, point)


def prepared_in(
    terrain: Terrain,
    starts: Sequence[Pose],
    robots: Mapping[str, Any],
    *,
    speeds: Sequence[float] = (),
    models: Sequence[str] = (),
    spares: int = 0,
    **sections: Any,
) -> Prepared:
    """A scenario with robots, equal but for speeds and models, that begin at these places, and reach what they do.

    The last ones are spare.
    """
    roster: list[dict[str, Any]] = [{**robots, "start": [start.x, start.y, start.heading]} for start in starts]
    for robot, speed in zip(roster, speeds, strict=False):
        robot["speed"] = speed
    for robot, model in zip(roster, models, strict=False):
        robot["model"] = model
    for robot in roster[len(roster) - spares :]:
        robot["spare"] = True
    mapping = {"terrain": {"builtin": "open"}, "point": terrain.point, "robots": roster}
    scenario = load_scenario({**mapping, **sections})
    fields = compute_fields(terrain, scenario.roster[0].radius, scenario.sensor.range, True, list(starts))
    return Prepared(scenario, terrain, tuple(starts), {robot.number: fields for robot in scenario.roster}, {})


class Says:
    """A policy that always wants the same, or what a function says."""

    def __init__(self, wants: Intent | Callable[[View], Intent]) -> None:
        self._wants = wants

    def decide(self, view: View) -> Intent:
        return self._wants(view) if callable(self._wants) else self._wants


P = TypeVar("P", bound=Policy)


class Robots:
    """Robots that the world moves as their bodies command.

    Attributes:
        is_lost: Takes a tick and the places of a sender and a hearer in the roster; True where a frame is lost.
    """

    def __init__(self, prepared: Prepared, *intents: Intent, at_poses: Sequence[Pose] = ()) -> None:
        roster = prepared.scenario.roster
        self.prepared, self.terrain = prepared, prepared.terrain
        starts = at_poses or prepared.starts
        self.bodies = [Body(spec, start, halted(spec.model)) for spec, start in zip(roster, starts, strict=True)]
        shared = Shared(prepared)
        self.minds: list[Mind] = [build_mind(shared, spec.number) for spec in roster]
        for mind, intent in zip(self.minds, intents, strict=False):
            mind.policy = Says(intent)
        self.k = 0
        self.is_lost: Callable[[int, int, int], bool] = lambda _k, _sender, _hearer: False

    def tick(self, up: Sequence[int] | None = None) -> list[Decision]:
        """Let all robots decide and move, or those at some places in the roster; the others stand still and silent."""
        here = range(len(self.minds)) if up is None else up
        sensed = {i: at(self.k, self.bodies[i].pose, self.bodies[i].bumped) for i in here}
        sent = {i: self.minds[i].frames(sensed[i]) for i in here}
        decisions = []
        for i in here:
            heard = [j for j in here if j != i and not self.is_lost(self.k, j, i)]
            decisions.append(self.minds[i].step(sensed[i], [frame for j in heard for frame in sent[j]]))
        for body in self.bodies:
            body.command = halted(body.spec.model)
        for body, decision in zip([self.bodies[i] for i in here], decisions, strict=True):
            assert type(decision.command) is type(halted(body.spec.model))
            assert decision.command.is_within(body.spec.limits)
            assert path_is_free(self.terrain, body.pose, decision.command, STEP, body.spec.radius), "into a wall"
            body.command = decision.command
        move(self.bodies, self.terrain, STEP)
        self.k += 1
        return decisions

    def until(self, there: Callable[[], bool], ticks: int, up: Sequence[int] | None = None) -> None:
        """Go on until something holds, as `tick` does; fail when it takes more ticks."""
        for _ in range(ticks):
            if there():
                return
            self.tick(up)
        assert there(), [body.pose for body in self.bodies]

    def policy(self, kind: type[P], robot: int = 0) -> P:
        """The policy of a robot, below that which surrounds intruders."""
        surround = self.minds[robot].policy
        assert isinstance(surround, Surround)
        assert isinstance(surround.otherwise, kind)
        return surround.otherwise

    def apart(self, spot: Spot, robot: int = 0) -> float:
        pose = self.bodies[robot].pose
        return math.dist((pose.x, pose.y), spot)

    def until_near(self, spot: Spot, within: float, ticks: int) -> int:
        """Ticks until the first is there; fails when it takes more."""
        self.until(lambda: self.apart(spot) <= within, ticks)
        return self.k


def stations_of(prepared: Prepared, weights: NDArray[np.float64] | None = None) -> KnownStations:
    """The stations of the first robot's round."""
    laid_out = present(rounds_of(prepared)[1])
    reach, range_m = prepared.fields[1].reach, prepared.scenario.sensor.range
    find_ways = partial(ways_between, prepared.terrain, reach, range_m=range_m)
    return KnownStations(laid_out, find_ways, weights)
