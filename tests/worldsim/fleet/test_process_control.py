"""The hands over processes: what the world asks the launcher for, and whom it takes for a robot afterwards."""

import json

import pytest

from patrol.exchange import Sensed
from patrol.pose import Pose
from runtime.messages.phases import NO_RUN, Hello, HelloReply, ReplyA, Stop, ToRobot
from tests.worldsim.fleet.net import HASH, RUN, Net
from worldsim.faults import STOPPED, UNSEEN, process_name
from worldsim.fleet.process_control import (
    ENDED,
    ControlFailed,
    LauncherControl,
    NotStarted,
    Request,
    answer_line,
    has_ended,
)
from worldsim.fleet.sessions import Interrupted

# Not the product's own, so that a wrong one there is noticed.
START_S = 600.0

BOTH = (1, 2)


class Stage(Net):
    """Two robots whose processes come and go as the launcher is asked.

    slow: seconds until a started process says hello, None for never. problem, state: what the launcher answers.
    """

    def __init__(self, *, waits: bool = True, absent: tuple[int, ...] = ()) -> None:
        super().__init__(launched=True, robots=2, absent=absent)
        self.asked: list[tuple[str, int, int]] = []
        self.incarnation = {number: 1 for number in BOTH if number not in absent}
        self.slow: float | None = 1.0
        self.problem = self.state = ""
        self.control = LauncherControl(self.ask, self.sessions, waits=waits)
        for number in self.incarnation:
            self.presence(number, True)
        self.sessions.gather(10.0, lambda _names, _s: None)

    def has_ended(self, number: int) -> bool:
        return has_ended(self.ask, number)

    def ask(self, line: bytes) -> bytes:
        request = Request.read(line)
        if request.do == "look":
            return answer_line(state=ENDED if request.robot in self.ended else "")
        self.asked.append((request.do, request.robot, request.incarnation))
        if request.do == "start" and self.slow is not None:
            self.incarnation[request.robot] = request.incarnation
            self.presence(request.robot, True, self.slow)
        if request.do in ("kill", "leave"):
            self.presence(request.robot, False)
        return answer_line(self.problem, self.state)

    def answer(self, number: int, message: ToRobot) -> None:
        if isinstance(message, Hello):
            self.deliver(number, HelloReply(*self.me(number), message.run, HASH))

    def me(self, number: int) -> tuple[int, int, int]:
        incarnation = self.incarnation[number]
        return incarnation, 100 * number + incarnation, 0

    def reach(self, number: int) -> tuple[int, int]:
        """Incarnation and instance of the process that the world speaks to."""
        self.sessions.send(number, 5, Sensed(5, Pose(0.0, 0.0, 0.0)))
        message = self.sent[-1][1]
        return message.incarnation, message.instance


def test_requests_and_answers_are_lines() -> None:
    line = Request("start", 3, 2).line()
    assert line.endswith(b"\n")
    assert Request.read(line) == Request("start", 3, 2)
    assert json.loads(answer_line("no such robot")) == {"problem": "no such robot", "state": ""}
    assert json.loads(answer_line(state="T")) == {"problem": "", "state": "T"}


def test_a_robots_processes_have_names_that_no_robot_can_have() -> None:
    assert [process_name("r1", incarnation) for incarnation in (1, 2, 3)] == ["r1", "r1 (2)", "r1 (3)"]


def test_a_restarted_robot_is_another_process() -> None:
    stage = Stage()
    assert stage.reach(2) == (1, 201)
    stage.control.kill(2)
    assert not stage.sessions.is_open(2)
    stage.control.start(2, 2)
    assert stage.control.arrived(2)
    assert stage.reach(2) == (2, 202)
    assert stage.asked == [("kill", 2, 0), ("start", 2, 2)]
    assert stage.sessions.gone([1, 2]) == []


