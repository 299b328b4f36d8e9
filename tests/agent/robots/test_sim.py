from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import pytest

from agent.ports import Decision, State
from agent.robots.sim import SimRobot, join
from patrol.exchange import Reply, Sensed
from patrol.pose import Command, Drive, Pose, Velocity
from runtime.messages.phases import (
    ANYONE,
    NO_RUN,
    Failed,
    Farewell,
    Hello,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    ToRobot,
    ToWorld,
    decode_to_robot,
    decode_to_world,
    encode,
)
from runtime.messages.session import SILENCE_S, Identity, RobotEnd, Send
from runtime.net.mailbox import Mailbox, Payload, Post, Presence
from runtime.process.lifeline import Ending
from runtime.security.keys import WORLD, FleetKeys
from tests.present import present
from tests.runtime.net.test_mailbox import Bytes

if TYPE_CHECKING:
    from runtime.net.link import Link

ME = Identity("r1", 1, 77, "a" * 64)
RUN = 5
KEYS = FleetKeys("f")
POSE = Pose(1.0, 2.0, 0.5)
DECISION = Decision(Velocity(1.0, -1.0), State.PATROLLING, 0.0, (3.0, 4.0), (3.5, 4.5), 9, 2)


class Clocked(Mailbox[ToRobot | Presence]):
    """A mailbox in which waiting passes the time of the test's clock."""

    time = 100.0
    ends = (math.inf, Ending())

    def get(self, timeout_s: float = 0.0) -> tuple[str, ToRobot | Presence] | None:
        arrived = super().get()
        self.time += 0.0 if arrived else timeout_s
        if self.time >= self.ends[0]:
            self.ends[1].ask("told to")
        return arrived


class Scene:
    """One robot, what it is sent and what it answers."""

    def __init__(
        self, patience_s: float = 60.0, blind_s: float = math.inf, model: str = "holonomic", greeted: bool = True
    ) -> None:
        self.payloads: list[bytes] = []
        self.sent: list[ToWorld] = []
        self.answer: Callable[[ToWorld], None] = lambda _message: None
        """The world's reaction to a message."""
        self.times: list[float] = []
        self.waited: list[float] = []
        self.ending = Ending()
        self.mailbox = Clocked((KEYS.tick("r1"), KEYS.alive(WORLD)), decode_to_robot, 1000)
        self.session = RobotEnd(ME, patience_s, blind_s, self.mailbox.time)
        ports = (self.mailbox, self.post, self.session, self.ending)
        self.robot = SimRobot(*ports, model=model, waiting=self.waited.append, now=lambda: self.mailbox.time)
        if greeted:
            assert self.session.arrived(hello(), self.mailbox.time) == (Send(HelloReply(1, 77, 0, RUN, ME.scenario)),)

    def post(self, payload: bytes) -> None:
        self.payloads.append(payload)
        self.sent.append(decode_to_world(payload))
        self.times.append(self.mailbox.time)
        self.answer(self.sent[-1])

    def tell(self, *messages: ToRobot) -> None:
        for message in messages:
            self.mailbox.put(KEYS.tick("r1"), decode_to_robot(encode(message)))

    def world(self, *, present: bool) -> None:
        self.mailbox.put(KEYS.alive(WORLD), Presence(present))

    def tick(self, k: int, frames: tuple[bytes, ...] = ()) -> list[bytes] | None:
        """One whole tick in lockstep; what was heard."""
        self.tell(a(k), b(k, frames))
        sensed = self.sense()
        self.robot.send((b"frame %d" % k,))
        heard = self.robot.hear()
        self.robot.report(sensed, DECISION, 1.5)
        self.robot.act(DECISION.command)
        return heard

    def sense(self) -> Sensed:
        return present(self.robot.sense())

    def end_after(self, seconds: float) -> None:
        """Ask the robot to leave so much later."""
        self.mailbox.ends = self.mailbox.time + seconds, self.ending

    def last(self, count: int) -> list[ToWorld]:
        return self.sent[-count:]


def a(k: int, instance: int = 77, incarnation: int = 1) -> PhaseA:
    return PhaseA(incarnation, instance, k, RUN, Sensed(k, POSE, bumped=k % 2 == 1))


