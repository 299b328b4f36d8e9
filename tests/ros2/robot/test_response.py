"""A robot whose pose does not follow what it is told stands before it has gone far."""

from collections.abc import Iterator

import pytest

from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from ros2.robot.governor import Response

# Not the product's own, so that a wrong one there is noticed.
BLIND_M = 1.0
BLIND_S = 1.0
ENOUGH_M = 0.3
ENOUGH_S = 0.5

PERIOD_S = 0.05
HERE = Pose(2.0, 5.0, 0.0)
TRIES = [Twist(0.5, 0.0), Twist(0.0, 1.5), Twist(-0.5, 0.0), Twist(0.0, -1.5)]
EACH = pytest.mark.parametrize("commands", [[Twist(0.5, 0.0)], [Drive(2.0, 0.2)], [Velocity(0.1, 0.1)], TRIES])


def told(response: Response, commands: list[Command], share: float, steps: int) -> Iterator[tuple[float, Pose]]:
    """The way that a robot is told to go, and its pose, which follows by a share of each command."""
    pose, way = HERE, 0.0
    for number in range(steps):
        if response.why:
            return
        command = commands[number // 20 % len(commands)]
        pose = advance(pose, command, share * PERIOD_S)
        response.told(command, pose, PERIOD_S)
        way += abs(command.speed_mps) * PERIOD_S
        yield way, pose


@EACH
def test_a_pose_that_stands_still_stops_the_robot_soon(commands: list[Command]) -> None:
    response = Response(0.25, 0.1)
    *_, (way, _) = told(response, commands, 0.0, 1000)
    assert "its pose stays where it is" in response.why
    assert way <= max(BLIND_M, BLIND_S * commands[0].speed_mps) + 2.0 * max(ENOUGH_M, ENOUGH_S * commands[0].speed_mps)


@EACH
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_robot_that_follows_or_follows_slowly_drives_on(commands: list[Command], share: float) -> None:
    response = Response(0.25, 0.1)
    assert len(list(told(response, commands, share, 1000))) == 1000


@pytest.mark.parametrize("acceleration", [0.5, 1.0, 4.0])
def test_one_with_weak_motors_that_turns_round_drives_on(acceleration: float) -> None:
    """It is told 2 m/s forward and back in turns, and its speed follows as its motors can."""
    response, pose, speed = Response(0.25, 2.0 / acceleration), HERE, 0.0
    for number in range(4000):
        wanted = 2.0 if number // 160 % 2 else -2.0
        most = acceleration * PERIOD_S
        speed += min(max(wanted - speed, -most), most)
        pose = advance(pose, Twist(speed, 0.0), PERIOD_S)
        response.told(Twist(wanted, 0.0), pose, PERIOD_S)
        assert not response.why, number


def test_one_that_is_blocked_ahead_and_gets_away_drives_on() -> None:
    response = Response(0.25, 0.1)
    for _ in range(20):
        list(told(response, [Twist(0.5, 0.0)], 0.0, 14))  # 0.35 m
        list(told(response, [Twist(0.0, 1.5)], 1.0, 20))
    assert not response.why


def test_it_goes_on_when_somebody_releases_it_and_is_judged_anew() -> None:
    response = Response(0.25, 0.1)
    list(told(response, [Twist(0.5, 0.0)], 0.0, 1000))
    response.release()
    assert not response.why
    list(told(response, [Twist(0.5, 0.0)], 0.0, 1000))
    assert response.why


@pytest.mark.parametrize(("speed", "slow_s", "steps"), [(1.0, 0.0, 8), (1.0, 1.0, 12), (0.5, 0.0, 20), (4.0, 0.0, 8)])
def test_a_robot_is_driven_blindly_for_exactly_the_least_way_and_time(speed: float, slow_s: float, steps: int) -> None:
    """Steps of 1/8 s; each trial takes 0.5 s and 0.3 m at least, and 1 m and 1 s without motion are too much."""
    response, calls = Response(0.25, slow_s), 0
    while not response.why and calls < 100:
        response.told(Velocity(speed, 0.0), HERE, 0.125)
        calls += 1
    assert calls == 1 + steps  # the first call begins the trial


@pytest.mark.parametrize(("share", "stops"), [(0.25, False), (0.24, True)])
def test_a_robot_moves_from_a_quarter_of_its_way_on(share: float, stops: bool) -> None:
    response, x = Response(0.25, 0.0), 0.0
    for _ in range(60):
        response.told(Velocity(1.0, 0.0), Pose(x, 5.0, 0.0), 0.125)
        x += share * 0.125
    assert bool(response.why) is stops


@pytest.mark.parametrize(
    ("moved", "drives"), [((0.2, 0.0), True), ((0.19, 0.0), False), ((0.0, 0.3), True), ((0.0, 0.29), False)]
)
def test_a_stopped_robot_goes_on_once_its_pose_has_moved_by_so_much(moved: tuple[float, float], drives: bool) -> None:
    response, place = Response(0.25, 0.0), Pose(0.0, 0.0, 0.0)
    for _ in range(9):
        response.told(Velocity(1.0, 0.0), place, 0.125)
    assert response.why
    response.told(Velocity(0.0, 0.0), Pose(moved[0], 0.0, moved[1]), 0.125)
    assert (not response.why) is drives


def test_a_robot_that_turns_on_the_spot_is_judged_by_radians() -> None:
    """Each trial takes 1 rad, here 7 steps of 0.15 rad, which count as 0.4 m each: 1 m is reached with the third."""
    response, calls = Response(0.4, 0.0), 0
    while not response.why and calls < 100:
        response.told(Twist(0.0, 1.2), HERE, 0.125)
        calls += 1
    assert calls == 1 + 3 * 7


@pytest.mark.parametrize(("turned", "stops"), [(0.26, False), (0.24, True)])
def test_a_robot_turns_that_has_come_a_quarter_of_a_radian(turned: float, stops: bool) -> None:
    """In each trial of 8 steps, at 1 rad/s, it turns so far, to the right although it is told to turn left."""
    response, heading, calls = Response(0.25, 0.0), 3.0, 0
    while not response.why and calls < 60:
        response.told(Twist(0.0, 1.0), Pose(2.0, 5.0, heading), 0.125)
        heading, calls = heading - turned / 8.0, calls + 1
    assert bool(response.why) is stops
