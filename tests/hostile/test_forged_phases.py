"""Messages that somebody puts in between the world and its robots, of another process or run."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from typing import Any

import pytest

from patrol.messages.phases import ANYONE, HelloReply, PhaseB, Stop, encode
from tests.hostile.conftest import Attack, Target

pytestmark = pytest.mark.processes

CALM: dict[str, Any] = {"duration": 100_000, "robots": 3 * [{"model": "holonomic"}]}


def same_as_without(target: Target) -> None:
    """The run goes on, is valid, and has the trace that it has when nobody is there."""
    target.run.pass_ticks(60)
    target.run.interrupt()
    target.run.assert_undisturbed()


def of_another_run(target: Target, robot: str) -> list[tuple[str, bytes]]:
    """Ticks far ahead for a robot, of a run that is not its own."""
    key, a = target.keys.tick(robot), target.attacker.newest_phase_a(robot)
    ks = [a.k + leap for leap in (1, 7, 10**6)]
    phases = [encode(replace(a, k=k, run=a.run + 1, sensed=replace(a.sensed, k=k))) for k in ks]
    phases += [encode(PhaseB(a.incarnation, a.instance, k, a.run + 1, (b"forged",))) for k in ks]
    return [(key, phase) for phase in phases]


def test_a_robot_that_the_router_cuts_off_because_it_does_not_read_is_not_lost(attack: Attack) -> None:
    target = attack(CALM)
    k = target.step(5)
    r2 = target.run.children()["r2"]
    flood = of_another_run(target, "r2")
    os.kill(r2, signal.SIGSTOP)
    enough = target.attacker.repeat(flood)
    target.run.until(lambda: not target.attacker.sees("r2"))
    enough()
    target.begin(1)
    target.run.until(lambda: target.attacker.phases_a("r2", k) >= 3)  # the world has waited, and asked again twice
    os.kill(r2, signal.SIGCONT)
    target.go()
    same_as_without(target)


def test_nobody_leaves_because_a_stranger_says_so(attack: Attack) -> None:
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


def test_a_stranger_does_not_take_the_seat_of_a_robot_that_lives(attack: Attack) -> None:
    target = attack(CALM)
    target.step(5)
    run = target.attacker.newest_phase_a("r1").run
    for hashed in (target.scenario_hash(), "d" * 64):
        target.attacker.send(target.keys.reply("r1"), encode(HelloReply(1, 77, 5, run, hashed)))
    target.go()
    same_as_without(target)
    assert target.refused()["seat"] == 2
