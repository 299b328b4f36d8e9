"""The search for a ROS 2 robot by its process: its localisation is told where it is only if it does not know."""

import math
from itertools import count
from threading import Event
from types import SimpleNamespace
from typing import Any, cast

import pytest

from patrol.errors import BadInput
from patrol.pose import Pose
from ros2.robot import process as ros2_process
from ros2.robot.initial import InitialPose
from ros2.wire.messages import PoseWithCovarianceStamped
from tests.present import present
from tests.ros2_hub import Hub

# Not the product's own, so that a wrong one there is noticed.
VARIANCES = (0.25, 0.25, (math.pi / 12.0) ** 2)

START, ELSEWHERE = Pose(6.0, 4.5, 0.0), Pose(1.5, 1.5, 0.3)
LOOK_S = 0.1


class Robot:
    """A robot whose odometry begins at a look, and its localisation's own pose at another one, or never.

    Once its localisation is told where it is, which is noted in `told`, it agrees.
    """

    def __init__(self, told: list[Any], odometry: int, knows: int | None) -> None:
        self.looks = 0
        self.told_at: int | None = None
        self.why = "nothing says where the robot is on the map"
        self._told, self._odometry, self._knows = told, odometry, knows

    def fix(self) -> SimpleNamespace | None:
        self.looks += 1
        if self._told:
            self.told_at = self.told_at or self.looks
            return SimpleNamespace(pose=START)
        return None if self._knows is None or self.looks < self._knows else SimpleNamespace(pose=ELSEWHERE)

    def stamp_ns(self) -> int:
        return 7

    @property
    def odometry_age_s(self) -> float | None:
        return 0.0 if self.looks >= self._odometry else None


def found(monkeypatch: pytest.MonkeyPatch, odometry: int, knows: int | None) -> tuple[Pose | str, Robot]:
    """Return where a robot is found, or why it is not."""
    hub, moments = Hub(), count()
    sender = hub.link("fogwatch", "robot1").publisher("initialpose", PoseWithCovarianceStamped)
    initial = InitialPose(START, PoseWithCovarianceStamped(0, "map", START, VARIANCES), sender)
    robot = Robot(hub.sent["/robot1/initialpose"], odometry, knows)
    monkeypatch.setattr(ros2_process, "_LOOK_S", 0.0)
    monkeypatch.setattr(ros2_process, "_initial_pose", lambda _hardware: initial)
    monkeypatch.setattr(ros2_process, "time", SimpleNamespace(monotonic=lambda: LOOK_S * next(moments)))
    link = SimpleNamespace(other_format=lambda _limit_s: "")
    log = SimpleNamespace(info=lambda _line: None)
    process = SimpleNamespace(options=SimpleNamespace(wait=60.0), ending=Event(), log=log)
    try:
        return ros2_process._find_pose(cast(Any, robot), cast(Any, link), cast(Any, process)), robot
    except BadInput as error:
        return str(error), robot


@pytest.mark.parametrize("knows", [1, 2, 15])
def test_a_localisation_that_knows_another_place_is_told_nothing(knows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    why, robot = found(monkeypatch, odometry=1, knows=knows)
    there = "--start: the robot is localised already, and its localisation has it at (1.50, 1.50, 0.30)"
    assert str(why).startswith(there)
    assert robot.told_at is None


@pytest.mark.parametrize("odometry", [1, 40])
def test_one_that_is_quiet_after_the_first_odometry_is_told(odometry: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pose, robot = found(monkeypatch, odometry=odometry, knows=None)
    assert pose == START
    assert present(robot.told_at) >= odometry + ros2_process.QUIET_S / LOOK_S


def test_without_odometry_it_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    why, robot = found(monkeypatch, odometry=10**6, knows=None)
    assert "the robot was not found within 60 s" in str(why)
    assert robot.told_at is None
