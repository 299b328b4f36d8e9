"""Motion noise: as large as configured, new where it should be, and the same for the same seed, robot and tick."""

import math
import statistics
from collections.abc import Mapping
from typing import Any

import pytest

from patrol.pose import Command, Drive, Twist, Velocity
from patrol.scenario import load_scenario
from worldsim.faults import Timeline
from worldsim.robots.noise import MotionNoise

# Not the product's own, so that a wrong one there is noticed.
FASTEST = 1.95
SLOWEST = 0.05

ROBOTS = [{"model": model} for model in ("car", "differential", "holonomic")]
COMMANDS: Mapping[int, Command] = {1: Drive(1.0, 0.1), 2: Twist(1.0, 0.2), 3: Velocity(0.6, 0.8)}
STEP = 0.5
OF_ANOTHER = {"who": ["r1"], "speed": 0.1}


def noise(*faults: dict[str, Any], seed: int = 1) -> MotionNoise:
    listed = [{"kind": "motion", "who": "all", **fault} for fault in faults]
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": ROBOTS, "seed": seed, "faults": listed})
    return MotionNoise(scenario, Timeline(scenario))


def speeds(of: MotionNoise, number: int = 3, ticks: int = 3000) -> list[float]:
    return [of.driven(k, COMMANDS)[number].speed_mps for k in range(ticks)]


def test_without_a_fault_bodies_do_what_they_are_commanded() -> None:
    assert noise().driven(7, COMMANDS) == COMMANDS
    assert noise({"at": 2.0, "for": 3.0, "speed": 0.5, "veer": 0.1}).driven(3, COMMANDS) == COMMANDS
    assert noise({"at": 2.0, "for": 3.0, "speed": 0.5, "veer": 0.1}).driven(10, COMMANDS) == COMMANDS


def test_a_body_that_is_commanded_to_stand_stands() -> None:
    still: dict[int, Command] = {1: Drive(0.0, 0.3), 2: Twist(0.0, 0.0), 3: Velocity(0.0, 0.0)}
    every = {"speed": 0.5, "turning": 0.5, "veer": 0.5, "jitter": {"size": 0.5}}
    assert noise(every).driven(7, still) == still


@pytest.mark.parametrize("number", COMMANDS)
def test_speeds_spread_as_configured_round_the_commanded(number: int) -> None:
    drawn = speeds(noise({"speed": 0.2}), number)
    assert len(set(drawn)) == len(drawn)
    assert statistics.mean(drawn) == pytest.approx(1.0, abs=0.02)
    assert statistics.stdev(drawn) == pytest.approx(0.2, rel=0.05)
    assert min(speeds(noise({"speed": 1.0}))) == pytest.approx(SLOWEST)
    assert max(speeds(noise({"speed": 1.0}))) == pytest.approx(FASTEST)


def test_a_jittered_speed_holds_for_its_time_and_lies_anywhere_within_its_size() -> None:
    drawn = speeds(noise({"jitter": {"size": 0.4, "every": 2.0}}), ticks=4000)
    assert [len(set(drawn[k : k + 4])) for k in range(0, 4000, 4)] == [1] * 1000
    assert len(set(drawn)) == 1000
    assert 0.6 <= min(drawn) < 0.61
    assert 1.39 < max(drawn) <= 1.4
    assert statistics.mean(drawn) == pytest.approx(1.0, abs=0.03)
    assert len(set(speeds(noise({"jitter": {"size": 0.4}}), ticks=50))) == 50


def test_a_slipping_body_stands_for_a_share_of_the_time() -> None:
    drawn = speeds(noise({"slip": {"rate": 0.3, "every": 2.0}}), ticks=4000)
    assert [len(set(drawn[k : k + 4])) for k in range(0, 4000, 4)] == [1] * 1000
    assert drawn.count(0.0) / 4000 == pytest.approx(0.3, abs=0.05)
    assert set(drawn) == {0.0, 1.0}
    assert noise({"slip": {"rate": 1.0}}).driven(0, COMMANDS) == {1: Drive(0, 0), 2: Twist(0, 0), 3: Velocity(0, 0)}


