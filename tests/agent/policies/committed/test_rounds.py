"""On the round: the ground is kept as fresh as the tour promises, evenly spaced, and a death is made up for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agent.policies.committed.policy import Committed
from experiments.inprocess import run_in_process
from fogwatch.grounds.random_building import Building
from patrol.scenario import load_scenario, open_scenario
from worldsim.world import World

ROUND = {"robots.count": 3, "robots.model": "holonomic", "point": 1.0, "duration": 400, "sensor.range": 20}


def mfow_s(**changes: object) -> list[float]:
    """The MFoW after each tick of a run on `yards`, s."""
    scenario = open_scenario("yards", {**ROUND, **changes})
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.verdict.outcome == "valid"
    tour = outcome.summary.best_tour_s
    assert tour is not None
    return [mfow / tour for mfow in ticks]


def test_the_fog_stays_as_fresh_as_the_tour_promises() -> None:
    late = mfow_s()[200:]
    assert np.mean(late) < 1.1
    assert max(late) < 1.25


def test_vertices_are_seen_as_often_by_a_sensor_that_sees_less_far_than_a_stride() -> None:
    places = [[10, 10], [50, 10], [90, 10], [90, 78], [50, 78], [10, 78]]
    graph = {"vertices": places, "edges": [[a, (a + 1) % 6, 40] for a in range(6)]}
    scenario = open_scenario(
        "open",
        {
            **ROUND,
            "terrain.graph": graph,
            "terrain.patrolled": "vertices",
            "sensor.range": 1.2,
            "patrol.options.random_move": 0,
        },
    )
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.summary.best_tour_s is not None
    assert np.mean(ticks[400:]) < 1.1 * outcome.summary.best_tour_s


def test_the_gaps_close_within_two_tours_after_a_death() -> None:
    ratios = mfow_s(faults=[{"kind": "kill", "who": "r2", "at": 150, "wreck": "removed"}], duration=700)
    # Two robots are left: their promise is half as good again.
    assert np.mean(ratios[-300:]) < 1.15 * 1.5


def test_a_robot_that_died_on_the_round_blocks_no_patrol(tmp_path: Path) -> None:
    """Two rooms, the first with five walls in it, a corridor of a body's width, and in it a robot that dies at once."""
    free = np.zeros((70, 220), dtype=np.bool_)
    free[5:65, 5:65] = free[5:65, 155:215] = free[31:39, 65:155] = True
    for col in range(10, 60, 10):
        free[5:45, col : col + 2] = False
    robots = {"model": "holonomic", "radius": 0.3, "speed": 1.0}
    starts = [[11.0, 3.5], [2.0, 5.5], [4.0, 5.5]]
    scenario = load_scenario(
        {
            "terrain": {"map": str(Building(free, 0.1).write(tmp_path))},
            "point": 0.1,
            "duration": 200,
            "robots": [{**robots, "start": start} for start in starts],
            "faults": [{"kind": "kill", "who": "r1", "at": 1.0}],
        }
    )
    ages_s: list[float] = []

    def look(world: World, _minds: object) -> None:
        last_seen = world.truth.fog.last_seen[:, :65][free[:, :65]]
        ages_s.append((world.tick - last_seen.min()) * scenario.step)

    run_in_process(scenario, look=look)
    assert max(ages_s[200:]) < 60.0


def test_where_every_choice_is_free_there_is_no_round() -> None:
    minds: list[bool] = []

    def look(_world: object, by_number: object) -> None:
        for mind in by_number.values():  # type: ignore[attr-defined]
            policy = mind.policy.otherwise
            assert isinstance(policy, Committed)
            minds.append(policy.ahead is None)

    scenario = open_scenario("yards", {**ROUND, "duration": 5, "patrol.options.unpredictability": 1})
    run_in_process(scenario, look=look)
    assert minds
    assert all(minds)


@pytest.mark.parametrize("kind", [{"sensor.angle": 120}, {"sensor.quality": 0.5}])
def test_a_sensor_that_shows_no_tour_leaves_every_choice_free(kind: dict[str, object]) -> None:
    scenario = open_scenario("yards", {**ROUND, **kind, "duration": 5})

    def look(_world: object, by_number: object) -> None:
        assert all(mind.policy.otherwise.ahead is None for mind in by_number.values())  # type: ignore[attr-defined]

    run_in_process(scenario, look=look)


@pytest.mark.parametrize(("second", "free"), [(4.4, False), (2.2, True)])
def test_robots_of_several_speeds_choose_freely(second: float, free: bool) -> None:
    scenario = open_scenario("yards", {**ROUND, "duration": 2, "robots": [{"speed": 4.4}, {"speed": second}]})

    def look(_world: object, by_number: object) -> None:
        minds = by_number.values()  # type: ignore[attr-defined]
        assert {mind.policy.otherwise.ahead is None for mind in minds} == {free}

    run_in_process(scenario, look=look)
