"""Messages that somebody puts in between the world and its robots: refused where that can be seen, else found later."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import Status, read_journal
from patrol.messages.phases import (
    ANYONE,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    decode_to_robot,
    encode,
)
from patrol.pose import Velocity

if TYPE_CHECKING:
    from tests.hostile.conftest import Target

pytestmark = pytest.mark.processes

LEAP = 10**6
CALM: dict[str, Any] = {"duration": 100_000, "robots": 3 * [{"model": "holonomic"}]}


def same_as_without(target: Target) -> None:
    """The run goes on, is valid, and has the trace that it has when nobody is there."""
    target.run.pass_ticks(60)
    target.run.interrupt()
    target.run.assert_undisturbed()


def leaps(target: Target, robot: str) -> list[tuple[str, bytes]]:
    """Ticks far ahead for a robot, with the newest proof that there is."""
    key, a = target.keys.tick(robot), target.attacker.newest_phase_a(robot)
    forged = [replace(a, k=a.k + leap, sensed=replace(a.sensed, k=a.k + leap)) for leap in (1, 7, LEAP)]
    forged += [replace(one, proof=bytes(16)) for one in forged]
    ahead = [PhaseB(a.incarnation, a.instance, a.k + leap, a.run, (b"forged",), a.proof) for leap in (1, 9, LEAP)]
    return [(key, encode(message)) for message in forged] + [(key, encode(message)) for message in ahead]


def test_ticks_far_ahead_change_nothing_in_lockstep(attack: Callable[..., Target]) -> None:
    target = attack(CALM)
    target.step(5)
    for key, payload in leaps(target, "r1"):
        target.attacker.send(key, payload)
    target.attacker.repeat(leaps(target, "r2"))
    target.go()
    same_as_without(target)
    assert target.run.summary()["robots"]["r1"]["rejected"] >= 9
    assert target.check("transcripts")["ok"]


def test_a_robot_that_the_router_cuts_off_because_it_does_not_read_is_not_lost(attack: Callable[..., Target]) -> None:
    target = attack(CALM)
    k = target.step(5)
    r2 = target.run.children()["r2"]
    flood = leaps(target, "r2")
    os.kill(r2, signal.SIGSTOP)
    enough = target.attacker.repeat(flood)
    target.run.until(lambda: not target.attacker.sees("r2"))
    enough()
    target.begin(1)
    target.run.until(lambda: target.attacker.phases_a("r2", k) >= 3)  # the world has waited, and asked again twice
    os.kill(r2, signal.SIGCONT)
    target.go()
    same_as_without(target)


def test_ticks_far_ahead_deafen_nobody_at_a_pace(attack: Callable[..., Target]) -> None:
    target = attack({**CALM, "duration": 100_000, "pace": 20})
    held = target.step(5)
    for key, payload in leaps(target, "r1"):
        target.attacker.send(key, payload)
    target.go()

    def decided() -> int:
        """In how many ticks since then a command of the robot has come."""
        ticks = list(read_journal(target.run.folder / "journal").ticks)[held:]
        return sum(tick.robots[0].decision_ms is not None for tick in ticks)

    target.run.until(lambda: decided() >= 10)
    target.run.interrupt()
    assert target.run.summary()["verdict"]["outcome"] == "valid", target.run.summary()["verdict"]


def test_nobody_leaves_because_a_stranger_says_so(attack: Callable[..., Target]) -> None:
    target = attack(CALM)
    target.step(5)
    a = target.attacker.newest_phase_a("r1")
    key = target.keys.tick("r1")
    for incarnation, instance, run in (
        (1, ANYONE, a.run),
        (0, ANYONE, a.run),
        (1, ANYONE, 0),
        (1, a.instance, 0),
        (1, a.instance, a.run + 1),
        (2, a.instance, a.run),
    ):
        target.attacker.send(key, encode(Stop(incarnation, instance, a.k, run, orderly=True, reason="go home")))
    target.go()
    same_as_without(target)
    assert target.run.summary()["robots"]["r1"]["rejected"] >= 6


def test_a_stranger_does_not_take_the_seat_of_a_robot_that_is_started_again(attack: Callable[..., Target]) -> None:
    """Nor end the run: it answers the world's greeting long before the robot's own process can."""
    faults = [{"kind": "kill", "who": "r2", "at": 10}, {"kind": "restart", "who": "r2", "at": 15}]
    target = attack({**CALM, "faults": faults})
    target.step(5)
    run = target.attacker.newest_phase_a("r1").run
    seats: list[HelloReply] = []
    for hashed in (target.scenario_hash(), "d" * 64):
        seats += [HelloReply(number, instance, 30, run, hashed) for number in (1, 2) for instance in (77, ANYONE)]
        seats += [replace(seats[-2], protocol=99), replace(seats[-2], run=0)]
    target.attacker.pretend_to_live("r2")
    target.attacker.repeat([(target.keys.reply("r2"), encode(seat)) for seat in seats])
    target.go()
    same_as_without(target)
    assert target.refused()["seat"] >= 1
    assert target.run.summary()["exit_codes"]["r2 (2)"] == 0


def test_a_stranger_does_not_take_the_seat_of_a_robot_that_lives(attack: Callable[..., Target]) -> None:
    target = attack(CALM)
    target.step(5)
    run = target.attacker.newest_phase_a("r1").run
    for hashed in (target.scenario_hash(), "d" * 64):
        target.attacker.send(target.keys.reply("r1"), encode(HelloReply(1, 77, 5, run, hashed)))
    target.go()
    same_as_without(target)
    assert target.refused()["seat"] == 2


def test_commands_that_a_robot_has_not_sent_fail_the_verdict(attack: Callable[..., Target]) -> None:
    """Its process stands still meanwhile, so that the stranger is always first."""
    target = attack(CALM)
    first = target.step(20)
    r1 = target.run.children()["r1"]
    os.kill(r1, signal.SIGSTOP)
    drive = Velocity(0.125, -0.125)

    def forge(key: str, payload: bytes) -> None:
        if key != target.keys.tick("r1"):
            return
        match decode_to_robot(payload):
            case PhaseA(incarnation, instance, k, run):
                answer: ReplyA | ReplyB = ReplyA(incarnation, instance, k, run, ())
            case PhaseB(incarnation, instance, k, run):
                reply = replace(target.attacker.newest_reply_b("r1").reply, command=drive)
                answer = ReplyB(incarnation, instance, k, run, reply)
            case _:
                return
        target.attacker.send(target.keys.reply("r1"), encode(answer))

    target.attacker.newest_reply_b("r1")
    target.attacker.listen(forge)
    held = target.step(3)
    target.attacker.close()
    os.kill(r1, signal.SIGCONT)
    target.go()
    target.run.pass_ticks(20)
    target.run.interrupt()
    robots = [tick.robots[0] for tick in read_journal(target.run.folder / "journal").ticks]
    assert {(robot.c0, robot.c1) for robot in robots[first:held]} == {(drive.vx, drive.vy)}
    assert robots[-1].status is Status.ALIVE
    assert any(robot.decision_ms is not None for robot in robots[held:]), "it does not go on"
    check = target.check("transcripts")
    assert not check["ok"]
    assert "the world acted on replies that the robot had not sent" in check["detail"]
    assert covered(check["detail"], "r1", first, held - 1)
    assert "r2" not in check["detail"]


def test_what_a_robot_hears_that_the_world_has_not_sent_fails_the_verdict(attack: Callable[..., Target]) -> None:
    """Another robot stands still, so that the world has not begun phase B."""
    target = attack(CALM)
    first = target.step(20)
    r2 = target.run.children()["r2"]
    os.kill(r2, signal.SIGSTOP)
    held = target.begin(1)
    target.run.until(lambda: target.attacker.newest_phase_a("r1").k == first)
    a = target.attacker.newest_phase_a("r1")
    forged = PhaseB(a.incarnation, a.instance, a.k, a.run, (b"forged",), a.proof)
    target.attacker.send(target.keys.tick("r1"), encode(forged))
    target.run.until(lambda: target.attacker.newest_reply_b("r1").k == first)
    os.kill(r2, signal.SIGCONT)
    target.run.until(lambda: target.run.ticks() == held)
    target.go()
    target.run.pass_ticks(20)
    target.run.interrupt()
    check = target.check("transcripts")
    assert not check["ok"]
    assert "the robot acted on phases that the world had not sent" in check["detail"]
    assert covered(check["detail"], "r1", first, first)


def covered(detail: str, robot: str, first: int, last: int) -> bool:
    """Whether a detail names a robot with a range of ticks around these, and no more than a few reports long."""
    for part in detail.split("; "):
        name, _, rest = part.partition(": in ticks ")
        begin, _, end = rest.partition(" the ")[0].partition(" to ")
        if name == robot and int(begin) <= first and last <= int(end):
            return int(end) - int(begin) < 64
    return False