def test_turns_spread_as_configured_and_bodies_veer_by_the_metre() -> None:
    both = [noise({"turning": 0.2}), noise({"veer": 0.1})]
    by_share, by_metre = ([of.driven(k, COMMANDS) for k in range(2000)] for of in both)
    for number, asked, field in ((1, 0.1, "curvature"), (2, 0.2, "turn_rate")):
        turned = [getattr(driven[number], field) for driven in by_share]
        assert statistics.stdev(turned) == pytest.approx(0.2 * asked, rel=0.06)
        veered = [getattr(driven[number], field) for driven in by_metre]
        assert statistics.mean(veered) == pytest.approx(asked, abs=0.01)
        assert statistics.stdev(veered) == pytest.approx(0.1, rel=0.06)
    bearings = [math.atan2(*reversed(driven[3].numbers)) - math.atan2(0.8, 0.6) for driven in by_metre]
    assert statistics.stdev(bearings) == pytest.approx(0.1 * STEP, rel=0.06)
    assert {driven[3] for driven in by_share} == {COMMANDS[3]}
    assert all(driven[3].speed_mps == pytest.approx(1.0) for driven in by_metre)


def test_what_is_drawn_depends_on_seed_fault_robot_and_tick_alone() -> None:
    fault = {"speed": 0.2, "slip": {"rate": 0.5}}
    here = noise(fault).driven(5, COMMANDS)
    assert noise(fault).driven(5, {3: COMMANDS[3]})[3] == here[3]
    others = noise(fault, seed=2), noise(OF_ANOTHER, fault)
    assert all(speeds(other, ticks=20) != speeds(noise(fault), ticks=20) for other in others)
    assert speeds(noise(fault), 1, 20) != speeds(noise(fault), 3, 20)


def test_several_faults_of_a_robot_act_one_after_the_other() -> None:
    one, two = {"who": ["r3"], "jitter": {"size": 0.5}}, {"jitter": {"size": 0.2}}
    both = speeds(noise(one, two), ticks=50)
    alone = [a * b for a, b in zip(speeds(noise(one), ticks=50), speeds(noise(OF_ANOTHER, two), ticks=50), strict=True)]
    assert both == pytest.approx(alone)
    assert speeds(noise(one), 1, 5) == [1.0] * 5


def test_wheels_veer_by_the_metres_that_they_drive_and_not_by_those_commanded() -> None:
    veer, jitter = {"veer": 0.1}, {"jitter": {"size": 0.9}}
    alone, both = noise(veer), noise({**veer, **jitter})
    for k in range(50):
        a, b = alone.driven(k, COMMANDS)[2], both.driven(k, COMMANDS)[2]
        assert isinstance(a, Twist)
        assert isinstance(b, Twist)
        assert b.turn_rate - 0.2 == pytest.approx((a.turn_rate - 0.2) * b.speed)


@pytest.mark.parametrize("number", COMMANDS)
def test_a_body_veers_by_the_way_that_it_drives_however_its_speed_is_disturbed(number: int) -> None:
    def veered(command: Command) -> float:
        """In rad per m."""
        if isinstance(command, Drive):
            return command.curvature - 0.1
        if isinstance(command, Twist):
            return (command.turn_rate - 0.2) / command.speed
        assert isinstance(command, Velocity)
        return (math.atan2(command.vy, command.vx) - math.atan2(0.8, 0.6)) / (command.speed_mps * STEP)

    calm, disturbed = noise({"veer": 0.1}), noise({"veer": 0.1, "jitter": {"size": 0.5}})
    for k in range(20):
        one, other = (of.driven(k, COMMANDS)[number] for of in (calm, disturbed))
        assert one.speed_mps != pytest.approx(other.speed_mps)
        assert veered(one) == pytest.approx(veered(other))
