"""Sessions, lockstep and pace against scripted robots and a clock of the test's own."""

import itertools
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.exchange import Reply, Sensed
from patrol.journal import Status
from patrol.pose import Pose, Velocity
from runtime.messages.phases import (
    ANYONE,
    NO_RUN,
    PROTOCOL,
    UNLIKE,
    Farewell,
    Hello,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
)
from runtime.messages.session import GRACE_S, RETURN_S
from runtime.process.deadline import ANSWER_S
from tests.worldsim.fleet.net import HASH, NAMES, RUN, Net, heard, lockstep, paced, sensed, tick
from worldsim.fleet.sessions import Interrupted, Missing

# Not the product's own, so that a wrong one there is noticed.
DISMISSAL_S = 10.0
RECOVERY_S = 5.0

# --- gathering -------------------------------------------------------------------------------------------------------


def test_robots_are_greeted_when_they_come() -> None:
    net = Net()
    for number, after_s in ((3, 0.0), (1, 4.0), (2, 8.0)):
        net.presence(number, True, after_s)
    waited: list[list[str]] = []
    net.sessions.gather(60.0, lambda names, _s: waited.append(names))
    assert waited == [["r2"]]
    assert [number for number, message in net.sent if isinstance(message, Hello)] == [3, 1, 2]
    assert all(message.instance == ANYONE for _, message in net.sent)


def test_who_does_not_come_is_named() -> None:
    net = Net()
    net.presence(1, True)
    with pytest.raises(Missing, match="no process came for r2, r3 within 10 s"):
        net.sessions.gather(10.0, lambda _names, _s: None)


def test_a_hello_is_repeated_to_those_who_are_there() -> None:
    net = Net()
    net.mute = {2}
    for number in NAMES:
        net.presence(number, True)
    with pytest.raises(Missing, match="r2"):
        net.sessions.gather(5.0, lambda _names, _s: None)
    assert 4 <= len(net.told(Hello, 2)) <= 8
    assert len(net.told(Hello, 1)) == 1


@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        (HelloReply(1, 5, 0, RUN, "d" * 64), "scenario (hash dddddddddddd, the world's is cccccccccccc); give all"),
        (HelloReply(1, 5, 0, RUN, HASH, PROTOCOL + 1), f"protocol ({PROTOCOL + 1}, the world's is {PROTOCOL}); run"),
    ],
)
def test_a_robot_that_means_something_else_is_bad_input_and_all_are_told(reply: HelloReply, problem: str) -> None:
    net = Net()
    net.presence(2, True)
    net.presence(1, True)
    net.mute = {1}
    net.deliver(1, reply, 1.0)
    began = net.time
    with pytest.raises(BadInput) as caught:
        net.sessions.gather(60.0, lambda _names, _s: None)
    assert str(caught.value).startswith(f"r1 was started with another {problem}")
    assert net.time - began < DISMISSAL_S + 2.0
    (stop,) = net.told(Stop, 1)
    assert (stop.incarnation, stop.instance, stop.orderly) == (1, 5, False)
    assert stop.reason.startswith(f"{UNLIKE}{problem}")
    (other,) = net.told(Stop, 2)
    assert other.reason.startswith("the run cannot begin: r1 was started with another")


def test_an_answer_to_another_world_takes_no_seat() -> None:
    net = Net()
    net.deliver(1, HelloReply(1, 5, 0, RUN + 1, HASH))
    with pytest.raises(Missing):
        net.sessions.gather(1.0, lambda _names, _s: None)
    assert net.refused["stranger"] == 1


def test_who_asks_for_a_greeting_gets_one_or_is_turned_away() -> None:
    net = Net()
    net.deliver(1, HelloReply(1, 71, 0, NO_RUN, HASH))
    net.sessions.take(0.0)
    assert len(net.told(Hello, 1)) == 1
    net.gather()
    net.deliver(1, HelloReply(1, 99, 0, NO_RUN, HASH))
    net.sessions.take(0.0)
    (stop,) = net.told(Stop, 1)
    assert (stop.instance, stop.orderly) == (99, False)
    assert "r1 already" in stop.reason


# --- lockstep --------------------------------------------------------------------------------------------------------


def test_a_tick_takes_everybodys_answers() -> None:
    net, fleet = lockstep()
    assert fleet.phase_a(0, sensed(0)) == dict.fromkeys(NAMES, (b"frame",))
    replies = fleet.phase_b(0, heard())
    assert list(replies) == [1, 2, 3]
    assert fleet.lost() == []
    assert net.told(PhaseA, 2) == [PhaseA(1, 72, 0, RUN, Sensed(0, Pose(2.0, 0.0, 0.0)))]
    assert net.told(PhaseB, 2) == [PhaseB(1, 72, 0, RUN, (b"x",))]


