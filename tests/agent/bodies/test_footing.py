"""Ground that a body fits on although no route leads there: no random step ends on it, and every body gets off it."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from agent.bodies.steering import Footing
from agent.build import build_mind
from agent.ports import Intent, Place
from agent.routes.ground import Ground
from agent.view import View
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from tests.agent.bodies.test_bodies import Says
from tests.agent.minds import STEP, at

RADIUS = 0.28
ROOM = Pose(3.1, 4.3, 0.0)
SLIT = Pose(9.1, 4.3, 0.0)
"""A step from the slit's end; the room is behind."""


def slit() -> Terrain:
    """A room of 7 x 7 m, and a slit of 0.6 x 2.4 m off its right wall, in which a body of 0.56 m fits as it is."""
    passable = np.zeros((44, 54), dtype=np.bool_)
    passable[5:40, 5:40] = True
    passable[20:23, 40:52] = True
    return Terrain("slit", passable, 0.2)


@pytest.fixture(scope="module")
def prepared() -> dict[str, Prepared]:
    """By model."""
    found = {}
    for model in MODELS:
        robots: dict[str, object] = {"count": 1, "model": model, "radius": RADIUS, "speed": 1.0, "turning_radius": 0.8}
        robots["starts"] = [[ROOM.x, ROOM.y]]
        scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.2, "robots": robots})
        found[model] = prepare(scenario, slit())
    return found


def footing(prepared: Prepared) -> Footing:
    return Footing(prepared.terrain, Ground(prepared.terrain, prepared.fields[1].reach), RADIUS)


def test_the_footing_ends_where_no_route_leads(prepared: dict[str, Prepared]) -> None:
    there = footing(prepared["holonomic"])
    assert there.holds(ROOM.x, ROOM.y)
    assert not there.holds(SLIT.x, SLIT.y)
    assert not there.may_end(ROOM, SLIT.x, SLIT.y)
    assert there.may_end(SLIT, SLIT.x, SLIT.y)


@pytest.mark.parametrize("model", MODELS)
def test_a_robot_off_the_ground_gets_back(model: str, prepared: dict[str, Prepared]) -> None:
    mind, there, pose = build_mind(prepared[model], 1), footing(prepared[model]), SLIT
    for k in range(1000):
        command = mind.step(at(k, pose), []).command
        assert path_is_free(prepared[model].terrain, pose, command, STEP, RADIUS)
        pose = advance(pose, command, STEP)
        if there.holds(pose.x, pose.y):
            break
    assert there.holds(pose.x, pose.y), f"it is at {pose}"
    assert model != "car" or k < 20, "a car reverses straight out"


@pytest.mark.parametrize("model", MODELS)
def test_no_random_step_leaves_the_ground(model: str, prepared: dict[str, Prepared]) -> None:
    there = footing(prepared[model])
    mouth = Pose(7.3, 4.3, 0.0)
    assert there.holds(mouth.x, mouth.y)
    while there.holds(mouth.x + 0.1, mouth.y):
        mouth = Pose(mouth.x + 0.1, mouth.y, 0.0)
    for share in range(-8, 9):
        aside = Place(ROOM.x, ROOM.y, wander=0.02 * share)
        mind = build_mind(prepared[model], 1)
        mind.policy = Says(partial(_always, aside))
        pose = mouth
        for k in range(3):
            pose = advance(pose, mind.step(at(k, pose), []).command, STEP)
            assert there.holds(pose.x, pose.y), f"{aside} leads to {pose}"


def _always(intent: Intent, view: View) -> Intent:
    del view
    return intent
