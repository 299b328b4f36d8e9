"""The place where a mind is put together: each robot of a mixed team gets the lengths of its own body."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.bodies.base import GoalFinder
from agent.build import Shared, build_mind, known_to_robots
from agent.psi import load_psi, psi_field, psi_of, save_psi
from patrol.exchange import Sensed
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from tests.agent.minds import setup_of

SMALL = {"model": "holonomic", "radius": 0.3, "speed": 1.0}
ROBOTS = [{"model": "holonomic"}, SMALL, {**SMALL, "speed": 1.1}]
MIXED: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 0.5, "robots": ROBOTS}


@pytest.fixture(scope="module")
def mixed() -> Prepared:
    return prepare(load_scenario(MIXED))


def test_a_team_has_one_psi_for_each_reach_made_or_loaded(mixed: Prepared, tmp_path: Path) -> None:
    save_psi(mixed, tmp_path)
    for found in (psi_of(mixed.scenario, mixed.terrain), load_psi(mixed.scenario, tmp_path)):
        assert list(found) == [3.0, 10.0]
        for reach, psi in found.items():
            assert np.array_equal(psi, psi_field(mixed.terrain, reach))


def test_the_ground_is_loaded_from_files_that_all_processes_share(mixed: Prepared, tmp_path: Path) -> None:
    mixed.save(tmp_path)
    ground = Prepared.load(mixed.scenario, tmp_path).terrain
    for name in ("passable", "keep_out", "free", "blocked"):
        grid, own = getattr(ground, name), getattr(mixed.terrain, name)
        assert (grid.dtype, grid.flags.writeable) == (own.dtype, False)
        assert np.array_equal(grid, own)
        while not isinstance(grid, np.memmap):
            assert grid.base is not None, f"{name} is a copy of this process's own"
            grid = grid.base


def test_without_refinement_there_is_no_psi(tmp_path: Path) -> None:
    prepared = prepare(load_scenario(MIXED, {"patrol.avoidance": "none"}))
    save_psi(prepared, tmp_path)
    assert not list(tmp_path.iterdir())
    assert load_psi(prepared.scenario, tmp_path) == {}


@pytest.mark.parametrize(("number", "goal_m"), [(1, 5.5), (2, 1.65), (3, 1.65)])
def test_each_robot_looks_as_far_ahead_as_its_body_asks(mixed: Prepared, number: int, goal_m: float) -> None:
    shared = Shared(mixed)
    body = build_mind(shared, number).body
    goals = body.goals  # type: ignore[attr-defined]
    assert isinstance(goals, GoalFinder)
    ground = shared.ground_of(mixed.fields[number])
    lengths = replace(mixed.scenario.lengths[number], goal_distance=goal_m)
    start = ground.join(mixed.starts[number - 1].x, mixed.starts[number - 1].y)
    assert start
    psi = shared.psi[10.0 if number == 1 else 3.0]
    same, unrefined = (GoalFinder(lengths, ground, field) for field in (psi, None))
    bearings = np.arange(0.0, 6.2, 0.1)
    found, expected, plain = ([finder.along(b, *start) for b in bearings] for finder in (goals, same, unrefined))
    assert found == expected != plain


def test_minds_from_saved_and_from_own_fields_decide_alike(mixed: Prepared, tmp_path: Path) -> None:
    save_psi(mixed, tmp_path)
    saved = Shared(mixed, psi=load_psi(mixed.scenario, tmp_path))
    for number in (1, 2, 3):
        sensed = Sensed(0, mixed.starts[number - 1], False, (), 0.0)
        decisions = [build_mind(shared, number).step(sensed, []) for shared in (Shared(mixed), saved)]
        assert decisions[0] == decisions[1]


def test_attributes_of_1_0_are_found_in_the_parts_of_a_setup_with_a_warning(mixed: Prepared) -> None:
    setup = setup_of(mixed)
    moved = {
        "spec": ("robot.spec", setup.robot.spec),
        "terrain": ("ground.terrain", setup.ground.terrain),
        "step": ("fleet.step", setup.fleet.step),
        "fleet_chance": ("fleet.chance", setup.fleet.chance),
        "sensor": ("ground.prepared.scenario.sensor", setup.ground.prepared.scenario.sensor),
    }
    for old, (place, value) in moved.items():
        with pytest.warns(FutureWarning, match=rf"setup\.{old} is setup\.{place} since 1\.1"):
            assert getattr(setup, old) is value
    with pytest.raises(AttributeError, match="PolicySetup has no attribute zoned"):
        _ = setup.zoned  # type: ignore[attr-defined]


def test_policies_get_a_scenario_without_what_robots_do_not_know() -> None:
    facts = {"faults": [{"kind": "loss", "rate": 0.5}], "intruders": [{"place": [40, 40], "at": 10}]}
    given = {"terrain": {"builtin": "open"}, "point": 2.0, **facts}
    prepared = prepare(load_scenario(given))
    known = known_to_robots(prepared)
    assert prepared.scenario.faults
    assert not known.scenario.faults
    assert not known.scenario.intruders
    assert known.rounds is prepared.rounds


def test_what_is_in_one_robots_way_moves_its_posts_alone() -> None:
    shared = Shared(prepare(load_scenario({**MIXED, "robots": {"count": 2, "model": "holonomic"}})), believers=(1, 2))
    first, second = (build_mind(shared, number) for number in (1, 2))
    usual = second._fog.posts.stands.copy()
    assert first._fog.posts.stands is second._fog.posts.stands
    first._fog.posts.move(np.full(usual.shape, 7, dtype=np.int32))
    assert np.array_equal(second._fog.posts.stands, usual)
