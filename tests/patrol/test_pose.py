"""Commands of every model: what a message holds of them, and the limits of bodies."""

from __future__ import annotations

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.pose import COMMANDS, MODELS, Command, Drive, Velocity, command_of, halted, pack_command, unpack_command

anything = st.floats(allow_nan=False)
finite = st.floats(allow_nan=False, allow_infinity=False)
limits = st.floats(0.01, 100.0)


def test_every_model_has_a_command_and_every_command_a_model() -> None:
    assert set(COMMANDS) == set(MODELS)
    assert set(COMMANDS.values()) == set(get_args(Command))


@pytest.mark.parametrize("model", MODELS)
@given(first=anything, second=anything)
def test_a_command_comes_back_from_its_numbers_and_from_a_message(model: str, first: float, second: float) -> None:
    command = command_of(model, first, second)
    assert type(command) is COMMANDS[model]
    assert command.numbers == (first, second)
    packed = pack_command(command)
    assert [type(value) for value in packed] == [int, float, float]
    again = unpack_command(*packed)
    assert again == command
    assert [math.copysign(1.0, value) for value in again.numbers] == [
        math.copysign(1.0, value) for value in command.numbers
    ]


def test_the_kinds_of_commands_in_a_message_never_change() -> None:
    assert pack_command(Velocity(1.0, 2.0)) == (0, 1.0, 2.0)
    assert pack_command(Drive(1.0, 2.0)) == (1, 1.0, 2.0)


def test_numbers_that_are_not_finite_pass() -> None:
    again = unpack_command(*pack_command(Velocity(math.nan, -math.inf)))
    assert isinstance(again, Velocity)
    assert math.isnan(again.vx)
    assert again.vy == -math.inf


@pytest.mark.parametrize("kind", [-1, len(COMMANDS), 255])
def test_an_unknown_kind_of_command_is_refused(kind: int) -> None:
    with pytest.raises(ValueError, match=f"no kind of command has the number {kind}"):
        unpack_command(kind, 1.0, 2.0)


@pytest.mark.parametrize("model", MODELS)
def test_a_halted_body_stands_still_whatever_its_limits(model: str) -> None:
    still = halted(model)
    assert type(still) is COMMANDS[model]
    assert still.numbers == (0.0, 0.0)
    assert still.speed_mps == 0.0
    assert still.is_within(0.0, 1.0)
    assert still.limited(0.5, 1.0) == still


def test_a_speed_is_a_speed_in_any_direction() -> None:
    assert Velocity(-3.0, 4.0).speed_mps == 5.0
    assert Drive(-3.0, 0.2).speed_mps == 3.0


@pytest.mark.parametrize("model", MODELS)
@given(first=finite, second=finite, speed=limits, turning_radius=limits)
def test_a_limited_command_is_within_its_limits(
    model: str, first: float, second: float, speed: float, turning_radius: float
) -> None:
    command = command_of(model, first, second)
    limited = command.limited(speed, turning_radius)
    assert type(limited) is type(command)
    assert limited.is_within(speed, turning_radius)
    if all(abs(number) <= speed / 2.0 for number in command.numbers) and abs(second) <= 1.0 / turning_radius:
        assert limited == command


@given(vx=finite, vy=finite, speed=limits)
def test_a_limited_velocity_keeps_its_direction_and_as_much_speed_as_it_can(vx: float, vy: float, speed: float) -> None:
    limited = Velocity(vx, vy).limited(speed, 1.0)
    wanted = math.hypot(vx, vy)
    assert limited.speed_mps == pytest.approx(min(speed, wanted))
    if wanted > 1e-300:
        assert math.remainder(math.atan2(limited.vy, limited.vx) - math.atan2(vy, vx), math.tau) == pytest.approx(
            0.0, abs=1e-9
        )


def test_a_limited_drive_is_cut_in_speed_and_curvature_by_themselves() -> None:
    assert Drive(9.0, -7.0).limited(2.0, 4.0) == Drive(2.0, -0.25)
    assert Drive(-9.0, 0.1).limited(2.0, 4.0) == Drive(-2.0, 0.1)


def test_a_command_beyond_a_limit_is_not_within_it() -> None:
    assert Velocity(3.0, 4.0).is_within(5.0, 1.0)
    assert not Velocity(3.0, 4.0).is_within(4.999, 1.0)
    assert Drive(-2.0, 0.25).is_within(2.0, 4.0)
    assert not Drive(-2.001, 0.0).is_within(2.0, 4.0)
    assert not Drive(0.0, 0.2501).is_within(2.0, 4.0)
    for bad in (Velocity(math.nan, 0.0), Velocity(math.inf, 0.0), Drive(math.nan, 0.0), Drive(0.0, math.nan)):
        assert not bad.is_within(5.0, 1.0)
