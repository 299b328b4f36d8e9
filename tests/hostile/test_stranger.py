"""A stranger beside a real fleet: what the door lets through, and single attacks at full length."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from patrol.random import Draws, Purpose
from patrol.scenario import load_scenario
from runtime.net.link import open_link
from runtime.security.keys import fleet_keys
from runtime.security.roles import VIEWER
from tests.fleets import COARSE
from tests.hostile.strangers.door import CONNECTIONS, LET_IN, Door, begin_well, knock, send_noise
from tests.hostile.strangers.judge import problems
from tests.hostile.strangers.member import ASKED, OVERHEARD, Member
from tests.hostile.strangers.run import run_spell
from tests.hostile.strangers.spell import Holds, draw_spell
from tests.routers import PATIENCE_S, guarded_by_passwords, routed

ROBOTS = ("r1", "r2", "r3")
FLEET = [{"name": name, "model": "holonomic"} for name in ROBOTS]
SHORT: dict[str, object] = {**COARSE, "name": "attacked", "duration": 150, "robots": FLEET}


def dice() -> Draws:
    return Draws(1, Purpose.STRANGER)


def test_a_locked_door_stays_shut_and_open() -> None:
    """Shut for strangers, and open for members while strangers knock."""
    with guarded_by_passwords(ROBOTS) as at:
        door = Door(at.router, at.keys, ROBOTS)
        assert knock(door, dice()) == {"asked to be let in": 3}
        assert send_noise(door, dice())["connections"] == CONNECTIONS
        assert begin_well(door, dice())["connections"] == CONNECTIONS
        link = open_link(at.router, PATIENCE_S, credentials=at.credentials["robot-r1"])
        assert link.connected
        assert link.close(PATIENCE_S)


def test_an_open_door_is_noticed() -> None:
    with routed() as router:
        assert knock(Door(router, fleet_keys("f"), ROBOTS), dice())[LET_IN] >= 1


def test_what_a_viewer_should_not_get_is_noticed() -> None:
    """At a router that keeps nothing back; another session stands for the fleet."""
    keys = fleet_keys("f")
    with routed() as router:
        door = Door(router, keys, ROBOTS)
        session = door.enter(None, PATIENCE_S)
        assert session is not None
        fleet = open_link(router, PATIENCE_S)
        member = Member(door, VIEWER, session)
        reply = fleet.post(keys.reply("r1"))
        counts = _while(lambda: member.listen(dice()), lambda: reply(b"secret"))
        assert counts[OVERHEARD] > 0
        counts = _while(lambda: member.answer_everything(dice()), lambda: fleet.ask(keys.control("ask"), b"", 0.5))
        assert counts[ASKED] > 0
        assert fleet.close(PATIENCE_S)
        session.close()  # type: ignore[no-untyped-call]


def _while(attack: Callable[[], Mapping[str, int]], work: Callable[[], object]) -> Mapping[str, int]:
    """Do something over and over while an attack goes on."""
    found: list[Mapping[str, int]] = []
    attacking = threading.Thread(target=lambda: found.append(attack()))
    attacking.start()
    while attacking.is_alive():
        work()
        attacking.join(0.02)
    return found[0]


@pytest.mark.processes
@pytest.mark.parametrize(
    ("holds", "only"),
    [
        (Holds.NOTHING, "silent connections"),
        pytest.param(Holds.VIEWER, "stopped readers", marks=pytest.mark.accept),
        pytest.param(Holds.VIEWER, "floods", marks=pytest.mark.accept),
        pytest.param(Holds.VIEWER, "huge messages", marks=pytest.mark.accept),
        (Holds.ROBOT, "floods"),
    ],
)
def test_one_attack_over_and_over_changes_nothing(holds: Holds, only: str, tmp_path: Path) -> None:
    """The trace of a run in lockstep is that without the attack."""
    spell = replace(draw_spell(1), holds=holds, victim="r2", page=False, scenario=load_scenario(SHORT), only=(only,))
    seen, attacks = run_spell(spell, tmp_path / "spell", lambda: False)
    assert problems(spell, seen) == [], (seen, attacks)
    assert seen.ticks == 300
    assert set(attacks) == {only}
    assert seen.honest
    assert seen.trace == seen.honest


@pytest.mark.processes
def test_an_interruption_ends_everybody_and_leaves_nothing(tmp_path: Path) -> None:
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    environment = {**os.environ, "TMPDIR": str(tmp_path), "XDG_RUNTIME_DIR": str(runtime)}
    command = [sys.executable, "-P", "-m", "tests.hostile.strangers", "--seed", "12", "--out"]
    begun = subprocess.Popen(
        [*command, str(tmp_path / "out")], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + PATIENCE_S
    while not (logs := [log for log in tmp_path.glob("fogwatch-hostile-*/*/stranger.log") if log.stat().st_size]):
        assert begun.poll() is None, begun.communicate()
        assert time.monotonic() < end, "the stranger does not begin"
        time.sleep(0.05)
    begun.send_signal(signal.SIGINT)
    output, errors = begun.communicate(timeout=PATIENCE_S)
    assert begun.returncode == 130, errors
    assert "Traceback" not in errors
    assert output.splitlines()[-1].startswith("0 spells, 0 attacks: none has run")
    assert not logs[0].exists()
    assert not list(tmp_path.glob("fogwatch-hostile-*"))
    assert not (tmp_path / "out").exists()
    assert list(runtime.iterdir()) == [runtime / "fogwatch"], "the secrets were there"
    assert not list((runtime / "fogwatch").iterdir())
