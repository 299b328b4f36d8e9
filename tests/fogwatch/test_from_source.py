"""The faults of a fleet that can be told from what a page would show of it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fogwatch.status import FleetWatch, Look, fleet_status
from monitor.live.attach import NoAnswer
from monitor.observation.source import RobotShape, RobotState, State, Static, Trapped
from patrol.ground.terrain import Terrain
from patrol.journal.records import Status
from patrol.pose import Pose
from runtime.process.lifeline import Ending

GROUND = np.ones((2, 2), bool)
ROBOTS = RobotShape(1, "anna", "car", 1.0, 10.0, 360.0), RobotShape(2, "bert", "car", 1.0, 10.0, 360.0, spare=True)
SCENARIO = {"radio": {"forget_after": 10.0}}
STATIC = Static(
    "yards-1",
    SCENARIO,
    Terrain("yards", GROUND, 1.0),
    GROUND,
    ROBOTS,
    0.5,
    100,
    None,
    live=True,
    layers=("truth", "heard"),
)
STOPPED = "stopped by an operator"
WELL = RobotState(1, Status.ALIVE, "patrolling", Pose(3.0, 4.0, 0.0), heard_s=0.5)
SPARE = RobotState(2, Status.ABSENT)
OTHER = RobotState(2, Status.ALIVE, "patrolling", Pose(1.0, 1.0, 0.0), heard_s=0.5)
STATE = State(40, 20.0, True, 1.0, 2.0, (WELL, SPARE), 12.5, 6.0)
REAL = replace(STATIC, layers=("heard",))


def judged(
    robot: RobotState, static: Static = STATIC, observed_s: float = 20.0, other: RobotState = OTHER, **of_state: Any
) -> Any:
    return fleet_status(Look(static, replace(STATE, robots=(robot, other), **of_state), observed_s), "tcp/r:1")


@pytest.mark.parametrize(
    ("robot", "wrong"),
    [
        (WELL, ""),
        (replace(WELL, status=Status.DEAD), "its process was killed"),
        (replace(WELL, status=Status.PAUSED), "its process is paused"),
        (replace(WELL, status=Status.LOST), "its process has gone"),
        (replace(WELL, status=Status.LEFT, heard_s=None), ""),
        (replace(WELL, status=Status.ABSENT, heard_s=None), ""),
        (replace(WELL, heard_s=10.0), ""),
        (replace(WELL, heard_s=70.0), "no other robot has heard it for 1 min 10 s"),
        (replace(WELL, heard_s=None), "no other robot has heard it for more than 20 s"),
        (replace(WELL, radio_wrong="does not hear bert"), "does not hear bert"),
        (replace(WELL, trapped=Trapped(65.0)), "trapped since 1 min 05 s"),
        (replace(WELL, trapped=Trapped(0.0, exact=False)), "trapped since before 0 s"),
    ],
)
def test_robots_of_a_world(robot: RobotState, wrong: str) -> None:
    status = judged(robot)
    assert [one.wrong for one in status.robots] == [wrong, ""]
    assert status.well is not bool(wrong)
    assert status.unknown == ()


@pytest.mark.parametrize(
    ("robot", "shown", "wrong"),
    [
        (WELL, "alive", ""),
        (replace(WELL, status=Status.LOST, heard_s=42.0), "silent", "no position for 42 s"),
        (replace(WELL, status=Status.LOST, heard_s=None), "silent", "no position for more than 20 s"),
        (replace(WELL, status=Status.ABSENT, heard_s=None), "absent", "is not there"),
        (replace(WELL, status=Status.PAUSED, state=STOPPED), "alive", STOPPED),
    ],
)
def test_robots_without_a_world(robot: RobotState, shown: str, wrong: str) -> None:
    status = judged(robot, REAL, other=SPARE)
    assert status.world is None
    assert (status.robots[0].status, status.robots[0].wrong, status.robots[1].wrong) == (shown, wrong, "")
    assert "no world simulates these robots" in status.unknown[-1]


def test_a_look_too_short_to_tell_says_so_and_calls_nothing_wrong() -> None:
    status = judged(replace(WELL, heard_s=None), observed_s=2.0)
    assert status.well
    assert status.unknown == ("whether anna can be heard: 2.0 s of this run are too short to tell",)


@pytest.mark.parametrize("heard_s", [70.0, None])
def test_a_sole_survivor_is_not_called_silent(heard_s: float | None) -> None:
    dead = replace(OTHER, status=Status.DEAD)
    status = judged(replace(WELL, heard_s=heard_s), observed_s=2.0, other=dead)
    assert [one.wrong for one in status.robots] == ["", "its process was killed"]
    assert status.unknown == ()


def test_what_a_page_warns_of_is_wrong_and_faults_of_operators_are_only_listed() -> None:
    assert not judged(WELL, note="the world has disconnected", gone=True).well
    status = judged(WELL, faults=({"kind": "loss", "rate": 0.5},))
    assert status.well
    assert "fault in force: kind=loss rate=0.5" in status.as_text()


def test_an_ended_run_is_over() -> None:
    status = judged(WELL, ended="duration")
    assert status.is_over
    assert "tick 40 of 100, 20 s; ended: duration" in status.as_text()
    assert not judged(WELL).is_over


class Story:
    """A source whose world does a tick in each wait, and in which a robot is first heard in some tick."""

    def __init__(self, heard_from: int) -> None:
        self.k, self.heard_from, self.now_s, self.closed = 0, heard_from, 0.0, 0

    def static(self) -> Static:
        return STATIC

    def wait(self, timeout_s: float) -> State:
        self.k += 1
        self.now_s += timeout_s
        robot = replace(WELL, heard_s=0.0 if self.k >= self.heard_from else None)
        return replace(STATE, k=self.k, time_s=self.k * 0.5, robots=(robot, OTHER))

    def close(self) -> None:
        self.closed += 1


@pytest.mark.parametrize(
    ("heard_from", "patience_s", "ticks", "well"),
    [(1, 30.0, 5, True), (9, 30.0, 9, True), (99, 30.0, 22, False), (99, 0.0, 5, True)],
)
def test_a_look_takes_longer_only_while_a_robot_may_be_silent(
    heard_from: int, patience_s: float, ticks: int, well: bool
) -> None:
    story: Any = Story(heard_from)
    watch = FleetWatch(lambda: story, "yards-1", "tcp/r:1", Ending(), patience_s, lambda: story.now_s)
    status = watch.look(0.9)
    assert status is not None
    assert status.well is well
    assert story.k == ticks


def test_a_world_in_lockstep_without_a_tick_is_not_well_and_a_slow_one_may_be() -> None:
    assert judged(WELL, observed_s=0.0, pace=None).warnings == ("no tick has gone by while this look listened",)
    assert judged(WELL, observed_s=0.0, pace=0.1).well
    assert judged(WELL, observed_s=0.0, pace=None, running=False).well


def test_a_look_at_a_world_that_waits_for_robots_says_for_whom_and_not_that_all_is_well() -> None:
    class Halted(Story):
        def wait(self, timeout_s: float) -> State:
            return replace(super().wait(timeout_s), k=1, time_s=0.5, note="world waits for anna")

    halted: Any = Halted(99)
    status = FleetWatch(lambda: halted, "yards-1", "tcp/r:1", Ending(), 30.0, lambda: halted.now_s).look(0.9)
    assert status is not None
    assert halted.now_s == pytest.approx(0.9)
    assert status.warnings == ("world waits for anna",)
    assert status.as_text().endswith("not well: warnings: 1")


def test_a_look_without_a_state_ends_when_asked_to() -> None:
    class Mute(Story):
        def wait(self, timeout_s: float) -> Any:
            self.now_s += timeout_s
            ending.ask("SIGINT")

    ending, mute = Ending(), Mute(0)
    source: Any = mute
    assert FleetWatch(lambda: source, "yards-1", "tcp/r:1", ending, 30.0, lambda: mute.now_s).look(0.9) is None


def test_a_world_that_gives_no_answer_is_there_and_what_it_waits_for_is_said_until_it_does() -> None:
    story: Any = Story(0)
    answers: list[Any] = [NoAnswer("yards-1", "world waits for bert"), story]

    def open_source() -> Any:
        answer = answers.pop(0)
        if isinstance(answer, NoAnswer):
            raise answer
        return answer

    watch = FleetWatch(open_source, "yards-1", "tcp/r:1", Ending(), now=lambda: story.now_s)
    status = watch.look(3.0)
    assert status is not None
    assert (status.warnings, status.well) == (("world waits for bert",), False)
    assert "world   is there" in status.as_text()
    watch.close()
    assert story.closed == 0
    for _ in range(2):
        status = watch.look(1.0)
        assert status is not None
        assert status.well
    watch.close()
    assert story.closed == 1


def test_a_look_that_is_to_end_before_there_is_a_source_sees_nothing() -> None:
    watch = FleetWatch(lambda: None, "yards-1", "tcp/r:1", Ending())
    assert watch.look(1.0) is None
    watch.close()


def test_what_strangers_say_does_not_act_on_a_terminal() -> None:
    assert "\x1b" not in judged(WELL, note="a\x1b[2J").as_text()
