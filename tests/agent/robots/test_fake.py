"""The fake robot: it obeys for one step, and no wall lets it through."""

import math
from collections import deque

import numpy as np
import pytest

from agent.robots.fake import FakeRobot
from patrol.exchange import Sensed
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.scenario import RobotSpec
from tests.present import present

STEP = 0.5
START = Pose(5.0, 5.0, 0.0)


class Ticks:
    """A fleet clock that counts what it is given."""

    def __init__(self, *ticks: int | None) -> None:
        self._ticks = deque(ticks)

    def tick(self) -> int | None:
        return self._ticks.popleft()

    def decide(self) -> bool:
        return True


def robot(model: str, *ticks: int | None) -> FakeRobot:
    """On 20 x 10 m, with a wall from x = 10 on."""
    passable = np.ones((20, 40), dtype=np.bool_)
    passable[:, 20:] = False
    spec = RobotSpec(1, "r1", model, 4.4, 1.0, 3.5, None)  # type: ignore[arg-type]
    return FakeRobot(Ticks(*ticks), spec, Terrain("t", passable, 0.5), START, STEP)


def sensed_by(fake: FakeRobot) -> Sensed:
    return present(fake.sense())


@pytest.mark.parametrize(
    ("model", "command", "end"),
    [
        ("holonomic", Velocity(2.0, -1.0), Pose(6.0, 4.5, math.atan2(-1.0, 2.0))),
        ("car", Drive(2.0, 0.0), Pose(6.0, 5.0, 0.0)),
        ("differential", Twist(2.0, 0.0), Pose(6.0, 5.0, 0.0)),
    ],
)
def test_it_obeys_for_one_step(model: str, command: Command, end: Pose) -> None:
    fake = robot(model, 0, 1, 2)
    first = sensed_by(fake)
    assert (first.k, first.pose, first.bumped, first.clock_s) == (0, START, False, 0.0)
    fake.act(command)
    second = sensed_by(fake)
    assert (second.k, second.bumped, second.clock_s) == (1, False, 0.5)
    assert (second.pose.x, second.pose.y) == pytest.approx((end.x, end.y))
    third = sensed_by(fake)
    assert (third.pose.x, third.pose.y) == pytest.approx((end.x, end.y))


@pytest.mark.parametrize(
    ("model", "command", "end"),
    [
        ("holonomic", Velocity(0.0, -100.0), Pose(5.0, 5.0 - 2.2, -math.pi / 2)),
        ("differential", Twist(0.0, 100.0), Pose(5.0, 5.0, 2.2)),  # 4.4 m/s at 1 m for half a second
    ],
)
def test_it_has_its_bodys_limits_and_two_wheels_turn_it_on_the_spot(model: str, command: Command, end: Pose) -> None:
    fake = robot(model, 0, 1)
    fake.sense()
    fake.act(command)
    sensed = sensed_by(fake)
    assert not sensed.bumped
    assert (sensed.pose.x, sensed.pose.y, sensed.pose.heading) == pytest.approx((end.x, end.y, end.heading))


def test_a_wall_stops_it_and_it_knows() -> None:
    fake = robot("car", 0, 1, 2, 3)
    fake.sense()
    seen = []
    for speed in (4.4, 4.4, 0.0):
        fake.act(Drive(speed, 0.0))
        sensed = sensed_by(fake)
        seen.append((round(sensed.pose.x, 6), sensed.bumped))
    assert seen == [(7.2, False), (7.2, True), (7.2, False)]


def test_it_stands_while_ticks_are_missed_and_when_it_is_to_stop() -> None:
    fake = robot("holonomic", 0, 5, 6, None)
    fake.sense()
    fake.act(Velocity(2.0, 0.0))
    late = sensed_by(fake)
    assert (late.k, late.pose) == (5, START)
    fake.act(Velocity(2.0, 0.0))
    fake.stop("out of ideas")
    after = sensed_by(fake)
    assert (after.pose, fake.stopped) == (START, "out of ideas")
    assert fake.sense() is None
