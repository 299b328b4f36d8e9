"""Keeping to a planned way: a body that is a little off comes back to it, and one that is on it does as planned."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.policies.common_plan.tracking import keep_to
from patrol.ground.swept_path import advance
from patrol.pose import COMMANDS, MODELS, Command, Drive, Pose, Twist, Velocity
from patrol.scenario import RobotSpec, load_scenario

STEP = 0.5
SPEED = 2.0
STRIDE = SPEED * STEP


def spec_of(model: str) -> RobotSpec:
    robots = {"count": 1, "model": model, "speed": SPEED, "turning_radius": 2.0, "radius": 0.5}
    return load_scenario({"terrain": {"builtin": "open"}, "robots": robots}).roster[0]


def planned(model: str) -> list[Command]:
    """Straight on, to the left and to the right, a little slower than the body can."""
    slower = 0.9 * SPEED
    if model == "holonomic":
        return [
            Velocity(slower * math.cos(turn), slower * math.sin(turn)) for turn in (0.0, 0.5, 2.0) for _ in range(8)
        ]
    if model == "car":
        return [Drive(slower, bend) for bend in (0.0, 0.3, -0.3) for _ in range(8)]
    return [Twist(0.7 * SPEED, rate) for rate in (0.0, 0.5, -0.5) for _ in range(8)]


@pytest.mark.parametrize("model", MODELS)
def test_one_that_is_on_its_way_does_as_planned(model: str) -> None:
    pose = Pose(1.0, 2.0, 0.3)
    for command in planned(model):
        step = keep_to(pose, pose, command, spec_of(model), STEP)
        assert step.numbers == pytest.approx(command.numbers)


@given(st.sampled_from(MODELS), st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-0.4, 0.4))
def test_one_that_is_a_little_off_comes_back(model: str, along: float, left: float, askew: float) -> None:
    spec, at = spec_of(model), Pose(0.0, 0.0, 0.0)
    pose = Pose(along * STRIDE, left * STRIDE, askew)
    for command in planned(model):
        step = keep_to(pose, at, command, spec, STEP).limited(spec.limits)
        assert type(step) is COMMANDS[model]
        pose, at = advance(pose, step, STEP), advance(at, command, STEP)
    assert math.dist((pose.x, pose.y), (at.x, at.y)) < 0.25 * STRIDE
    if model != "holonomic":
        assert abs(math.remainder(pose.heading - at.heading, math.tau)) < 0.15


def test_a_car_in_reverse_comes_back_too() -> None:
    spec, pose, at = spec_of("car"), Pose(0.2, 0.5, 0.2), Pose(0.0, 0.0, 0.0)
    for _ in range(25):
        command = Drive(-0.9 * SPEED, 0.0)
        pose = advance(pose, keep_to(pose, at, command, spec, STEP).limited(spec.limits), STEP)
        at = advance(at, command, STEP)
    assert math.dist((pose.x, pose.y), (at.x, at.y)) < 0.25


def test_one_that_turns_on_the_spot_ends_as_planned() -> None:
    spec = spec_of("differential")
    step = keep_to(Pose(0.0, 0.0, 0.1), Pose(0.0, 0.0, 0.0), Twist(0.0, 1.0), spec, STEP)
    assert isinstance(step, Twist)
    assert step.speed == 0.0
    assert 0.0 < step.turn_rate < 1.0