def b(k: int, frames: tuple[bytes, ...] = ()) -> PhaseB:
    return PhaseB(1, 77, k, RUN, frames)


def hello(run: int = RUN) -> Hello:
    return Hello(0, ANYONE, 0, run)


def test_it_answers_a_hello_with_who_it_is() -> None:
    scene = Scene(greeted=False)
    scene.tell(hello(), a(0))
    sensed = scene.sense()
    assert (sensed.k, sensed.pose, sensed.bumped) == (0, POSE, False)
    assert scene.sent == [HelloReply(1, 77, 0, 5, "a" * 64)]


def test_a_tick_in_lockstep() -> None:
    scene = Scene()
    assert scene.tick(3, (b"x", b"y")) == [b"x", b"y"]
    assert scene.sent == [
        ReplyA(1, 77, 3, RUN, (b"frame 3",)),
        ReplyB(1, 77, 3, RUN, Reply(Velocity(1.0, -1.0), "patrolling", (3.5, 4.5), 1.5, 2)),
    ]


def test_a_repeat_is_answered_from_the_last_answer_and_decides_nothing() -> None:
    scene = Scene()
    scene.tick(0)
    answers = scene.last(2)
    scene.tell(a(0), b(0), a(1))
    assert scene.sense().k == 1
    assert scene.last(2) == answers
    scene.robot.send((b"frame",))
    scene.tell(a(1), a(1), b(1))
    assert scene.robot.hear() == []
    assert [type(message) for message in scene.last(3)] == [ReplyA, ReplyA, ReplyA]


def test_who_comes_late_goes_on_with_the_newest_tick_and_all_that_was_heard() -> None:
    scene = Scene()
    scene.tell(a(0), b(0, (b"0",)), a(1), b(1, (b"1",)), a(2))
    sensed = scene.sense()
    assert sensed.k == 2
    scene.robot.send((b"frame",))
    scene.tell(b(2, (b"2",)))
    assert scene.robot.hear() == [b"0", b"1", b"2"]
    scene.robot.report(sensed, DECISION, 1.0)
    scene.robot.act(DECISION.command)
    assert scene.tick(3, (b"3",)) == [b"3"]


def test_a_tick_that_is_over_is_not_decided_but_what_comes_later_is_heard() -> None:
    scene = Scene()
    scene.tell(a(0))
    scene.sense()
    scene.robot.send((b"frame",))
    scene.tell(a(1))
    assert scene.robot.hear() is None
    scene.sense()
    scene.robot.send((b"frame",))
    scene.tell(b(0, (b"0",)), b(1, (b"1",)))
    assert scene.robot.hear() == [b"0", b"1"]


def test_messages_for_another_process_are_counted_and_ignored() -> None:
    scene = Scene()
    scene.tell(a(7, instance=78), a(8, incarnation=2), replace(b(9), instance=5), Stop(1, 78, 0, RUN, True, "go"))
    scene.tell(Stop(1, 77, 0, NO_RUN, True, ""), a(0))
    assert scene.sense().k == 0
    assert scene.mailbox.refused["stranger"] == 5
    assert scene.robot.refused == 5
    assert not scene.robot.farewell


@pytest.mark.parametrize("orderly", [True, False])
def test_it_leaves_when_told_to(orderly: bool) -> None:
    scene = Scene()
    scene.tell(a(0))
    scene.sense()
    scene.tell(Stop(1, 77, 0, RUN, orderly, "because"))
    assert scene.robot.hear() is None
    assert scene.robot.sense() is None
    assert (scene.robot.farewell, scene.robot.orderly) == ("because", orderly)


def test_it_begins_no_tick_and_answers_nothing_once_it_has_left() -> None:
    scene = Scene()
    scene.tick(0)
    before = len(scene.sent)
    scene.tell(a(1), Stop(1, 77, 1, RUN, orderly=True, reason=""), a(0), hello())
    assert scene.robot.sense() is None
    scene.tell(hello(), a(1), b(1), a(2, instance=78))
    assert scene.robot.sense() is None
    assert [type(message) for message in scene.sent[before:]] == [Farewell]
    assert (scene.robot.orderly, scene.robot.refused) == (True, 0)


