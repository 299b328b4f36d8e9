"""The process that speaks for a robot: when another one wants to, and when it cannot go on."""

import pytest

from patrol.exchange import Reply
from patrol.journal import Status
from patrol.pose import Velocity
from runtime.messages.phases import ANYONE, PROTOCOL, UNLIKE, Failed, Farewell, HelloReply, ReplyA, ReplyB, Stop
from runtime.messages.session import OLDEST
from tests.worldsim.fleet.net import HASH, NAMES, RUN, heard, lockstep, paced, sensed, tick

COMMAND = Reply(Velocity(9.0, 9.0), "patrolling", None, 1.0, 0)
OTHERS = [
    HelloReply(1, 5, 0, RUN, HASH),
    HelloReply(1, 5, 0, RUN, "d" * 64),
    HelloReply(2, 5, 0, RUN, HASH, PROTOCOL + 1),
    HelloReply(1, ANYONE, 0, RUN, HASH),
]


@pytest.mark.parametrize("other", OTHERS)
def test_a_seat_that_is_taken_is_refused_and_counted_and_the_run_goes_on(other: HelloReply) -> None:
    net, fleet = lockstep()
    net.deliver(2, other)
    assert fleet.phase_a(0, sensed(0)) == dict.fromkeys(NAMES, (b"frame",))
    assert net.refused == {"seat": 1}
    assert [(stop.instance, stop.run) for stop in net.told(Stop, 2)] == [(other.instance, RUN)]


def test_at_a_restart_only_the_process_that_was_started_takes_the_seat() -> None:
    net, fleet = lockstep()
    net.mute = {2}
    net.sessions.expect(2, 2)
    net.deliver(2, HelloReply(1, 72, 0, RUN, HASH))
    net.sessions.take(0.0)
    assert not net.sessions.is_open(2)
    assert net.refused == {"seat": 1}
    net.deliver(2, HelloReply(2, 202, 0, RUN, HASH))
    net.sessions.take(0.0)
    assert net.sessions.is_open(2)
    fleet.phase_a(1, sensed(1, (1, 3)))


def test_in_mid_run_a_process_with_another_scenario_is_turned_away_and_the_world_goes_on() -> None:
    net, fleet = lockstep()
    net.mute = {2}
    net.sessions.expect(2, 2)
    net.deliver(2, HelloReply(2, 5, 0, RUN, "d" * 64))
    fleet.phase_a(0, sensed(0, (1, 3)))
    assert not net.sessions.is_open(2)
    assert net.refused == {"seat": 1}
    (stop,) = net.told(Stop, 2)
    assert stop.reason.startswith(UNLIKE)


def test_an_answer_to_a_tick_that_has_not_begun_is_refused() -> None:
    net, fleet = paced()
    fleet.phase_a(0, sensed(0))
    net.deliver(1, ReplyB(1, 71, 1, RUN, COMMAND))
    net.deliver(1, ReplyB(1, 71, 2**31 - 1, RUN, COMMAND))
    net.deliver(1, ReplyA(1, 71, 5, RUN, (b"ahead",)))
    replies = fleet.phase_b(0, heard())
    assert replies[1] is not None
    assert replies[1].command == Velocity(0.0, 0.0)
    assert net.refused == {"ahead": 3}


def test_an_answer_to_a_tick_of_long_ago_is_refused() -> None:
    net, fleet = paced()
    net.mute = {1}
    for k in range(OLDEST + 1):
        tick(fleet, k)
    fleet.phase_a(OLDEST + 1, sensed(OLDEST + 1))
    net.deliver(1, ReplyB(1, 71, 1, RUN, COMMAND))
    replies = fleet.phase_b(OLDEST + 1, heard())
    assert (replies[1], net.refused) == (None, {"late": 1})
    net.deliver(1, ReplyB(1, 71, 3, RUN, COMMAND))
    assert fleet.phase_b(OLDEST + 1, heard())[1] == COMMAND


def test_a_farewell_of_a_stranger_is_refused() -> None:
    net, fleet = lockstep()
    fleet.phase_a(0, sensed(0))
    for head in ((1, 5, 0, RUN), (2, 71, 0, RUN), (1, 71, 0, RUN + 1)):
        net.deliver(1, Farewell(*head))
        net.sessions.take(0.0)
    assert net.refused == {"stranger": 3}


# --- minds that cannot go on -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", ["A", "B"])
def test_who_cannot_go_on_is_lost_at_once_with_its_reason(phase: str) -> None:
    net, fleet = lockstep()
    net.mute = {2}
    net.deliver(2, Failed(1, 72, 3, RUN, "its policy failed at tick 3: no idea"), 0.2)
    began = net.time
    answers = fleet.phase_a(3, sensed(3)) if phase == "A" else fleet.phase_b(3, heard())
    assert list(answers) == [1, 3]
    assert net.time - began < 1.0
    assert fleet.lost() == [(2, Status.LOST, "its policy failed at tick 3: no idea")]
    assert fleet.lost() == []
    (stop,) = net.told(Stop, 2)
    assert (stop.reason, stop.orderly) == ("left out: its policy failed at tick 3: no idea", False)


def test_a_failure_of_another_process_is_not_the_robots_own() -> None:
    net, fleet = lockstep()
    net.deliver(2, Failed(1, 99, 3, RUN, "another instance"))
    net.deliver(2, Failed(2, 72, 3, RUN, "another incarnation"))
    assert list(fleet.phase_a(3, sensed(3))) == [1, 2, 3]
    assert fleet.lost() == []
    assert net.refused["stranger"] == 2


def test_a_robot_that_has_failed_may_come_again_as_another_process() -> None:
    net, fleet = lockstep()
    net.deliver(2, Failed(1, 72, 3, RUN, "no idea"))
    fleet.phase_a(3, sensed(3))
    net.sessions.end(2)
    assert net.sessions.failed(NAMES) == {}


def test_at_a_pace_too_who_cannot_go_on_is_lost_with_its_reason() -> None:
    net, fleet = paced()
    net.mute = {2}
    net.deliver(2, Failed(1, 72, 0, RUN, "its policy failed at tick 0: no idea"), 0.2)
    net.deliver(3, Failed(1, 99, 0, RUN, "another instance"), 0.2)
    tick(fleet, 0)
    assert fleet.lost() == [(2, Status.LOST, "its policy failed at tick 0: no idea")]
    (stop,) = net.told(Stop, 2)
    assert stop.reason == "left out: its policy failed at tick 0: no idea"
    fleet.phase_a(1, sensed(1, (1, 3)))
    fleet.phase_b(1, heard((1, 3)))
    assert fleet.lost() == []
