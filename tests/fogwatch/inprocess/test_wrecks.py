"""Fleets with a wreck in their way: what it shuts off is told, and counted apart."""

from collections.abc import Mapping
from typing import Any

import pytest

from agent.mind import Mind
from agent.ports import State
from fogwatch.inprocess import Outcome, run_in_process
from patrol.journal.records import TickRecord
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from tests.agent.plans import plan, prepared_in
from tests.fleets import end_of
from tests.present import present
from worldsim.world import World

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


def test_the_fog_is_judged_where_a_robot_that_paused_has_gone_on() -> None:
    outcome = ran("holonomic", {"kind": "pause", "who": ["r2"], "at": 0.5, "for": 1.0}, width_m=1.2)
    assert len(outcome.summary.closed_out) == 1
    (progress,) = (check for check in outcome.verdict.checks if check.name == "progress")
    assert "nothing was stale for long at the end" in progress.detail


def test_a_wreck_that_is_removed_closes_nothing_out() -> None:
    assert ran("holonomic", {**KILL, "wreck": "removed"}, width_m=1.2).summary.closed_out == []


def three_cars(policy: str, duration: float) -> Prepared:
    """Two rooms of 10 x 14 m, with r2 in the only door, r1 and r3 in one of them."""
    rooms = plan((21.0, 14.0), (0.0, 0.0, 10.0, 14.0), (10.0, 2.5, 11.0, 4.0), (11.0, 0.0, 21.0, 14.0), point=0.5)
    starts = [Pose(4.0, 3.0, 0.0), Pose(10.25, 3.25, 0.0), Pose(4.0, 11.0, 0.0)]
    robots = {"model": "car", "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    patrol = {"policy": policy}
    return prepared_in(rooms, starts, robots, sensor={"range": 3.0}, duration=duration, faults=[KILL], patrol=patrol)


@pytest.mark.parametrize("policy", ["stochastic", "potential-field"])
def test_robots_that_know_different_things_of_a_wreck_share_nothing_of_it(policy: str) -> None:
    given = three_cars(policy, 500.0)
    together, alone = run_in_process(given), run_in_process(given, share=False)
    assert {name for name, robot in together.summary.robots.items() if robot.collisions} == {"r1", "r3"}
    assert end_of(together.journal) == end_of(alone.journal)


def test_a_robot_that_leaves_ground_out_or_finds_it_much_too_old_chooses_freely_and_else_plans() -> None:
    records: list[TickRecord] = []
    states = {"left out": set[str](), "too old": set[str](), "else": set[str]()}

    def look(world: World, minds: Mapping[int, Mind]) -> None:
        for row in records[-1].robots:
            if row.number not in minds:
                continue
            mind = minds[row.number]
            assert mind.blocked is not None
            left_out = mind.blocked.left_out is not None and mind.blocked.left_out.any()
            # A round of two robots takes less than 50 s.
            too_old = mind._fog.mfow(world.tick) * world.step > 200.0
            states["left out" if left_out else "too old" if too_old else "else"].add(row.state)

    run_in_process(three_cars("stochastic", 420.0), progress=records.append, look=look)
    assert State.PATROLLING in states["else"]
    for kind in ("left out", "too old"):
        assert State.FREE in states[kind]
        assert State.PATROLLING not in states[kind]
