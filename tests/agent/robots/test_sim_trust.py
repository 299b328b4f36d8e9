"""Messages that a simulated robot refuses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import pytest

from agent.robots.sim import join
from patrol.messages.phases import ANYONE, NO_RUN, Stop, ToRobot, encode
from patrol.net.mailbox import Mailbox, Payload, Post, Presence
from patrol.process.lifeline import Ending
from tests.agent.robots.test_sim import KEYS, ME, RUN, Scene, a, b, hello
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
    scene.tell(*(replace(begins, run=6) for begins in (a(3), b(3))))
    scene.tell(Stop(1, 77, 0, 6, True, "go"), Stop(1, 77, 0, NO_RUN, True, ""))
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


def test_a_robot_that_was_paused_goes_on_with_whatever_tick_has_begun() -> None:
    scene = Scene()
    scene.tick(2)
    assert scene.tick(90, (b"x",)) == [b"x"]
    assert scene.robot.refused == 0


def test_what_was_heard_in_a_tick_whose_phase_a_is_lost_is_heard_in_the_next() -> None:
    scene = Scene()
    scene.tick(2)
    for _ in range(3):  # of each tick once, so that nobody can fill the memory with them
        scene.tell(b(3, (b"3",)), b(5, (b"5",)))
    assert scene.tick(4, (b"4",)) == [b"3", b"5", b"4"]
    assert scene.tick(5, (b"again",)) == []
    assert scene.robot.refused == 0
