"""Who speaks for a robot when somebody else wants to, and what the world writes down of both."""

from __future__ import annotations

from typing import Any

import pytest

from patrol.exchange import Reply
from patrol.messages.phases import ANYONE, PROTOCOL, UNLIKE, HelloReply, ReplyA, ReplyB, Report, Stop, encode
from patrol.pose import Velocity
from patrol.security.transcripts import LAST, MAX_TICKS, Line, digest_of
from tests.worldsim.fleet.net import HASH, NAMES, RUN, Net, fleet_of, heard, sensed
from worldsim.fleet.paced import PacedFleet
from worldsim.fleet.sessions import REPORT_S, Missing

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


@pytest.mark.parametrize("other", OTHERS)
def test_at_a_restart_only_the_process_that_was_started_takes_the_seat(other: HelloReply) -> None:
    net = Net(seat=lambda number, incarnation: 100 * number + incarnation if incarnation > 1 else 70 + number)
    fleet = fleet_of(net)
    net.mute = {2}
    net.sessions.expect(2, 2)
    for incarnation in (1, 2):
        net.deliver(2, HelloReply(incarnation, other.instance, 0, RUN, other.scenario, other.protocol))
        net.sessions.take(0.0)
    assert not net.sessions.is_open(2)
    assert net.refused == {"seat": 2}
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


def test_where_a_launcher_has_started_the_processes_a_stranger_does_not_keep_the_run_from_beginning() -> None:
    net = Net(seat=lambda number, _incarnation: 70 + number)
    net.deliver(1, HelloReply(1, 5, 0, RUN, "d" * 64))
    net.deliver(2, HelloReply(1, 5, 0, RUN, HASH))
    net.gather()
    assert net.refused == {"seat": 2}
    with pytest.raises(Missing):
        Net(seat=lambda _number, _incarnation: 5).gather()


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


def test_an_answer_older_than_what_the_transcript_holds_is_refused() -> None:
    """Nobody could tell afterwards whether the robot had sent it."""
    net = Net()
    net.gather()
    fleet = PacedFleet(net.sessions, 0.5)
    net.mute = {1}
    for k in range(MAX_TICKS + 1):
        fleet.phase_a(k, sensed(k))
        fleet.phase_b(k, heard())
    fleet.phase_a(MAX_TICKS + 1, sensed(MAX_TICKS + 1))
    net.deliver(1, ReplyB(1, 71, 1, RUN, COMMAND))
    replies = fleet.phase_b(MAX_TICKS + 1, heard())
    assert (replies[1], net.refused) == (None, {"late": 1})
    net.deliver(1, ReplyB(1, 71, 3, RUN, COMMAND))
    assert fleet.phase_b(MAX_TICKS + 1, heard())[1] == COMMAND


def test_an_answer_of_another_run_is_refused() -> None:
    net = Net()
    fleet = fleet_of(net)
    net.deliver(1, ReplyA(1, 71, 0, RUN + 1, (b"another run",)))
    assert fleet.phase_a(0, sensed(0)) == dict.fromkeys(NAMES, (b"frame",))
    assert net.refused == {"stranger": 1}


def reported(net: Net, number: int) -> None:
    """The robot reports what it has got, and the answers that it gave by itself."""
    lines: dict[int, list[bytes]] = {}
    for to, message in net.sent:
        if to == number and type(message).__name__ in ("PhaseA", "PhaseB"):
            b = type(message).__name__ == "PhaseB"
            line = lines.setdefault(message.k, [b"", b"", b"", b""])
            line[b] = digest_of(encode(message))
            me = (1, 70 + number, message.k, RUN)
            own = Reply(Velocity(float(message.k), 0.0), "patrolling", None, 2.0, 0)
            line[2 + b] = digest_of(encode(ReplyB(*me, own) if b else ReplyA(*me, (b"frame",))))
    report = Report(1, 70 + number, LAST, RUN, 0, tuple(Line(k, (a, b, c, d)) for k, (a, b, c, d) in lines.items()))
    net.deliver(number, report)


def spans(net: Net) -> dict[int, list[list[Any]]]:
    return {note["robot"]: note["spans"] for note in net.sessions.transcripts()}  # type: ignore[misc]


@pytest.mark.parametrize("paced", [False, True])
def test_a_forged_answer_that_the_world_takes_is_in_its_transcript_alone(paced: bool) -> None:
    net = Net()
    fleet = PacedFleet(net.sessions, 0.5) if paced else None
    if fleet is None:
        fleet = fleet_of(net)  # type: ignore[assignment]
    else:
        net.gather()
    assert fleet is not None
    for k in range(4):
        fleet.phase_a(k, sensed(k))
        if k == 2:
            net.letters.clear()
            net.delays[1, k, "B"] = 0.2
            net.deliver(1, ReplyB(1, 71, k, RUN, COMMAND))
        replies = fleet.phase_b(k, heard())
        if k == 2 and not paced:
            assert replies[1] == COMMAND
    for number in NAMES:
        reported(net, number)
    fleet.finish(4)
    for number, found in spans(net).items():
        (span,) = found
        assert span[:2] == [0, 3]
        assert span[2] == span[3]
        assert (span[4] == span[5]) == (number != 1)


def test_a_report_of_a_stranger_is_refused() -> None:
    net = Net()
    fleet = fleet_of(net)
    fleet.phase_a(0, sensed(0))
    for head in ((1, 5, 0, RUN), (2, 71, 0, RUN), (1, 71, 0, RUN + 1)):
        net.deliver(1, Report(*head, 0, ()))
        net.sessions.take(0.0)
    assert net.refused == {"stranger": 3}


def test_the_world_waits_a_little_for_the_last_reports_and_no_longer() -> None:
    net = Net()
    fleet = fleet_of(net)
    fleet.phase_a(0, sensed(0))
    for number in NAMES:
        net.deliver(number, Report(1, 70 + number, LAST, RUN, 0, ()), 0.2)
    fleet.finish(1)
    assert [len(found) for found in spans(net).values()] == [1, 1, 1]
    assert not net.letters

    net = Net()
    fleet = fleet_of(net)
    began = net.time
    fleet.finish(1)
    assert REPORT_S <= net.time - began < REPORT_S + 1.0
