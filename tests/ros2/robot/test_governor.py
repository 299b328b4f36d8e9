"""Commands, limits, fence and stops: what the robot is told."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Limits, Pose, Twist, Velocity, halted, is_halt, scaled
from ros2.robot.fence import Fence
from ros2.robot.governor import Governor, nearer, velocity_of
from ros2.robot.steering import steering_of
from ros2.wire import messages

RADIUS = 0.3
LIMITS = Limits(1.0, RADIUS, 0.5)
PERIOD_S = 0.05
ROUGHLY = RADIUS - 0.001
"""The radius by which a path is judged again: arcs are checked as chords, which lie within a tenth of a millimetre."""
MIDDLE = Pose(5.0, 5.0, 0.0)


def terrain() -> Terrain:
    """10 x 10 m, with a wall from x = 8 on and a keep-out area up to y = 1."""
    passable = np.ones((100, 100), dtype=np.bool_)
    passable[:, 80:] = False
    keep_out = np.zeros_like(passable)
    keep_out[:10] = True
    return Terrain("t", passable, 0.1, keep_out=keep_out)


def governor(model: str, acceleration: float = 1.0) -> Governor:
    return Governor(model, LIMITS, acceleration, 0.75, Fence(terrain(), RADIUS, 0.2, acceleration))


def driven(one: Governor, pose: Pose, wanted: Command, steps: int) -> list[tuple[Pose, Command]]:
    """Poses and commands of a body that is told to go on and on."""
    seen = []
    for number in range(steps):
        one.want(wanted, number * PERIOD_S)
        command = one.step(pose, number * PERIOD_S, PERIOD_S, "")
        pose = advance(pose, command, PERIOD_S)
        seen.append((pose, command))
    return seen


def test_velocities_are_in_the_bodys_frame_and_a_car_turns_its_wheels_by_its_wheelbase() -> None:
    up = velocity_of(Velocity(0.0, 1.0), math.pi / 2)
    assert (up.vx, up.vy, up.turn_rate) == pytest.approx((1.0, 0.0, 0.0))
    assert velocity_of(Twist(0.5, -0.2), 1.0) == messages.Twist(0.5, 0.0, -0.2)
    assert velocity_of(Drive(-0.5, 0.4), 1.0) == messages.Twist(-0.5, 0.0, -0.2)
    assert steering_of(Drive(-0.5, 0.5), 2.0) == pytest.approx((-0.5, math.pi / 4))


@given(st.floats(0.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_slower_command_leads_along_the_same_path(share: float, speed: float, turn: float) -> None:
    for command in (Twist(speed, turn), Drive(speed, turn), Velocity(speed, turn)):
        slow, fast = advance(MIDDLE, scaled(command, share), 1.0), advance(MIDDLE, command, share)
        assert (slow.x, slow.y) == pytest.approx((fast.x, fast.y), abs=1e-9)


FAST = [("holonomic", Velocity(9.0, 0.0)), ("differential", Twist(9.0, 0.0)), ("car", Drive(9.0, 0.0))]


@pytest.mark.parametrize(("model", "wanted"), FAST)
def test_speed_and_acceleration_stay_within_limits(model: str, wanted: Command) -> None:
    speeds = [command.speed_mps for _, command in driven(governor(model), Pose(2.0, 5.0, 0.0), wanted, 40)]
    assert max(speeds) == pytest.approx(1.0)
    assert all(abs(after - before) <= PERIOD_S + 1e-9 for before, after in pairwise([0.0, *speeds]))
    assert speeds[9] == pytest.approx(0.5)


@pytest.mark.parametrize("heading", [0.0, 0.4, -0.9, 2.4, -2.0])
@pytest.mark.parametrize(
    ("model", "wanted"),
    [
        ("holonomic", Velocity(1.0, 0.3)),
        ("holonomic", Velocity(0.2, -1.0)),
        ("differential", Twist(0.8, 0.3)),
        ("differential", Twist(-0.8, -0.5)),
        ("car", Drive(1.0, 0.7)),
        ("car", Drive(-1.0, -0.2)),
    ],
)
def test_the_fence_brakes_before_walls_and_keep_out_areas(model: str, wanted: Command, heading: float) -> None:
    """From any speed the body stops on the ground, also when it stops late and brakes no harder than it can."""
    one = governor(model)
    pose = Pose(6.5, 2.5, heading)
    for after, command in driven(one, pose, wanted, 200):
        assert path_is_free(terrain(), pose, command, PERIOD_S, ROUGHLY)
        stopping_s = PERIOD_S + command.speed_mps / 2.0
        assert path_is_free(terrain(), after, command, stopping_s, ROUGHLY), (after, command)
        pose = after


@pytest.mark.parametrize(("braking", "stops"), [(1.0, True), (4.0, False)])
def test_the_fence_relies_on_how_hard_a_body_brakes(braking: float, stops: bool) -> None:
    """Its motors change its speed by 1 m/s², whatever it is told; one that is said to brake harder hits the wall."""
    one = Governor("differential", Limits(2.0, RADIUS, 0.5), 4.0, 0.75, Fence(terrain(), RADIUS, 0.2, braking))
    pose, speed = Pose(1.0, 5.0, 0.0), 0.0
    for number in range(400):
        one.want(Twist(2.0, 0.0), number * PERIOD_S)
        told = one.step(pose, number * PERIOD_S, PERIOD_S, "").speed_mps
        speed += min(max(told - speed, -PERIOD_S), PERIOD_S)
        pose = advance(pose, Twist(speed, 0.0), PERIOD_S)
    assert (pose.x <= 8.0 - RADIUS) == stops, pose


def test_a_body_at_a_wall_may_turn_and_drive_away_and_nothing_else() -> None:
    at_wall = Pose(7.7 + 0.01, 5.0, 0.0)
    fence = Fence(terrain(), RADIUS, 0.2, 1.0)
    assert is_halt(fence.allowed(at_wall, Drive(0.5, 0.0)))
    assert fence.allowed(at_wall, Twist(0.5, 0.3)) == Twist(0.0, 0.3)
    assert fence.allowed(at_wall, Twist(-0.5, 0.0)) == Twist(-0.5, 0.0)
    assert fence.allowed(at_wall, Velocity(-0.5, 0.0)) == Velocity(-0.5, 0.0)


@pytest.mark.parametrize("place", [(8.5, 5.0), (5.0, 0.5), (-3.0, 5.0), (math.nan, 0.0)])
def test_a_body_off_the_ground_stands(place: tuple[float, float]) -> None:
    pose = Pose(*place, 0.0)
    for command in (Velocity(0.5, 0.1), Twist(0.5, 0.1), Drive(0.5, 0.1)):
        assert is_halt(Fence(terrain(), RADIUS, 0.2, 1.0).allowed(pose, command))


@pytest.mark.parametrize(("model", "wanted"), [("differential", Twist(1.0, 0.2)), ("holonomic", Velocity(1.0, 0.0))])
def test_who_does_not_know_where_it_is_stands_at_once(model: str, wanted: Command) -> None:
    one = governor(model)
    driven(one, Pose(2.0, 5.0, 0.0), wanted, 20)
    assert not is_halt(one.command)
    assert one.step(None, 1.0, PERIOD_S, "") == halted(model)
    assert one.why == "nobody knows where it is"


def test_who_is_stopped_stands_at_once_and_starts_gently_when_it_is_released() -> None:
    one = governor("differential")
    (pose, _), *_ = reversed(driven(one, Pose(2.0, 5.0, 0.0), Twist(1.0, 0.0), 20))
    one.want(Twist(1.0, 0.0), 1.0)
    assert one.step(pose, 1.0, PERIOD_S, "stopped by me") == halted("differential")
    assert one.why == "stopped by me"
    assert one.step(pose, 1.05, PERIOD_S, "").numbers == pytest.approx((PERIOD_S, 0.0))


def test_a_command_is_obeyed_for_its_time_only() -> None:
    one = governor("car")
    driven(one, Pose(2.0, 5.0, 0.0), Drive(1.0, 0.0), 20)  # the last at 0.95 s, for 0.75 s
    assert one.step(Pose(3.0, 5.0, 0.0), 1.69, PERIOD_S, "").speed_mps > 0.9
    for number in range(25):
        one.step(Pose(3.0, 5.0, 0.0), 1.71 + number * PERIOD_S, PERIOD_S, "")
    assert is_halt(one.command)
    assert one.why == "no command has come"


@pytest.mark.parametrize(
    ("command", "wanted", "most", "told"),
    [
        (Velocity(1.0, 2.0), Velocity(4.0, 6.0), 2.5, Velocity(2.5, 4.0)),  # 5 m/s of change, of which it makes half
        (Velocity(1.0, 2.0), Velocity(4.0, -2.0), 2.5, Velocity(2.5, 0.0)),
        (Velocity(1.0, 2.0), Velocity(4.0, 6.0), 5.0, Velocity(4.0, 6.0)),
        (Twist(1.0, 2.0), Twist(3.0, 9.0), 0.5, Twist(1.5, 4.0)),  # 0.5 m/s at 0.25 m are 2 rad/s
        (Twist(1.0, 2.0), Twist(-3.0, -9.0), 0.5, Twist(0.5, 0.0)),
        (Twist(1.0, 2.0), Twist(1.25, 2.5), 0.5, Twist(1.25, 2.5)),
        (Twist(1.0, 0.0), Twist(0.0, 2.0), 0.5, Twist(0.5, 2.0)),
        (Twist(0.0, 0.0), Twist(0.0, 9.0), 0.5, Twist(0.0, 2.0)),  # on the spot as when driving
        (Twist(0.0, 0.0), Twist(0.0, -9.0), 0.5, Twist(0.0, -2.0)),
        (Drive(1.0, 0.5), Drive(3.0, -0.25), 0.5, Drive(1.5, -0.25)),
        (Drive(1.0, 0.5), Drive(-3.0, 0.0), 0.5, Drive(0.5, 0.0)),
    ],
)
def test_speeds_change_by_as_much_as_they_may_and_no_more(
    command: Command, wanted: Command, most: float, told: Command
) -> None:
    assert nearer(command, wanted, most, 0.25) == told


@pytest.mark.parametrize(
    ("wanted", "now_s", "why"),
    [
        (Twist(0.0, 0.0), 0.5, ""),  # it is told to stand
        (Twist(0.0, 0.0), 0.75, "no command has come"),
        (Twist(1.0, 0.0), 0.7, ""),
        (Twist(1.0, 0.0), 0.75, "no command has come"),
    ],
)
def test_a_robot_that_is_told_to_stand_has_a_command(wanted: Command, now_s: float, why: str) -> None:
    one = governor("differential")
    one.want(wanted, 0.0)
    told = one.step(MIDDLE, now_s, PERIOD_S, "")
    assert (one.why, is_halt(told), one.fenced) == (why, wanted.speed_mps == 0.0 or bool(why), False)
