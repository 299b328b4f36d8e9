import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.pose import (
    COMMANDS,
    MODELS,
    Command,
    Drive,
    Limits,
    Twist,
    Velocity,
    command_of,
    halted,
    is_halt,
    pack_command,
    slowed,
    unpack_command,
)

anything = st.floats(allow_nan=False)
finite = st.floats(allow_nan=False, allow_infinity=False)
sizes = st.floats(0.01, 100.0)
limits = st.builds(Limits, sizes, sizes, sizes)


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
    assert [type(value) for value in packed] == [int, float, float, type(None)]
    again = unpack_command(*packed)
    assert again == command
    signs = [[math.copysign(1.0, value) for value in each.numbers] for each in (again, command)]
    assert signs[0] == signs[1]


def test_the_kinds_of_commands_in_a_message_never_change_and_numbers_not_finite_pass() -> None:
    assert pack_command(Velocity(1.0, 2.0)) == (0, 1.0, 2.0, None)
    assert pack_command(Velocity(1.0, 2.0, 3.0)) == (0, 1.0, 2.0, 3.0)
    assert pack_command(Drive(1.0, 2.0)) == (1, 1.0, 2.0, None)
    assert pack_command(Twist(1.0, 2.0)) == (2, 1.0, 2.0, None)
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
    assert is_halt(still)
    assert still.is_within(Limits(0.0, 1.0, 1.0))
    assert still.limited(Limits(0.5, 1.0, 1.0)) == still


def test_speeds_have_any_direction_and_a_turn_on_the_spot_is_no_halt() -> None:
    assert Velocity(-3.0, 4.0).speed_mps == 5.0
    assert Drive(-3.0, 0.2).speed_mps == 3.0
    assert Twist(-3.0, 0.2).speed_mps == 3.0
    assert not is_halt(Twist(0.0, -0.1))
    assert is_halt(Drive(0.0, 0.2))
    assert not any(is_halt(command) for command in (Velocity(0.0, -0.1), Drive(-0.1, 0.0), Twist(-0.1, 0.0)))


@pytest.mark.parametrize("model", MODELS)
@given(first=finite, second=finite, bounds=limits)
def test_a_limited_command_is_within_its_limits(model: str, first: float, second: float, bounds: Limits) -> None:
    command = command_of(model, first, second)
    limited = command.limited(bounds)
    assert type(limited) is type(command)
    assert all(map(math.isfinite, limited.numbers))
    assert limited.is_within(bounds)
    slow = all(abs(number) <= bounds.speed / 2.0 for number in command.numbers)
    if slow and abs(second) <= min(1.0 / bounds.turning_radius, bounds.speed / bounds.radius / 2.0):
        assert limited == command


@given(vx=finite, vy=finite, speed=sizes)
def test_a_limited_velocity_keeps_its_direction_and_as_much_speed_as_it_can(vx: float, vy: float, speed: float) -> None:
    limited = Velocity(vx, vy).limited(Limits(speed, 1.0, 1.0))
    wanted = math.hypot(vx, vy)
    assert limited.speed_mps == pytest.approx(min(speed, wanted))
    if wanted > 1e-300:
        turned = math.atan2(limited.vy, limited.vx) - math.atan2(vy, vx)
        assert math.remainder(turned, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_limited_drive_is_cut_in_speed_and_curvature_by_themselves() -> None:
    car = Limits(2.0, 1.0, 4.0)
    assert Drive(9.0, -7.0).limited(car) == Drive(2.0, -0.25)
    assert Drive(-9.0, 0.1).limited(car) == Drive(-2.0, 0.1)


@given(speed=finite, turn_rate=finite, bounds=limits)
def test_a_limited_twist_keeps_its_arc_and_the_faster_wheel_runs_as_fast_as_it_can(
    speed: float, turn_rate: float, bounds: Limits
) -> None:
    limited = Twist(speed, turn_rate).limited(bounds)
    wheels = [abs(limited.speed + side * limited.turn_rate * bounds.radius) for side in (-1, 1)]
    if Twist(speed, turn_rate).is_within(bounds):
        assert limited.numbers == pytest.approx((speed, turn_rate))
    else:
        assert max(wheels) == pytest.approx(bounds.speed)
        # The same curvature, multiplied out; the numbers are scaled down so that no product overflows.
        larger = max(abs(speed), abs(turn_rate))
        due = limited.speed * (turn_rate / larger)
        assert limited.turn_rate * (speed / larger) == pytest.approx(due, rel=1e-9, abs=1e-300)
        assert math.copysign(1.0, limited.speed) == math.copysign(1.0, speed)
        assert math.copysign(1.0, limited.turn_rate) == math.copysign(1.0, turn_rate)


def test_a_command_beyond_a_limit_is_not_within_it() -> None:
    disc, car, base = Limits(5.0, 1.0, 1.0), Limits(2.0, 1.0, 4.0), Limits(2.0, 0.5, 4.0)
    assert Velocity(3.0, 4.0).is_within(disc)
    assert not Velocity(3.0, 4.0).is_within(Limits(4.999, 1.0, 1.0))
    assert Drive(-2.0, 0.25).is_within(car)
    assert not any(command.is_within(car) for command in (Drive(-2.001, 0.0), Drive(0.0, 0.2501)))
    assert all(command.is_within(base) for command in (Twist(-1.0, 2.0), Twist(0.0, -4.0)))
    assert not any(command.is_within(base) for command in (Twist(-1.001, 2.0), Twist(0.0, -4.001)))
    for bad in (math.nan, math.inf, -math.inf):
        for command in (Velocity(bad, 0.0), Drive(bad, 0.0), Drive(0.0, bad), Twist(bad, 0.0), Twist(0.0, bad)):
            assert not command.is_within(base)


@pytest.mark.parametrize("model", MODELS)
@given(first=st.floats(-50.0, 50.0), second=st.floats(-50.0, 50.0), top=st.floats(0.01, 20.0))
def test_a_slowed_command_leads_along_the_same_path(model: str, first: float, second: float, top: float) -> None:
    command = command_of(model, first, second)
    slow = slowed(command, top)
    assert slow.speed_mps <= max(top * (1.0 + 1e-12), 0.0)
    if command.speed_mps <= top:
        assert slow is command
        return
    assert slow.speed_mps == pytest.approx(top)
    match command, slow:
        case Velocity(), Velocity():
            assert math.atan2(slow.vy, slow.vx) == pytest.approx(math.atan2(command.vy, command.vx), abs=1e-9)
        case Drive(), Drive():
            assert slow.curvature == command.curvature
            assert math.copysign(1.0, slow.speed) == math.copysign(1.0, command.speed)
        case Twist(), Twist():
            assert slow.turn_rate * command.speed == pytest.approx(command.turn_rate * slow.speed)
