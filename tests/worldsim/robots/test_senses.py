"""Wrong about place and time: what robots are told, and that only what they say follows from it."""

import statistics
from itertools import pairwise
from typing import Any

import pytest

from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.message import MAX_TIME_MS, decode
from patrol.scenario import load_scenario
from tests.worldsim.checks.judged import failures
from tests.worldsim.conftest import Lab
from worldsim.faults import Timeline
from worldsim.robots.senses import Senses

HERE = Pose(10.0, 8.0, 0.3)


def senses(terrain: Terrain, *faults: dict[str, Any]) -> Senses:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": {"count": 3}, "faults": list(faults)})
    return Senses(scenario, Timeline(scenario), terrain)


def test_without_a_fault_all_is_as_it_is(lab: Lab) -> None:
    told = senses(lab.room)
    assert told.pose(1, 7, HERE) is HERE
    assert told.clock(1, 7) == 3.5


def test_a_bias_grows_for_those_it_befalls_while_it_lasts_and_several_add_up(lab: Lab) -> None:
    fault = {"kind": "drift", "who": "r2", "bias": [1.0, -0.5], "growth": [0.5, 0.0], "at": 2.0, "for": 3.0}
    told = senses(lab.room, fault)
    assert [told.pose(2, k, HERE).x for k in (3, 4, 6, 9, 10)] == [10.0, 11.0, 11.5, 12.25, 10.0]
    assert told.pose(2, 4, HERE) == Pose(11.0, 7.5, 0.3)
    assert told.pose(1, 4, HERE) == HERE
    several = senses(lab.room, *[{"kind": "drift", "who": "all", "bias": [0.5, 0.0]}] * 3)
    assert several.pose(3, 0, HERE).x == 11.5


def test_noise_is_new_in_each_tick_and_as_wide_as_asked_for(lab: Lab) -> None:
    told = senses(lab.room, {"kind": "drift", "who": "all", "noise": 0.5})
    errors = [told.pose(1, k, HERE).x - HERE.x for k in range(2000)]
    assert len(set(errors)) == 2000
    assert statistics.mean(errors) == pytest.approx(0.0, abs=0.05)
    assert statistics.stdev(errors) == pytest.approx(0.5, rel=0.08)
    assert told.pose(1, 77, HERE) == senses(lab.room, {"kind": "drift", "who": "all", "noise": 0.5}).pose(1, 77, HERE)


def test_jumps_add_up_in_directions_that_are_drawn(lab: Lab) -> None:
    told = senses(lab.room, {"kind": "drift", "who": "all", "jump": {"every": 2.0, "size": 1.5}})
    poses = [told.pose(1, k, HERE) for k in range(12)]
    steps = [((b.x - a.x) ** 2 + (b.y - a.y) ** 2) ** 0.5 for a, b in pairwise(poses)]
    assert steps == pytest.approx([1.5 if k % 4 == 0 else 0.0 for k in range(1, 12)])
    assert told.pose(2, 4, HERE) != told.pose(1, 4, HERE)


def test_nobody_takes_itself_to_be_off_the_terrain(lab: Lab) -> None:
    told = senses(lab.room, {"kind": "drift", "who": "all", "bias": [-900.0, 900.0]})
    pose = told.pose(1, 0, HERE)
    assert (pose.x, pose.y) == (0.25, 14.75)
    assert lab.room.contains(pose.x, pose.y)


def test_a_clock_is_ahead_and_gains(lab: Lab) -> None:
    told = senses(lab.room, {"kind": "clock", "who": "r1", "offset": 5.0, "rate": 0.1, "at": 1.0})
    assert [told.clock(1, k) for k in (0, 1, 2, 4)] == pytest.approx([0.0, 0.5, 6.0, 7.1])
    assert told.clock(2, 4) == 2.0


@pytest.mark.parametrize(("offset", "shown"), [(-50.0, 0.0), (1e9, MAX_TIME_MS / 1000.0)])
def test_a_clock_shows_only_what_a_message_can_say(lab: Lab, offset: float, shown: float) -> None:
    assert senses(lab.room, {"kind": "clock", "who": "all", "offset": offset}).clock(1, 3) == shown


DRIFT = {"kind": "drift", "who": "r1", "bias": [0.5, 0.25], "noise": 0.1}
CLOCK = {"kind": "clock", "who": "r2", "offset": 7.0}


def test_a_run_with_wrong_robots_is_valid_and_only_their_messages_show_it(lab: Lab) -> None:
    plain, wrong = lab.patrol(ticks=12), lab.patrol(ticks=12, faults=[DRIFT, CLOCK])
    true, told = lab.run(plain), lab.run(wrong)
    assert failures((wrong, told)) == {}
    for a, b in zip(true.ticks, told.ticks, strict=True):
        assert (a.robots, a.mfow, a.deliveries) == (b.robots, b.mfow, b.deliveries)
        said, due = ({source: decode(frame) for source, frame in record.frames} for record in (b, a))
        assert said[1].x_cm != due[1].x_cm
        assert (said[2].pose, said[2].time_ms) == (due[2].pose, due[2].time_ms + 7000)
        assert [said[n] for n in (3, 4)] == [due[n] for n in (3, 4)]


def test_a_robot_that_says_the_truth_though_it_was_told_otherwise_fails(lab: Lab) -> None:
    world = lab.patrol(ticks=12, faults=[DRIFT, CLOCK])
    journal = lab.run(lab.patrol(ticks=12))
    assert "frames" in failures((world, journal))
