"""Fleets with a wreck in their way: what it shuts off is told, and counted apart."""

from typing import Any

import pytest

from fogwatch.inprocess import Outcome, run_in_process
from patrol.pose import MODELS, Pose
from tests.agent.plans import plan, prepared_in
from tests.fleets import end_of
from tests.present import present

KILL = {"kind": "kill", "who": ["r2"], "at": 0.5}


def ran(model: str, *faults: dict[str, Any], width_m: float) -> Outcome:
    """Let one robot patrol two rooms for 800 s, and another one begin in the corridor between them."""
    low, high = 4.0 - 0.5 * width_m, 4.0 + 0.5 * width_m
    rooms = plan((22.0, 8.0), (0.0, 0.0, 8.0, 8.0), (8.0, low, 14.0, high), (14.0, 0.0, 22.0, 8.0), point=0.2)
    robots = {"model": model, "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    starts = [Pose(2.0, 4.0, 0.0), Pose(11.0, 4.0, 0.0)]
    sensor, duration = {"range": 3.0}, 800.0
    return run_in_process(
        prepared_in(rooms, starts, robots, sensor=sensor, duration=duration, faults=list(faults), seed=2)
    )


@pytest.mark.parametrize("model", MODELS)
def test_ground_behind_a_wreck_is_closed_out_until_it_is_taken_away(model: str) -> None:
    outcome = ran(model, KILL, {"kind": "restart", "who": ["r2"], "at": 700.0}, width_m=1.2)
    assert outcome.verdict.valid, outcome.verdict.failed
    summary = outcome.summary
    (spell,) = summary.closed_out
    assert (spell.since_s, spell.until_s) == (0.5, 700.0)
    assert spell.x > 11.0
    assert spell.area_m2 == pytest.approx(64.0 + 6.0, rel=0.15)
    assert present(summary.mfow_max_s) > 690.0
    assert present(summary.mfow_reachable_late_mean_s) < 100.0
    assert summary.robots["r1"].collisions <= 10
    assert not summary.trapped


def test_a_wreck_that_can_be_passed_closes_nothing_out() -> None:
    summary = ran("holonomic", KILL, width_m=3.0).summary
    assert summary.closed_out == []
    assert summary.mfow_reachable_mean_s is None
    assert present(summary.mfow_late_mean_s) < 150.0


def test_a_wreck_that_is_removed_closes_nothing_out() -> None:
    assert ran("holonomic", {**KILL, "wreck": "removed"}, width_m=1.2).summary.closed_out == []


@pytest.mark.parametrize("policy", ["stochastic", "potential-field"])
def test_robots_that_know_different_things_of_a_wreck_share_nothing_of_it(policy: str) -> None:
    rooms = plan((21.0, 14.0), (0.0, 0.0, 10.0, 14.0), (10.0, 2.5, 11.0, 4.0), (11.0, 0.0, 21.0, 14.0), point=0.5)
    starts = [Pose(4.0, 3.0, 0.0), Pose(10.25, 3.25, 0.0), Pose(4.0, 11.0, 0.0)]
    robots = {"model": "car", "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    given = prepared_in(
        rooms, starts, robots, sensor={"range": 3.0}, duration=500.0, faults=[KILL], patrol={"policy": policy}
    )
    together, alone = run_in_process(given), run_in_process(given, share=False)
    assert {name for name, robot in together.summary.robots.items() if robot.collisions} == {"r1", "r3"}
    assert end_of(together.journal) == end_of(alone.journal)
