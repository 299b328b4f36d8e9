"""What the robot's own tools are told of a patrol."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import pytest

from agent.ports import Decision
from patrol.exchange import Sensed
from patrol.pose import Pose, Twist
from patrol.radio.peers import Peer
from ros2.robot.diagnostics import DecisionReading, Diagnostics, Patrolling, Reading, statuses
from ros2.robot.hardware import Hardware
from ros2.robot.options import DriveSettings
from ros2.wire.messages import DiagnosticArray, DiagnosticLevel, Odometry, TFMessage, Transform
from ros2.wire.messages import Twist as RosTwist
from tests.ros2_hub import Hub

PATIENCE_S = 300.0
OK, WARN, ERROR = DiagnosticLevel.OK, DiagnosticLevel.WARN, DiagnosticLevel.ERROR
FACTS = Patrolling("r1", {1: "r1", 2: "r2"}, 0.5, 1.0, 10.0)
DECIDED = DecisionReading(0.2, 40, "patrolling", 12.0, 1.5, 3, {"r2": 1.0})
WELL = Reading(DECIDED, odometry_s=0.02, correction_s=0.1)


def part(name: str, reading: Reading, facts: Patrolling = FACTS) -> tuple[DiagnosticLevel, str]:
    (found,) = [one for one in statuses(facts, reading) if one.name == f"fogwatch r1: {name}"]
    return found.level, found.message


def test_a_robot_that_is_well() -> None:
    found = statuses(FACTS, WELL)
    assert [(one.name, one.level, one.message) for one in found] == [
        ("fogwatch r1: patrol", OK, "patrolling"),
        ("fogwatch r1: localisation", OK, "the pose is known"),
        ("fogwatch r1: driving", OK, "may drive"),
        ("fogwatch r1: radio", OK, "hears 1 of 1 other robots"),
    ]
    assert {one.hardware_id for one in found} == {"r1"}
    values = dict(value for one in found for value in one.values)
    assert values["age of the correction, s"] == "0.1"
    assert values["age of the position of r2, s"] == "1.0"
    assert (values["tick"], values["MFoW believed, s"], values["frames refused"]) == ("40", "12.0", "3")


@pytest.mark.parametrize(
    ("name", "reading", "expected"),
    [
        ("patrol", replace(WELL, decision=None), (WARN, "no decision yet")),
        ("patrol", replace(WELL, decision=replace(DECIDED, age_s=1.4)), (OK, "patrolling")),
        ("patrol", replace(WELL, decision=replace(DECIDED, age_s=1.6)), (ERROR, "no decision for 1.6 s")),
        ("patrol", replace(WELL, missed=2, missed_lately=True), (WARN, "patrolling; ticks were lost")),
        ("localisation", replace(WELL, unlocated="no odometry has come"), (ERROR, "no odometry has come")),
        ("driving", replace(WELL, stopped="stopped by an operator"), (WARN, "stopped by an operator")),
        ("radio", replace(WELL, decision=None), (WARN, "hears 0 of 1 other robots")),
        ("radio", replace(WELL, decision=replace(DECIDED, peers_s={"r2": 10.5})), (WARN, "hears 0 of 1 other robots")),
    ],
)
def test_what_is_wrong(name: str, reading: Reading, expected: tuple[DiagnosticLevel, str]) -> None:
    assert part(name, reading) == expected


def test_a_robot_alone_misses_nobody_and_a_simulation_may_be_faster_than_our_time() -> None:
    alone = replace(FACTS, names={1: "r1"})
    assert part("radio", replace(WELL, decision=replace(DECIDED, peers_s={})), alone) == (
        OK,
        "hears 0 of 0 other robots",
    )
    hurried = replace(FACTS, factor=10.0)
    assert part("patrol", WELL, hurried) == (ERROR, "no decision for 0.2 s")


class Bench:
    """A robot in this process, and what is published of it; the test sets the time of the wall."""

    def __init__(self, **settings: Any) -> None:
        self.hub, self.now_s, self.stopped = Hub(), 100.0, ""
        self.hardware = Hardware(self.hub.link("fogwatch", "robot1"), DriveSettings(**settings), 1.0, lambda _: None)
        self.peers = {2: Peer(7, Pose(0.0, 0.0, 0.0), 3), 9: Peer(7, Pose(0.0, 0.0, 0.0), 3)}
        self.diagnostics = Diagnostics(self.hardware, FACTS, self.peers, lambda: self.now_s)

    def decide(self, tick: int) -> None:
        decision = Decision(Twist(0.0, 0.0), "patrolling", None, None, None, 24, 3)
        self.diagnostics.report(Sensed(tick, Pose(0.0, 0.0, 0.0), False, clock_s=0.0), decision, 1.5)

    def at(self) -> None:
        robot, now_ns = self.hub.link("robot", "robot1"), time.time_ns()
        still = RosTwist(0.0, 0.0, 0.0)
        robot.publisher("tf", TFMessage).send(TFMessage((Transform(now_ns, "map", "odom", Pose(0.0, 0.0, 0.0)),)))
        robot.publisher("odom", Odometry).send(Odometry(now_ns, "odom", "base", Pose(1.0, 1.0, 0.0), still))


def test_ages_and_lost_ticks_are_counted() -> None:
    bench = Bench()
    assert bench.diagnostics.read("") == Reading(None, unlocated="no odometry has come", correction_s=None)
    bench.decide(4)
    bench.now_s += 2.0
    assert bench.diagnostics.read("").decision == DecisionReading(2.0, 4, "patrolling", 12.0, 1.5, 3, {"r2": 0.5})
    bench.decide(8)
    reading = bench.diagnostics.read("why")
    assert (reading.missed, reading.missed_lately, reading.stopped) == (3, True, "why")
    bench.now_s += 10.0
    bench.decide(9)
    reading = bench.diagnostics.read("")
    assert (reading.missed, reading.missed_lately) == (3, False)


def test_the_age_of_what_corrects_the_odometry_is_known() -> None:
    bench = Bench()
    bench.at()
    bench.hardware.fix()
    correction_s = bench.diagnostics.read("").correction_s
    assert correction_s is not None
    assert 0.0 <= correction_s < PATIENCE_S


@pytest.mark.parametrize(
    ("topics", "topic"), [({}, "/diagnostics"), ({"diagnostics": "own_diagnostics"}, "/robot1/own_diagnostics")]
)
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