def test_a_farewell_that_came_before_the_signal_counts() -> None:
    scene = Scene()
    scene.tick(0)
    scene.tell(Stop(1, 77, 1, RUN, orderly=True, reason="the run is over"))
    scene.ending.ask("told to by SIGTERM")
    assert scene.robot.sense() is None
    assert (scene.robot.farewell, scene.robot.orderly) == ("the run is over", True)
    scene = Scene()
    scene.ending.ask("told to by SIGTERM")
    assert scene.robot.sense() is None
    assert scene.robot.farewell == "told to by SIGTERM"


def test_another_world_is_not_obeyed() -> None:
    """Not as long as there is our own; nor later, but then we are free to leave."""
    scene = Scene()
    scene.world(present=True)
    scene.tell(hello())
    scene.tick(0)
    scene.mailbox.time += 2.0 * SILENCE_S
    scene.tell(hello(6))
    scene.tick(1)
    assert scene.robot.refused == 1
    scene.world(present=False)
    scene.world(present=True)
    scene.tell(hello(6))
    scene.tick(2)
    assert scene.robot.refused == 2
    assert scene.last(1) != [HelloReply(1, 77, 0, 6, "a" * 64)]
    scene.world(present=False)
    scene.world(present=True)
    assert scene.tick(3) == []  # a router that has returned
    scene.world(present=False)
    scene.world(present=True)
    scene.mailbox.time += SILENCE_S
    scene.tell(hello(6))
    assert scene.robot.sense() is None
    assert "another world" in scene.robot.farewell


def test_without_a_world_it_says_that_it_waits_and_gives_up() -> None:
    scene = Scene(greeted=False, patience_s=10.0)
    assert scene.robot.sense() is None
    assert "no world for 10 s" in scene.robot.farewell
    assert not scene.robot.orderly
    assert len(scene.waited) == 2
    assert set(scene.sent) == {HelloReply(1, 77, 0, NO_RUN, "a" * 64)}


def test_a_world_that_falls_silent_is_asked_whether_we_still_belong() -> None:
    scene = Scene(patience_s=1.0)
    scene.world(present=True)
    scene.tell(hello())
    scene.tick(4)
    before = len(scene.sent)
    scene.answer = lambda _message: scene.tell(Stop(1, 77, 4, RUN, False, "left out"))
    began = scene.mailbox.time
    assert scene.robot.sense() is None
    answers = scene.sent[before:]
    assert answers[:-1] == [HelloReply(1, 77, 4, 5, "a" * 64)]
    assert isinstance(answers[-1], Farewell)
    assert SILENCE_S <= scene.mailbox.time - began < SILENCE_S + 1.0
    assert scene.robot.farewell == "left out"


def test_a_lost_world_may_come_back_for_a_while() -> None:
    scene = Scene(patience_s=10.0)
    scene.world(present=True)
    scene.tick(0)
    scene.world(present=False)
    began = scene.mailbox.time
    assert scene.robot.sense() is None
    assert 10.0 <= scene.mailbox.time - began < 11.0


STILL = ReplyB(1, 77, 3, RUN, Reply(Velocity(0.0, 0.0), "holding", None, 1.5, 2))


@pytest.mark.parametrize(("model", "command"), [("holonomic", Velocity(0.0, 0.0)), ("car", Drive(0.0, 0.0))])
def test_it_stops_when_no_pose_comes_any_more(model: str, command: Command) -> None:
    scene = Scene(patience_s=10.0, blind_s=2.0, model=model)
    scene.world(present=True)
    scene.tick(3)
    began = scene.mailbox.time
    scene.tell(b(4))  # what others say is no pose
    scene.end_after(5.0)
    assert scene.robot.sense() is None
    still = replace(STILL, reply=replace(STILL.reply, command=command))
    assert scene.sent.count(still) == 1
    assert scene.times[scene.sent.index(still)] - began == pytest.approx(2.0, abs=0.5)


