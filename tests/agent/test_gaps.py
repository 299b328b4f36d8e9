"""Minds that miss ticks or start late: paused and resumed, killed and restarted, and what their peers make of it."""

from __future__ import annotations

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.ports import Decision
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.scenario import load_scenario
from tests.agent.minds import at, prepared_on
from tests.agent.plans import Robots


def pair_of(model: str) -> Robots:
    """Two robots in one room of 30 x 20 m."""
    terrain = Terrain("room", np.ones((40, 60), dtype=np.bool_), 0.5)
    patrol = {"policy": "potential-field", "manoeuvres": False, "options": {"dilatation": 2.0, "separation": "claims"}}
    facts = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 2, "model": model}, "patrol": patrol}
    radio = {"trail": 2, "forget_after": 5}
    scenario = load_scenario({**facts, "radio": radio, "sensor": {"range": 4.0}})
    return Robots(prepared_on(scenario, terrain, [Pose(6.0, 6.0, 0.3), Pose(20.0, 12.0, 2.0)]))


def run(pair: Robots, ticks: int, *up: int) -> list[Decision]:
    """Let so many ticks pass with these robots (0, 1) up; their last decisions."""
    return [pair.tick(up) for _ in range(ticks)][-1]


@pytest.mark.parametrize("model", MODELS)
def test_a_resumed_mind_goes_on_with_what_it_knew(model: str) -> None:
    pair = pair_of(model)
    run(pair, 60, 0, 1)
    knew = pair.minds[1].belief.fog.last_seen.copy()
    run(pair, 40, 0)
    assert (pair.minds[1].belief.fog.last_seen == knew).all()
    first = run(pair, 1, 0, 1)
    assert pair.minds[1].belief.peers[1].tick == 100
    assert pair.minds[0].belief.peers[2].tick == 100
    assert first[1].mfow >= 40
    later = run(pair, 100, 0, 1)
    assert [decided.rejected for decided in later] == [0, 0]
    assert later[1].mfow < 100


@pytest.mark.parametrize("model", MODELS)
def test_a_restarted_mind_knows_nothing_and_catches_up(model: str) -> None:
    pair = pair_of(model)
    run(pair, 80, 0, 1)
    run(pair, 20, 0)
    pair.minds[1] = build_mind(Shared(pair.prepared), 2, 2)
    first = run(pair, 1, 0, 1)
    belief = pair.minds[1].belief
    assert first[1].mfow == 100
    assert 0 < belief.fog.seen < belief.fog.points / 2
    assert belief.peers[1].tick == pair.minds[0].belief.peers[2].tick == 100
    later = run(pair, 150, 0, 1)
    assert [decided.rejected for decided in later] == [0, 0]
    assert belief.fog.seen == belief.fog.points
    assert later[1].mfow < 80


def test_another_incarnation_draws_other_random_moves() -> None:
    pair = pair_of("holonomic")
    minds = pair.minds[0], build_mind(Shared(pair.prepared), 1, 2)
    bearings = [[mind.step(at(k, pair.bodies[0].pose), []).direction for k in range(60)] for mind in minds]
    assert bearings[0] != bearings[1]
