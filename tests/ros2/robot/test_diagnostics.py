"""Diagnostics of a patrol for the robot's own tools."""

import time
from dataclasses import replace
from typing import Any

import pytest

from agent.ports import Decision
from patrol.exchange import Sensed
from patrol.pose import Pose, Twist
from patrol.radio.peers import Peer
from ros2.robot import localisation
from ros2.robot.diagnostics import Diagnostics, Patrolling
from ros2.robot.hardware import Hardware
from ros2.robot.localisation import LocalisationSettings
from ros2.robot.options import DriveSettings
from ros2.wire.messages import DiagnosticArray, DiagnosticLevel, Odometry, TFMessage, Transform
from ros2.wire.messages import Twist as RosTwist
from tests.ros2.robot.passing import Passing, Waiter
from tests.ros2_hub import Hub

PATIENCE_S = 300.0
OK, WARN, ERROR = DiagnosticLevel.OK, DiagnosticLevel.WARN, DiagnosticLevel.ERROR
FACTS = Patrolling("r1", {1: "r1", 2: "r2"}, 0.5, 1.0, 10.0)


class Bench:
    """A robot in this process, and what is published of it; the test sets the time of the wall."""

    def __init__(self, facts: Patrolling = FACTS, **settings: Any) -> None:
        self.hub, self.now_s, self.stopped, self.no_tick = Hub(), 100.0, "", ""
        self.hardware = Hardware(self.hub.link("fogwatch", "robot1"), DriveSettings(**settings), 1.0, lambda _: None)
        self.peers = {2: Peer(7, Pose(0.0, 0.0, 0.0), 3), 9: Peer(7, Pose(0.0, 0.0, 0.0), 3)}
        self.diagnostics = Diagnostics(self.hardware, facts, self.peers, lambda: self.no_tick, lambda: self.now_s)

    def decide(self, tick: int) -> None:
        decision = Decision(Twist(0.0, 0.0), "patrolling", None, None, None, 24, 3)
        self.diagnostics.report(Sensed(tick, Pose(0.0, 0.0, 0.0), False, clock_s=0.0), decision, 1.5)

    def at(self) -> None:
        """The robot says where it is, and is heard."""
        robot, now_ns = self.hub.link("robot", "robot1"), time.time_ns()
        still = RosTwist(0.0, 0.0, 0.0)
        robot.publisher("tf", TFMessage).send(TFMessage((Transform(now_ns, "map", "odom", Pose(0.0, 0.0, 0.0)),)))
        robot.publisher("odom", Odometry).send(Odometry(now_ns, "odom", "base", Pose(1.0, 1.0, 0.0), still))
        self.hardware.fix()

    def part(self, name: str) -> tuple[DiagnosticLevel, str]:
        (found,) = [one for one in self.diagnostics.statuses(self.stopped) if one.name == f"fogwatch r1: {name}"]
        return found.level, found.message

    @property
    def values(self) -> dict[str, str]:
        """All values by name."""
        return dict(value for one in self.diagnostics.statuses(self.stopped) for value in one.values)


@pytest.fixture(autouse=True)
def poses_stay_fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(localisation, "LONGEST_S", PATIENCE_S)


def test_a_robot_that_is_well() -> None:
    bench = Bench(localisation=LocalisationSettings(fresh_s=PATIENCE_S))
    bench.at()
    bench.decide(5)
    found = bench.diagnostics.statuses("")
    assert [(one.name, one.level, one.message) for one in found] == [
        ("fogwatch r1: patrol", OK, "patrolling"),
        ("fogwatch r1: localisation", OK, "the pose is known"),
        ("fogwatch r1: driving", OK, "may drive"),
        ("fogwatch r1: radio", OK, "hears 1 of 1 other robots"),
    ]
    assert {one.hardware_id for one in found} == {"r1"}
    values = bench.values
    assert 0.0 <= float(values["age of the correction, s"]) < PATIENCE_S
    shown = ("age of the position of r2, s", "tick", "MFoW believed, s", "frames refused")
    assert [values[name] for name in shown] == ["1.0", "5", "12.0", "3"]


