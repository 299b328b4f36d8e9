"""Reasons besides stops that keep a robot from driving, and what is said of them."""

import re

import pytest

from patrol.pose import Pose
from ros2.robot.driver import Sayer
from ros2.robot.governor import OFF_GROUND, TOO_NEAR
from ros2.wire.messages import Bool
from runtime.messages.stop_orders import Order, Outcome
from runtime.reporting.health import HealthReading, health_line
from runtime.reporting.vitals import ODOMETRY_AGE, STOPPED, UNUSABLE, Vitals
from tests.ros2.robot.test_driver import AHEAD, PATIENCE_S, STILL, Bench

# Not the product's own, so that a wrong one there is noticed.
HELD_AFTER_S = 10.0


def test_a_robot_whose_odometry_hangs_stands_says_so_and_goes_on_when_an_operator_releases_it() -> None:
    bench = Bench()
    now_s, told_m = 0.0, 0.0
    while not bench.response.why:
        bench.at()
        bench.steering.want(AHEAD, None, now_s)
        bench.steering.step(bench.fix(), now_s, 0.05, "")
        now_s, told_m = now_s + 0.05, told_m + 0.5 * 0.05
    assert told_m < 1.5
    bench.drive(AHEAD)
    assert bench.told == STILL
    assert bench.driver._carry_out(Order.RELEASE) == Outcome(True, "not stopped")
    assert bench.said[-1] == "released by an operator"
    bench.driver.cycle()
    assert bench.told.vx == 0.5


@pytest.mark.parametrize(("place", "words"), [(Pose(-3.0, 5.0, 0.0), OFF_GROUND), (Pose(9.75, 5.0, 0.0), TOO_NEAR)])
def test_a_robot_that_its_fence_holds_says_so_later(place: Pose, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    bench.drive(AHEAD, place)
    assert bench.told == STILL
    assert bench.said == []
    monkeypatch.setattr("ros2.robot.driver.HELD_AFTER_S", 0.0)
    bench.drive(pose=place)
    assert bench.said == [f"stands: {words}"]


def test_a_robot_that_turns_back_at_a_wall_is_not_said_to_stand() -> None:
    said: list[str] = []
    sayer = Sayer(said.append)
    for tenth in range(1000):
        sayer.state(TOO_NEAR if tenth % 90 else "", tenth / 10, HELD_AFTER_S)
    assert said == []


def test_its_health_says_how_old_its_odometry_is_and_whether_it_may_drive() -> None:
    bench, vitals = Bench(), Vitals()
    bench.driver.show(vitals)
    assert ODOMETRY_AGE not in vitals.read()
    bench.drive()
    figures = vitals.read()
    assert 0.0 <= float(figures[ODOMETRY_AGE]) < PATIENCE_S  # type: ignore[arg-type]
    assert (figures[STOPPED], figures[UNUSABLE]) == (0.0, {})
    ((_, odometry),) = bench.hub.listening["/robot1/odom"]
    odometry.refuse("hash", "other fields")
    bench.stop.send(Bool(True))
    bench.driver.cycle()
    line = health_line(HealthReading(0.0, vitals.read()), None)
    assert re.search(r"stopped, odometry \d+\.\d s ago, robot's messages refused: 1 hash", line), line
