"""How long a full decision takes at 10 cm, one robot among five, after some minutes of patrol; and its kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from agent.belief.kernels.dilate import dilate
from agent.ports import Decision
from agent.routes.ground import Ground
from agent.routes.wave import Wave
from experiments.inprocess import InProcessFleet, make_minds
from patrol.exchange import Reply
from patrol.ground.kernels.footprint import cast
from patrol.ground.maps import load_terrain
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from worldsim.world import World

pytestmark = pytest.mark.bench

WARM_TICKS = 200


TERRAINS = ("open", "yards", "clutter", "site", "site x 4")
COMMITMENTS = ("target", "none")
"""The default policy, and the paper's."""


class Patrol:
    """A fleet of five in one process, stopped in each tick before robot 1 decides.

    ``site x 4`` is the terrain `site` laid out twice along each side.
    """

    def __init__(self, terrain: str, commitment: str = "none", separation: str = "none") -> None:
        name = terrain.removesuffix(" x 4")
        patrol = {"commitment": commitment, "separation": separation}
        scenario = load_scenario({"terrain": {"builtin": name}, "patrol": patrol})
        ground = load_terrain(scenario.terrain, scenario.point, scenario.base)
        if name != terrain:
            ground = Terrain(terrain, np.tile(ground.passable, (2, 2)), ground.point)
        prepared = prepare(scenario, ground)
        self.mind = make_minds(prepared)[1]
        self._fleet = InProcessFleet({**make_minds(prepared), 1: self.mind})
        self._world = World(prepared)
        self._begin()

    def decide(self) -> Decision:
        """Robot 1's decision of this tick; call it once a tick."""
        self._decision = self.mind.step(self._reports[1], self._heard[1])
        return self._decision

    def next_tick(self) -> None:
        """Let the others decide, move everybody, and begin the next tick."""
        others = {number: heard for number, heard in self._heard.items() if number != 1}
        replies = dict(self._fleet.phase_b(self._world.tick, others))
        replies[1] = Reply(self._decision.command, self._decision.state, self._decision.goal, 0.0, 0)
        self._world.end_tick(replies)
        self._begin()

    def _begin(self) -> None:
        self._reports = self._world.begin_tick()
        self._heard = self._world.exchange(self._fleet.phase_a(self._world.tick, self._reports))


@pytest.mark.parametrize("separation", ["none", "claims"])
@pytest.mark.parametrize("commitment", COMMITMENTS)
@pytest.mark.parametrize("terrain", TERRAINS)
def test_a_full_decision(terrain: str, commitment: str, separation: str, benchmark: Any) -> None:
    patrol = Patrol(terrain, commitment, separation)
    patrol.decide()
    for _ in range(WARM_TICKS):
        patrol.next_tick()
        patrol.decide()
    benchmark.pedantic(patrol.decide, setup=patrol.next_tick, rounds=100)


def test_the_wave_over_an_open_field(benchmark: Any) -> None:
    is_open = np.ones((880, 1000), dtype=np.bool_)
    is_open[[0, -1], :] = is_open[:, [0, -1]] = False
    ground = Ground(Terrain("open", np.ones_like(is_open), 0.1), is_open)
    wave = Wave(880, 1000, 1000)

    def all_paths() -> None:
        wave.begin(ground, 440, 500)
        wave.extend(100_000)

    benchmark(all_paths)


@pytest.mark.parametrize("walls", [False, True])
def test_dilating_around_one_footprint(walls: bool, benchmark: Any) -> None:
    passable = np.ones((600, 600), dtype=np.uint8)
    passable[300, 50:550] = 0 if walls else 1
    seen = np.random.default_rng(1).integers(0, 500, passable.shape).astype(np.int32)
    scratch = np.zeros(3 * 600 * 600, dtype=np.uint16)
    benchmark(dilate, seen, passable, passable, seen.copy(), 150, 450, 150, 450, 50, 600, scratch)


def test_casting_one_footprint(benchmark: Any) -> None:
    passable = np.ones((600, 600), dtype=np.uint8)
    view = np.zeros((201, 201), dtype=np.uint8)
    look: Callable[..., None] = cast
    benchmark(look, passable, 300, 300, 100.0, view, 200, 200)