def test_answers_of_other_ticks_phases_and_processes_do_not_count() -> None:
    net, fleet = lockstep()
    net.mute = {1}
    net.deliver(1, ReplyA(1, 71, 4, RUN, (b"old",)))
    net.deliver(1, ReplyA(1, 99, 5, RUN, (b"stranger",)))
    net.deliver(1, ReplyA(2, 71, 5, RUN, (b"other incarnation",)))
    net.deliver(1, ReplyA(1, 71, 5, RUN + 1, (b"other run",)))
    net.deliver(1, ReplyB(1, 71, 5, RUN, Reply(Velocity(0.0, 0.0), "patrolling", None, 1.0, 0)))
    net.deliver(1, ReplyA(1, 71, 5, RUN, (b"mine",)), 0.5)
    assert fleet.phase_a(5, sensed(5)) == {1: (b"mine",), 2: (b"frame",), 3: (b"frame",)}
    assert net.refused["stranger"] == 3


def test_whoever_has_not_answered_is_asked_again() -> None:
    net, fleet = lockstep()
    net.delays[2, 1, "B"] = 3.5
    fleet.phase_b(1, heard())
    assert [len(net.told(PhaseB, number)) for number in NAMES] == [1, 2, 1]  # the second was answered at once


def test_a_pause_below_the_deadline_only_takes_time() -> None:
    net, fleet = lockstep()
    net.mute = {2}
    net.deliver(2, ReplyA(1, 72, 3, RUN, (b"late",)), 9.0)
    assert fleet.phase_a(3, sensed(3))[2] == (b"late",)
    assert [len(net.told(PhaseA, number)) for number in NAMES] == [1, 9, 1]
    assert fleet.lost() == []


def test_who_misses_the_deadline_is_lost_and_told_so_whenever_it_asks() -> None:
    net, fleet = lockstep(5.0)
    net.mute = {2}
    began = net.time
    assert list(fleet.phase_a(3, sensed(3))) == [1, 3]
    assert 5.0 <= net.time - began < 6.0
    assert list(fleet.phase_b(3, heard((1, 3)))) == [1, 3]
    assert fleet.lost() == [(2, Status.LOST, "no answer in phase A of tick 3 for 5 s")]
    assert fleet.lost() == []
    net.deliver(2, HelloReply(1, 72, 3, RUN, HASH))
    fleet.phase_a(4, sensed(4, (1, 3)))
    stops = net.told(Stop, 2)
    assert [stop.reason for stop in stops] == ["left out: no answer in phase A of tick 3 for 5 s"] * 2


def test_the_first_tick_may_take_longer() -> None:
    net, fleet = lockstep(5.0)
    net.mute = {2}
    net.deliver(2, ReplyA(1, 72, 0, RUN, (b"slow start",)), 30.0)
    assert fleet.phase_a(0, sensed(0))[2] == (b"slow start",)


def test_a_pause_of_the_world_itself_is_nobodys_death() -> None:
    net, fleet = lockstep(5.0)
    net.mute = {2}
    get = net.get

    def get_after_a_long_sleep(timeout_s: float = 0.0) -> tuple[str, Any] | None:
        net.time += 3600.0 + 0.0 * timeout_s
        net.get = get  # type: ignore[method-assign]
        return None

    net.get = get_after_a_long_sleep  # type: ignore[method-assign]
    net.deliver(2, ReplyA(1, 72, 3, RUN, (b"here",)), 3601.0)
    assert fleet.phase_a(3, sensed(3))[2] == (b"here",)


@pytest.mark.parametrize(("how", "after_s"), [("ended", GRACE_S), ("said farewell", GRACE_S), ("unknown", RETURN_S)])
def test_a_process_that_is_gone_ends_the_wait_early(how: str, after_s: float) -> None:
    net, fleet = lockstep(ANSWER_S, launched=how == "ended")
    net.mute = {2}
    net.ended |= {2}
    if how == "said farewell":
        net.deliver(2, Farewell(1, 72, 0, RUN))
    net.presence(2, False)
    began = net.time
    assert list(fleet.phase_a(3, sensed(3))) == [1, 3]
    assert after_s <= net.time - began < after_s + 1.0
    assert fleet.lost() == [(2, Status.LOST, "its process was gone in phase A of tick 3")]


@pytest.mark.parametrize(("launched", "away_s"), [(True, ANSWER_S - 1.0), (False, RETURN_S - 1.0)])
def test_a_process_that_lost_its_connection_may_come_back(launched: bool, away_s: float) -> None:
    net, fleet = lockstep(ANSWER_S, launched=launched)
    net.mute = {2}
    net.presence(2, False)
    net.presence(2, True, away_s)
    net.deliver(2, ReplyA(1, 72, 3, RUN, (b"back",)), away_s)
    assert fleet.phase_a(3, sensed(3))[2] == (b"back",)
    assert fleet.lost() == []


def test_tokens_that_go_with_the_router_come_back() -> None:
    net, fleet = lockstep()
    net.mute = {1, 2, 3}
    net.connected = False
    for number in NAMES:
        net.presence(number, False)
        net.presence(number, True, 4.0)
        net.deliver(number, ReplyA(1, 70 + number, 3, RUN, (b"back",)), 4.5)
    assert fleet.phase_a(3, sensed(3)) == dict.fromkeys(NAMES, (b"back",))
    assert fleet.lost() == []


