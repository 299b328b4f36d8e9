"""A mind at work in a robot of its own: tick after tick, until it is time to leave or its policy fails."""

from __future__ import annotations

import math
import re
import threading
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.mind_loop import TelemetrySender, run_mind
from agent.ports import Decision, Intent, Steer
from agent.robots.fake import FakeRobot
from agent.view import View
from patrol.exchange import Sensed
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Velocity
from patrol.radio.message import decode
from patrol.scenario import load_scenario
from patrol.wire import read
from runtime.messages.telemetry import Telemetry
from tests.agent.minds import STEP, prepared_on
from tests.present import present

START = Pose(6.0, 6.0, 0.0)
PATIENCE_S = 300.0


class Ticks:
    """Ticks 0 and up to a last one."""

    def __init__(self, last: int) -> None:
        self._ticks: deque[int | None] = deque([*range(last + 1), None])

    def tick(self) -> int | None:
        return self._ticks.popleft()

    def decide(self) -> bool:
        return True


class Ears:
    """A radio that keeps what is sent, and hears nothing, or is too late in some ticks."""

    def __init__(self, late: tuple[int, ...] = ()) -> None:
        self.sent: list[tuple[bytes, ...]] = []
        self._late = late

    def send(self, frames: tuple[bytes, ...]) -> None:
        self.sent.append(frames)

    def hear(self) -> list[bytes] | None:
        return None if len(self.sent) - 1 in self._late else []


class Eyes:
    """An observer."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, Decision, float]] = []

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        self.seen.append((sensed.k, decision, decision_ms))


class Ahead:
    """A policy that drives ahead, until it raises or hangs.

    woken: ends a decision that hangs. decided: the ticks that it has decided on.
    """

    def __init__(self, raises: int = 99, hangs: int = 99) -> None:
        self.woken = threading.Event()
        self.decided: list[int] = []
        self._raises, self._hangs = raises, hangs

    def decide(self, view: View) -> Intent:
        if view.tick == self._raises:
            raise RuntimeError("no idea")
        if view.tick == self._hangs:
            self.woken.wait(PATIENCE_S)
        self.decided.append(view.tick)
        return Steer(Velocity(1.0, 0.0), state="ahead")


def made(policy: Ahead, last: int = 5) -> tuple[Mind, FakeRobot]:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"model": "holonomic"}})
    prepared = prepared_on(scenario, Terrain("room", np.ones((40, 60), dtype=np.bool_), 0.5), [START])
    mind = build_mind(Shared(prepared), 1)
    mind.policy = policy
    return mind, FakeRobot(Ticks(last), scenario.roster[0], prepared.terrain, START, STEP)


def test_it_senses_sends_hears_decides_and_acts_until_it_is_time_to_leave() -> None:
    mind, robot = made(Ahead())
    ears, eyes = Ears(), Eyes()
    assert run_mind(mind, robot, ears, eyes) is None
    assert [decode(frames[0]).sequence for frames in ears.sent] == [0, 1, 2, 3, 4, 5]
    assert [decode(frames[0]).x_cm for frames in ears.sent] == [600, 650, 700, 750, 800, 850]
    assert [k for k, _, _ in eyes.seen] == [0, 1, 2, 3, 4, 5]
    assert {decision.state for _, decision, _ in eyes.seen} == {"ahead"}
    assert all(spent_ms > 0.0 for _, _, spent_ms in eyes.seen)
    assert robot.stopped == ""


def test_a_tick_that_is_too_late_to_decide_on_is_left_out() -> None:
    mind, robot = made(Ahead())
    ears, eyes = Ears(late=(2, 3)), Eyes()
    assert run_mind(mind, robot, ears, eyes) is None
    assert [k for k, _, _ in eyes.seen] == [0, 1, 4, 5]
    assert [decode(frames[0]).x_cm for frames in ears.sent] == [600, 650, 700, 700, 700, 750]


def test_a_policy_that_fails_stops_its_robot(capsys: pytest.CaptureFixture[str]) -> None:
    mind, robot = made(Ahead(raises=3))
    eyes = Eyes()
    says = present(run_mind(mind, robot, Ears(), eyes))
    line = rf"its policy failed at tick 3: raised RuntimeError: no idea \({Path(__file__).name}:\d+\)"
    assert re.fullmatch(line, says)
    assert robot.stopped == says
    assert [k for k, _, _ in eyes.seen] == [0, 1, 2]
    assert 'raise RuntimeError("no idea")' in capsys.readouterr().err, "where it was raised is for its author to see"


def test_a_policy_that_hangs_stops_its_robot() -> None:
    policy = Ahead(hangs=0)
    mind, robot = made(policy)
    mind.facts = replace(mind.facts, limit_s=0.3)
    says = "its policy failed at tick 0: took longer than 0.3 s to decide"
    try:
        assert run_mind(mind, robot, Ears(), Eyes()) == says
        assert not policy.decided, "nobody waits for it"
    finally:
        policy.woken.set()
    assert robot.stopped == says


@pytest.mark.parametrize(
    ("told", "shown"), [(None, None), (1, 1.0), (0, 0.0), (1.004, 1.0), (-0.1, 0.0), (0.5, 0.5), (math.nan, None)]
)
def test_viewers_can_read_every_charge_that_a_robot_of_ones_own_tells(told: float | None, shown: float | None) -> None:
    mind, robot = made(Ahead(), last=0)
    eyes = Eyes()
    run_mind(mind, robot, Ears(), eyes)
    posted: list[bytes] = []
    TelemetrySender(posted.append).report(Sensed(0, START, charge=told), eyes.seen[0][1], 1.0)
    assert read(Telemetry, posted[0]).charge == shown


@pytest.mark.parametrize(
    ("told", "shown"), [("", ""), ("by hand", "by hand"), ("a\nb", "a\\nb"), (False, ""), (None, ""), (print, "")]
)
def test_viewers_can_read_every_reason_for_a_stop_that_a_robot_of_ones_own_tells(told: Any, shown: str) -> None:
    mind, robot = made(Ahead(), last=0)
    eyes = Eyes()
    run_mind(mind, robot, Ears(), eyes)
    posted: list[bytes] = []
    sender = TelemetrySender(posted.append)
    sender.stopped = lambda: told
    sender.report(Sensed(0, START), eyes.seen[0][1], 1.0)
    assert read(Telemetry, posted[0]).stopped == shown
