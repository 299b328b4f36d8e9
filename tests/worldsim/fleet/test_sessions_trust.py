"""The process that speaks for a robot, when another one wants to."""

from __future__ import annotations

import pytest

from patrol.exchange import Reply
from patrol.messages.phases import ANYONE, PROTOCOL, UNLIKE, Farewell, HelloReply, ReplyA, ReplyB, Stop
from patrol.messages.session import OLDEST
from patrol.pose import Velocity
from tests.worldsim.fleet.net import HASH, NAMES, RUN, Net, fleet_of, heard, sensed
from worldsim.fleet.paced import PacedFleet

COMMAND = Reply(Velocity(9.0, 9.0), "patrolling", None, 1.0, 0)
OTHERS = [
    HelloReply(1, 5, 0, RUN, HASH),
    HelloReply(1, 5, 0, RUN, "d" * 64),
    HelloReply(2, 5, 0, RUN, HASH, PROTOCOL + 1),
    HelloReply(1, ANYONE, 0, RUN, HASH),
]


@pytest.mark.parametrize("other", OTHERS)
def test_a_seat_that_is_taken_is_refused_and_counted_and_the_run_goes_on(other: HelloReply) -> None:
    net = Net()
    fleet = fleet_of(net)
    net.deliver(2, other)
    assert fleet.phase_a(0, sensed(0)) == dict.fromkeys(NAMES, (b"frame",))
    assert net.refused == {"seat": 1}
    assert [(stop.instance, stop.run) for stop in net.told(Stop, 2)] == [(other.instance, RUN)]


def test_at_a_restart_only_the_process_that_was_started_takes_the_seat() -> None:
    net = Net()
    fleet = fleet_of(net)
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
    net = Net()
    fleet = fleet_of(net)
    net.mute = {2}
    net.sessions.expect(2, 2)
    net.deliver(2, HelloReply(2, 5, 0, RUN, "d" * 64))
    fleet.phase_a(0, sensed(0, (1, 3)))
    assert not net.sessions.is_open(2)
    assert net.refused == {"seat": 1}
    (stop,) = net.told(Stop, 2)
    assert isinstance(stop, Stop)
    assert stop.reason.startswith(UNLIKE)


def test_an_answer_to_a_tick_that_has_not_begun_is_refused() -> None:
    net = Net()
    net.gather()
    fleet = PacedFleet(net.sessions, 0.5)
    fleet.phase_a(0, sensed(0))
    net.deliver(1, ReplyB(1, 71, 1, RUN, COMMAND))
    net.deliver(1, ReplyB(1, 71, 2**31 - 1, RUN, COMMAND))
    net.deliver(1, ReplyA(1, 71, 5, RUN, (b"ahead",)))
    replies = fleet.phase_b(0, heard())
    assert replies[1] is not None
    assert replies[1].command == Velocity(0.0, 0.0)
    assert net.refused == {"ahead": 3}


def test_an_answer_to_a_tick_of_long_ago_is_refused() -> None:
    net = Net()
    net.gather()
    fleet = PacedFleet(net.sessions, 0.5)
    net.mute = {1}
    for k in range(OLDEST + 1):
        fleet.phase_a(k, sensed(k))
        fleet.phase_b(k, heard())
    fleet.phase_a(OLDEST + 1, sensed(OLDEST + 1))
    net.deliver(1, ReplyB(1, 71, 1, RUN, COMMAND))
    replies = fleet.phase_b(OLDEST + 1, heard())
    assert (replies[1], net.refused) == (None, {"late": 1})
    net.deliver(1, ReplyB(1, 71, 3, RUN, COMMAND))
    assert fleet.phase_b(OLDEST + 1, heard())[1] == COMMAND


def test_an_answer_of_another_run_is_refused() -> None:
    net = Net()
    fleet = fleet_of(net)
    net.deliver(1, ReplyA(1, 71, 0, RUN + 1, (b"another run",)))
    assert fleet.phase_a(0, sensed(0)) == dict.fromkeys(NAMES, (b"frame",))
    assert net.refused == {"stranger": 1}


def test_a_farewell_of_a_stranger_is_refused() -> None:
    net = Net()
    fleet = fleet_of(net)
    fleet.phase_a(0, sensed(0))
    for head in ((1, 5, 0, RUN), (2, 71, 0, RUN), (1, 71, 0, RUN + 1)):
        net.deliver(1, Farewell(*head))
        net.sessions.take(0.0)
    assert net.refused == {"stranger": 3}