def test_who_does_not_find_back_to_the_router_is_lost() -> None:
    net, fleet = lockstep(60.0)
    net.mute = {2}
    net.connected = False
    net.presence(2, False)
    net.sessions.take(0.0)
    assert net.sessions.gone([1, 2]) == []
    net.connected = True
    began = net.time
    assert list(fleet.phase_a(3, sensed(3))) == [1, 3]
    assert net.time - began >= RECOVERY_S - 1.0


def test_an_interrupted_world_stops_waiting() -> None:
    net, fleet = lockstep()
    net.mute = {2}
    net.ending = True
    with pytest.raises(Interrupted):
        fleet.phase_a(3, sensed(3))


def test_at_the_end_everybody_is_sent_home() -> None:
    net, fleet = lockstep()
    fleet.finish(7)
    for number in NAMES:
        assert net.told(Stop, number) == [Stop(1, 70 + number, 7, RUN, True, "the run is over")]


@pytest.mark.parametrize("interrupted", [False, True])
def test_the_end_does_not_wait_for_ever(interrupted: bool) -> None:
    net, fleet = lockstep()
    net.mute = {1, 2, 3}
    net.ending = interrupted
    began = net.time
    fleet.finish(7)
    assert DISMISSAL_S <= net.time - began < DISMISSAL_S + 1.0
    assert len(net.told(Stop, 1)) >= 10


# --- at a pace -------------------------------------------------------------------------------------------------------


def test_the_world_keeps_to_the_clock() -> None:
    net, fleet = paced()
    began = net.time
    net.delays = {(3, k, "A"): 0.03 * (k + 1) for k in range(3)}
    for k in range(4):
        assert fleet.phase_a(k, sensed(k)) == dict.fromkeys(NAMES, (b"frame",))
        assert net.time - began == pytest.approx(0.5 * k + (0.03 * (k + 1) if k < 3 else 0.001))  # all are there
        replies = fleet.phase_b(k, heard())
        assert net.time - began == pytest.approx(0.5 * (k + 1))
        assert all(reply is not None and reply.command == Velocity(float(k), 0.0) for reply in replies.values())
    on_time = {"slipped_s": 0.0, "held_up_s": 0.0, "longest_held_up_s": 0.0}
    assert fleet.notes() == {"late_frames": {}, "too_late": {}, "late_commands": {}, **on_time}


def test_late_frames_are_lost_and_late_commands_count_where_they_come() -> None:
    net, fleet = paced()
    net.delays = {(1, 0, "A"): 0.2, (2, 0, "B"): 0.6, (3, 0, "B"): 0.45, (3, 1, "B"): 0.1}
    assert fleet.phase_a(0, sensed(0)) == {1: (), 2: (b"frame",), 3: (b"frame",)}
    first = fleet.phase_b(0, heard())
    assert first[1] is not None
    assert (first[2], first[3]) == (None, None)
    net.mute = {2}
    second = tick(fleet, 1)
    assert second[2] is not None
    assert second[2].command == Velocity(0.0, 0.0)  # of tick 0
    assert second[3] is not None
    assert second[3].command == Velocity(1.0, 0.0)  # its own beats the late one
    assert fleet.lost() == []
    notes = fleet.notes()
    assert notes["late_frames"] == {1: 1, 2: 1}
    assert notes["too_late"] == {1: 1}
    assert notes["late_commands"] == {2: 2, 3: 1}


def test_a_world_that_falls_behind_gives_up_on_catching_up() -> None:
    net, fleet = paced()
    tick(fleet, 0)
    net.time += 5.0
    began = net.time
    tick(fleet, 1)
    assert net.time - began == pytest.approx(0.5)
    assert fleet.slipped_s == pytest.approx(5.0)


@pytest.mark.parametrize("launched", [False, True])
@pytest.mark.parametrize("away_s", [RETURN_S - 1.0, RETURN_S + 1.0])
def test_at_a_pace_a_robot_that_was_cut_off_may_take_longer_to_connect_again(launched: bool, away_s: float) -> None:
    net, fleet = paced(launched=launched)
    ticks = itertools.count()

    def patrol(seconds: float) -> list[int]:
        lost: list[int] = []
        for k in itertools.islice(ticks, round(seconds / 0.5)):
            tick(fleet, k)
            lost += [number for number, _, _ in fleet.lost()]
        return lost

    assert patrol(2.0) == []
    net.mute = {2}
    net.presence(2, False)
    returns = away_s < RETURN_S or launched
    assert (2 in patrol(away_s)) is not returns
    net.mute = set()
    net.presence(2, True)
    if returns:
        assert patrol(RETURN_S) == []


def test_at_a_pace_only_a_lost_token_loses_a_robot() -> None:
    net, fleet = paced()
    net.mute = {1, 2}
    net.presence(2, False)
    for k in range(30):
        tick(fleet, k)
    assert fleet.lost() == [(2, Status.LOST, "its process was gone")]
