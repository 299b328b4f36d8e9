"""Fleets that are attacked by a member of their network while they run: none is disturbed, and each ends."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from typing import Any

import pytest

from runtime.messages.feed import FOG
from runtime.messages.phases import ANYONE, HelloReply, PhaseB, Stop, encode
from runtime.security.control_auth import ASK, CHALLENGE, NONCE
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


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.accept)])
def test_a_flood_under_every_key_keeps_no_fleet_from_ending(number: signal.Signals, attack: Attack) -> None:
    target = attack({"duration": 100_000, "robots": [{"name": "r1"}, {"name": "r2"}]})
    keys = target.keys
    everything = (keys.reply("r1"), keys.tick("r1"), keys.tick("r2"), keys.truth(FOG), keys.position("r2"))
    target.attacker.repeat([(key, b"\x93" + bytes(400)) for key in everything])
    target.step(20)
    target.go()
    children = target.run.children()
    assert {"r1", "r2", "worldsim", "fogwatch.router"} <= set(children)
    target.run.process.send_signal(number)
    assert target.run.end() == 130, target.run.errors
    assert not target.run.children()
    assert target.run.summary()["ended"] == "interrupted"
    assert "Traceback" not in target.run.errors
    assert not [log.name for log in (target.run.folder / "logs").iterdir() if "Traceback" in log.read_text("utf-8")]


LINE = {"done": True, "text": "\x1b[2J\x1b]0;owned\x07paused before tick 7\u202e"}
ANSWERS = [
    json.dumps(LINE).encode(),
    json.dumps({"done": "yes", "text": 7}).encode(),
    bytes(32) + json.dumps(LINE).encode(),
    b"",
    b"[" * 50_000,
    b"\xff" * 64,
    bytes(5_000_000),
]
WARNING = "somebody who does not know the token has answered as well; that was ignored"
STRANGER = "somebody answered who does not know the token"


def control(target: Target, *words: str) -> subprocess.CompletedProcess[str]:
    """``fogwatch control`` on the run, as its operator types it."""
    command = [sys.executable, "-P", "-m", "fogwatch", "control", str(target.run.folder), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def shown(done: subprocess.CompletedProcess[str]) -> str:
    """What the operator's terminal gets: plain lines, and no traceback."""
    text = done.stdout + done.stderr
    assert all(line.isprintable() for line in text.splitlines()), text
    assert "Traceback" not in text
    return text


def test_neither_the_token_nor_a_control_is_had_by_listening_and_answering(attack: Attack) -> None:
    target = attack({"duration": 100_000, "robots": 2 * [{}]})
    target.step(3)
    attacker = target.attacker
    attacker.answer_everything(ANSWERS)
    done = control(target, "step", "2")
    assert done.returncode == 0, shown(done)
    assert shown(done).startswith("paused before tick ")
    assert done.stderr in ("", f"fogwatch: {WARNING}\n")  # whether they came before the world's
    held = int(done.stdout.split()[-1])
    target.run.until(lambda: target.run.ticks() == held)

    keys = {target.keys.control(what) for what in (CHALLENGE, ASK)}
    target.run.until(lambda: keys <= {key for key, _ in attacker.asked})
    overheard = [(key, payload) for key, payload in attacker.asked if key in keys]
    everything = [*attacker.asked, *attacker.heard]
    assert not any(target.access.token.encode() in payload for _, payload in everything)

    for _ in range(3):  # the same requests again, and with each of their parts altered
        for key, payload in overheard:
            attacker.ask(key, payload)
    request = next(payload for key, payload in overheard if key == target.keys.control(ASK))
    for place in (0, 32, 40, 40 + NONCE, 64 + NONCE, len(request) - 1):
        altered = bytearray(request)
        altered[place] ^= 1
        given = attacker.ask(target.keys.control(ASK), bytes(altered))
        assert all(answer in ANSWERS for answer in given)  # the world gives none
    assert target.run.ticks() == held
    done = control(target, "step", "1")
    assert done.stdout == f"paused before tick {held + 1}\n", shown(done)
    target.run.interrupt()


def test_an_impostor_in_the_worlds_place_is_named_in_one_line(attack: Attack) -> None:
    target = attack({"duration": 100_000, "robots": 2 * [{}]})
    target.attacker.answer_everything(ANSWERS)
    world = target.run.children()["worldsim"]
    os.kill(world, signal.SIGSTOP)
    try:
        done = control(target, "pause", "--wait", "3")
    finally:
        os.kill(world, signal.SIGCONT)
    assert done.returncode == 3
    assert STRANGER in shown(done)
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    target.run.interrupt()