def test_a_word_of_the_dead_takes_no_place() -> None:
    stage = Stage(waits=False)
    stage.control.kill(2)
    last_words = HelloReply(1, 201, 0, RUN, HASH)
    stage.deliver(2, last_words)
    stage.deliver(2, ReplyA(1, 201, 5, RUN, (b"frame",)))
    for _ in range(3):
        assert stage.sessions.take(0.1) is None
    stage.control.start(2, 2)
    stage.deliver(2, last_words)
    stage.sessions.take(0.1)
    assert not stage.control.arrived(2)
    assert [stop.reason for stop in stage.told(Stop, 2)] == ["no process is expected for r2 now"] * 2


def test_nobody_is_awaited_for_a_robot_that_is_absent() -> None:
    stage = Stage(absent=(2,))
    assert [stage.sessions.is_open(number) for number in BOTH] == [True, False]
    stage.incarnation[2] = 1
    stage.deliver(2, HelloReply(1, 201, 0, NO_RUN, HASH))
    stage.sessions.take(0.1)
    assert [len(stage.told(Hello, number)) for number in BOTH] == [1, 0]
    stage.control.start(2, 1)
    assert stage.control.arrived(2)


def test_where_the_world_does_not_wait_a_robot_arrives_when_it_does() -> None:
    stage = Stage(waits=False)
    stage.control.kill(2)
    began = stage.time
    stage.control.start(2, 2)
    assert stage.time == began
    assert not stage.control.arrived(2)
    while not stage.control.arrived(2):
        stage.sessions.take(0.1)
    assert stage.time - began == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("waits", [True, False])
def test_a_process_that_never_comes_is_given_up(waits: bool) -> None:
    stage = Stage(waits=waits)
    stage.slow = None
    stage.control.kill(2)
    began = stage.time
    stage.control.start(2, 2)
    while stage.time < began + START_S:
        assert not stage.control.arrived(2)
        stage.sessions.take(1.0)
    with pytest.raises(NotStarted, match="did not come within 600 s"):
        stage.control.arrived(2)


@pytest.mark.parametrize("waits", [True, False])
def test_a_process_that_ends_before_it_has_come_is_waited_for_no_longer(waits: bool) -> None:
    stage = Stage(waits=waits)
    stage.slow = None
    stage.control.kill(2)
    stage.ended = {2}
    stage.control.start(2, 2)
    stage.time += 1.0
    with pytest.raises(NotStarted, match="its new process has ended"):
        stage.control.arrived(2)
    assert stage.time < 1010.0


def test_who_leaves_is_let_go_told_and_waited_for() -> None:
    stage = Stage()
    stage.control.leave(2)
    assert [do for do, _, _ in stage.asked] == ["resume", "leave"]
    (stop,) = stage.told(Stop, 2)
    assert stop.orderly
    assert not stage.sessions.is_open(2)


def test_a_token_that_went_during_a_pause_costs_no_robot_its_life() -> None:
    stage = Stage()
    stage.control.pause(2)
    stage.presence(2, False)
    stage.sessions.take(0.1)
    stage.time += 100.0
    stage.control.resume(2)
    stage.time += 100.0
    assert stage.sessions.gone([2]) == []
    stage.ended = {2}
    assert stage.sessions.gone([2]) == [2]


@pytest.mark.parametrize(
    ("state", "says"), [("T", STOPPED), ("", UNSEEN), ("S", "its process has the state S and does not stand still")]
)
def test_what_was_seen_of_a_paused_process_is_told(state: str, says: str) -> None:
    stage = Stage()
    stage.state = state
    assert stage.control.pause(2) == says
    assert stage.control.resume(2) == says


def test_what_the_launcher_cannot_do_is_told() -> None:
    stage = Stage()
    stage.problem = "KeyError: 2"
    with pytest.raises(ControlFailed, match="kill robot 2: KeyError: 2"):
        stage.control.kill(2)
    stage.control.release([1, 2])
    assert [do for do, _, _ in stage.asked] == ["kill", "resume"]


def test_an_interrupted_world_waits_for_nobody() -> None:
    stage = Stage()
    stage.slow = None
    stage.control.kill(2)
    stage.ending = True
    with pytest.raises(Interrupted):
        stage.control.start(2, 2)
