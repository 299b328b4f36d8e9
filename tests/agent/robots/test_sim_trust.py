"""Messages that a simulated robot refuses, and what it reports to its world so that forgeries are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import pytest

from agent.robots.sim import join
from patrol.exchange import Sensed
from patrol.messages.phases import (
    ANYONE,
    NO_RUN,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Report,
    Stop,
    ToRobot,
    encode,
)
from patrol.net.mailbox import Mailbox, Payload, Post, Presence
from patrol.pose import Velocity
from patrol.process.lifeline import Ending
from patrol.security.tick_chain import TickChain
from patrol.security.transcripts import LAST, LINES, Line, digest_of
from tests.agent.robots.test_sim import CHAIN, KEYS, ME, POSE, RUN, Scene, a, b, hello
from tests.patrol.net.test_mailbox import Bytes

if TYPE_CHECKING:
    from patrol.net.link import Link


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


def test_messages_of_another_run_are_counted_and_ignored() -> None:
    scene = Scene()
    scene.tell(
        replace(a(3), run=6), replace(b(3), run=6), Stop(1, 77, 0, 6, True, "go"), Stop(1, 77, 0, NO_RUN, True, "")
    )
    assert scene.tick(0, (b"x",)) == [b"x"]
    assert scene.mailbox.refused == {"stranger": 4}
    assert not scene.robot.farewell


@pytest.mark.parametrize("run", [RUN, 6])
def test_who_was_greeted_leaves_for_no_message_to_everybody(run: int) -> None:
    scene = Scene()
    scene.tell(Stop(1, ANYONE, 0, run, True, "go home"), Stop(0, ANYONE, 0, run, True, "go home"))
    assert scene.tick(0) == []
    assert scene.mailbox.refused == {"stranger": 2}
    assert not scene.robot.farewell


def test_who_was_not_greeted_can_be_turned_away() -> None:
    scene = Scene(greeted=False)
    scene.tell(Stop(1, ANYONE, 0, RUN, False, "go"), Stop(1, 77, 0, RUN, False, "another process is r1 already"))
    assert scene.robot.sense() is None
    assert scene.robot.farewell == "another process is r1 already"
    assert scene.mailbox.refused == {"stranger": 1}


def test_a_forged_greeting_does_not_keep_a_robot_from_its_own_world() -> None:
    """Whoever greets it is answered, and the first who begins a tick has it."""
    scene = Scene(greeted=False)
    forged = TickChain(b"another", 100)
    scene.tell(replace(hello(6), proof=forged.proof(0)), hello(RUN), replace(hello(7), proof=forged.proof(0)))
    scene.tell(replace(a(0), run=6), replace(a(0), run=7))  # proofs of the other run
    assert scene.tick(0, (b"x",)) == [b"x"]
    assert [message.run for message in scene.sent[:3]] == [6, RUN, 7]
    assert scene.mailbox.refused == {"ahead": 2}
    scene.world(present=True)
    scene.tell(hello(6), replace(a(1), run=6, proof=forged.proof(2)))
    assert scene.tick(1, (b"x",)) == [b"x"]
    assert scene.mailbox.refused == {"ahead": 2, "stranger": 2}


def test_greetings_without_end_take_a_bounded_memory() -> None:
    scene = Scene(greeted=False)
    for run in range(100, 200):
        scene.tell(hello(run))
    scene.tell(hello(RUN))
    assert scene.tick(0, (b"x",)) == [b"x"]


@pytest.mark.parametrize("ahead", [1, 50, 10**6, 2**31 - 4])
def test_a_tick_that_has_not_begun_is_refused_and_deafens_nobody(ahead: int) -> None:
    scene = Scene()
    scene.tick(2)
    known = CHAIN.proof(3)
    forged = [PhaseA(1, 77, 2 + ahead, RUN, Sensed(2 + ahead, POSE), proof) for proof in (known, bytes(16))]
    scene.tell(*forged)
    assert scene.tick(3, (b"x",)) == [b"x"]
    assert scene.mailbox.refused == {"ahead": 2}


def test_a_robot_that_was_paused_goes_on_with_whatever_tick_has_begun() -> None:
    scene = Scene()
    scene.tick(2)
    assert scene.tick(90, (b"x",)) == [b"x"]
    assert scene.robot.refused == 0


def test_a_phase_b_far_ahead_is_refused_and_ends_no_wait() -> None:
    scene = Scene()
    scene.tick(2)
    for k in (4, 8, 10**6):
        scene.tell(PhaseB(1, 77, k, RUN, (b"forged",), CHAIN.proof(3)), PhaseB(1, 77, k, RUN, (b"forged",), bytes(16)))
    assert scene.tick(3, (b"x",)) == [b"x"]
    assert scene.mailbox.refused == {"ahead": 6}


def test_what_was_heard_in_a_tick_whose_phase_a_is_lost_is_heard_in_the_next() -> None:
    scene = Scene()
    scene.tick(2)
    for _ in range(3):  # of each tick once, so that nobody can fill the memory with them
        scene.tell(b(3, (b"3",)), b(5, (b"5",)))
    assert scene.tick(4, (b"4",)) == [b"3", b"5", b"4"]
    assert scene.tick(5, (b"again",)) == []
    assert scene.robot.refused == 0


# --- transcripts -----------------------------------------------------------------------------------------------------


def test_it_reports_what_it_has_sent_and_acted_on_every_few_ticks_and_when_it_leaves() -> None:
    scene = Scene()
    for k in range(LINES + 3):
        scene.tick(k, (b"%d" % k,))
    scene.tell(Stop(1, 77, LINES + 3, RUN, True, "the run is over"))
    assert scene.robot.sense() is None
    messages = scene.sent
    first, last = (message for message in messages if isinstance(message, Report))
    assert [line.k for line in (*first.lines, *last.lines)] == list(range(LINES + 3))
    assert (first.since, first.k, last.since, last.k) == (0, first.lines[-1].k, first.k + 1, LAST)
    assert LINES - 1 <= len(first.lines) <= LINES
    sent = {(type(message), message.k): payload for message, payload in zip(messages, scene.payloads, strict=True)}
    told_a, told_b = digest_of(encode(a(3))), digest_of(encode(b(3, (b"3",))))
    assert first.lines[3] == Line(3, (told_a, told_b, digest_of(sent[ReplyA, 3]), digest_of(sent[ReplyB, 3])))


def test_it_reports_as_often_where_another_radio_carries_its_frames() -> None:
    scene = Scene()
    for k in range(3 * LINES):
        scene.tell(a(k), b(k))
        assert scene.robot.tick() == k
        assert scene.robot.decide()
        scene.robot.act(Velocity(0.0, 0.0))
    reports = [message for message in scene.sent if isinstance(message, Report)]
    assert len(reports) >= 2
    assert [line.k for report in reports for line in report.lines] == list(range(reports[-1].k + 1))
    assert reports[-1].k >= 2 * LINES - 2


def test_repeats_and_ticks_that_it_has_skipped_are_not_reported() -> None:
    scene = Scene()
    scene.tell(a(0), a(1))
    assert scene.robot.sense() is not None
    scene.robot.send((b"frame",))
    scene.tell(a(1), a(1), b(1), b(1))
    assert scene.robot.hear() == []
    scene.robot.act(Velocity(1.0, 0.0))
    scene.tell(b(1), Stop(1, 77, 1, RUN, True, "the run is over"))
    assert scene.robot.sense() is None
    report = scene.sent[-1]
    assert isinstance(report, Report)
    assert [line.k for line in report.lines] == [1]
    assert [len(digest) for digest in report.lines[0].digests] == [8, 8, 8, 8]


def test_a_command_that_is_withdrawn_is_reported_with_the_first() -> None:
    scene = Scene(patience_s=10.0, blind_s=2.0)
    scene.world(present=True)
    scene.tick(3)
    scene.end_after(5.0)
    assert scene.robot.sense() is None
    report = scene.sent[-1]
    assert isinstance(report, Report)
    replies = [digest_of(encode(message)) for message in scene.sent if isinstance(message, ReplyB)]
    assert report.lines[0].digests[3] == b"".join(replies)
    assert len(replies) == 2