def test_what_is_wrong() -> None:
    bench = Bench()
    assert bench.part("patrol") == (WARN, "no decision yet")
    assert bench.part("radio") == (WARN, "hears 0 of 1 other robots")
    assert bench.part("localisation") == (ERROR, "no odometry has come")
    assert bench.values["age of the correction, s"] == "unknown"
    bench.stopped = "stopped by an operator"
    assert bench.part("driving") == (WARN, "stopped by an operator")
    bench.decide(4)
    bench.now_s += 1.4
    assert bench.part("patrol") == (OK, "patrolling")
    bench.now_s += 0.2
    assert bench.part("patrol") == (ERROR, "no decision for 1.6 s")
    bench.no_tick = "the clock was set back, so no tick comes for 600 s; set it right"
    assert bench.part("patrol") == (ERROR, bench.no_tick)
    bench.decide(24)
    assert bench.part("radio") == (WARN, "hears 0 of 1 other robots")


def test_a_robot_alone_misses_nobody_and_a_simulation_may_be_faster_than_our_time() -> None:
    alone = Bench(replace(FACTS, names={1: "r1"}))
    alone.decide(4)
    assert alone.part("radio") == (OK, "hears 0 of 0 other robots")
    hurried = Bench(replace(FACTS, factor=10.0))
    hurried.decide(4)
    hurried.now_s += 0.2
    assert hurried.part("patrol") == (ERROR, "no decision for 0.2 s")


def test_ages_and_lost_ticks_are_counted() -> None:
    bench = Bench()
    bench.decide(4)
    bench.now_s += 1.0
    values = bench.values
    assert (values["age of the last decision, s"], values["last decision, ms"]) == ("1.0", "1.5")
    assert (values["ticks lost"], values["age of the position of r2, s"]) == ("0", "0.5")
    for tick, part in ((8, (WARN, "patrolling; ticks were lost")), (9, (OK, "patrolling"))):
        bench.decide(tick)
        assert (bench.values["ticks lost"], bench.part("patrol")) == ("3", part)
        bench.now_s += 10.0


def test_robots_are_listed_by_name_up_to_32() -> None:
    bench = Bench(replace(FACTS, names={number: f"r{number}" for number in range(1, 41)}))
    bench.peers.update({number: Peer(7, Pose(0.0, 0.0, 0.0), 3) for number in range(2, 41)})
    bench.decide(5)
    listed = [name for name in bench.values if name.startswith("age of the position of ")]
    assert len(listed) == 32
    assert bench.part("radio") == (OK, "hears 39 of 39 other robots")


def test_it_is_published_once_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, passing = Bench(), Passing()
    over = Waiter(passing)
    monkeypatch.setattr(bench.diagnostics, "_over", over)
    sent = bench.hub.sent["/diagnostics"]

    def stopped() -> str:
        if len(sent) == 3:
            over.set()
        return ""

    bench.diagnostics._publish_diagnostics(stopped)
    assert passing.waits == [1.0] * 3


@pytest.mark.parametrize(("topics", "topic"), [({}, "/diagnostics"), ({"diagnostics": "own"}, "/robot1/own")])
def test_it_is_published_before_the_first_decision_where_ros_looks_for_it(topics: dict[str, str], topic: str) -> None:
    bench = Bench(topics=topics)
    bench.stopped = "stopped by an operator"
    bench.diagnostics.watch(lambda: bench.stopped)
    end = time.monotonic() + PATIENCE_S
    while not bench.hub.sent[topic]:
        assert time.monotonic() < end
        time.sleep(0.001)
    bench.diagnostics.close()
    message = bench.hub.sent[topic][0]
    assert isinstance(message, DiagnosticArray)
    assert message.stamp_ns > 0
    assert [status.level for status in message.statuses] == [WARN, ERROR, WARN, WARN]
