"""Somebody answers every question on the network and keeps what is asked: the token is not in it, nor any power."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import pytest

from patrol.security.control_auth import ASK, CHALLENGE, NONCE
from tests.hostile.conftest import Attack, Target

pytestmark = pytest.mark.processes

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