def test_it_drives_on_in_lockstep_and_has_nothing_to_stop_before_it_has_driven() -> None:
    for scene, ticks in ((Scene(patience_s=10.0), (3,)), (Scene(patience_s=10.0, blind_s=2.0), ())):
        scene.world(present=True)
        for k in ticks:
            scene.tick(k)
        scene.end_after(5.0)
        assert scene.robot.sense() is None
        assert STILL not in scene.sent


def test_a_mind_that_cannot_go_on_says_at_which_tick_and_why() -> None:
    scene = Scene()
    scene.robot.stop("too early")
    scene.tick(4)
    scene.tell(a(5))
    scene.sense()
    scene.robot.stop("its policy failed")
    assert scene.sent[0] == Failed(1, 77, 0, RUN, "too early")
    assert scene.last(1) == [Failed(1, 77, 5, RUN, "its policy failed")]


def test_a_command_that_nobody_reports_on_is_sent_all_the_same() -> None:
    scene = Scene()
    scene.tick(3)
    scene.tell(a(4), b(4))
    scene.sense()
    scene.robot.send((b"frame",))
    assert scene.robot.hear() == []
    scene.robot.act(Velocity(0.5, 0.0))
    assert scene.last(1) == [ReplyB(1, 77, 4, RUN, Reply(Velocity(0.5, 0.0), "patrolling", None, 0.0, 0))]


def test_it_is_a_clock_for_radios() -> None:
    scene = Scene()
    scene.tell(a(0), b(0, (b"x",)), a(3))
    assert scene.robot.tick() == 3
    scene.tell(b(3))
    assert scene.robot.decide()
    scene.tell(a(4), a(5))
    assert scene.robot.tick() == 5
    scene.tell(a(6))
    assert not scene.robot.decide()
    scene.ending.ask("enough")
    assert scene.robot.tick() == 6
    assert scene.robot.tick() is None
    assert not scene.robot.decide()


# --- messages that a simulated robot refuses -------------------------------------------------------------------------


class Wire:
    """A link on which only the test speaks to the robot."""

    def __init__(self) -> None:
        self.deliver: dict[str, Callable[[str, Payload], None]] = {}

    def post(self, _key: str) -> Post:
        return lambda _payload: None

    def subscribe(self, key: str, mailbox: Mailbox[ToRobot | Presence]) -> None:
        self.deliver[key] = mailbox.deliver

    def watch(self, key: str, mailbox: Mailbox[ToRobot | Presence]) -> None:
        self.deliver[key] = mailbox.deliver

    def live(self, key: str) -> None:
        pass


@pytest.mark.parametrize(("in_force", "refused"), [((0, 1), 0), ((0, 2), 1)])
def test_a_zone_that_the_scenario_does_not_have_is_refused(in_force: tuple[int, ...], refused: int) -> None:
    wire = Wire()
    robot = join(cast("Link", wire), KEYS, ME, 1, 2, Ending(), 60.0, lambda _waited: None)
    phase = replace(a(0), sensed=replace(a(0).sensed, zones=in_force))
    wire.deliver[KEYS.tick("r1")](KEYS.tick("r1"), Bytes(encode(phase)))
    assert robot.refused == refused


def test_a_forged_greeting_does_not_keep_a_robot_from_its_own_world() -> None:
    """Whoever greets it is answered, and the first who begins a tick has it."""
    scene = Scene(greeted=False)
    scene.tell(hello(6), hello(RUN), hello(7))
    assert scene.tick(0, (b"x",)) == [b"x"]
    assert [message.run for message in scene.sent[:3]] == [6, RUN, 7]
    assert scene.mailbox.refused == {}
    scene.world(present=True)
    scene.tell(hello(6), replace(a(1), run=6))
    assert scene.tick(1, (b"x",)) == [b"x"]
    assert scene.mailbox.refused == {"stranger": 2}


def test_greetings_without_end_take_a_bounded_memory() -> None:
    scene = Scene(greeted=False)
    for run in range(100, 200):
        scene.tell(hello(run))
    scene.tell(hello(RUN))
    assert scene.tick(0, (b"x",)) == [b"x"]
