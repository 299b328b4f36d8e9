"""A fleet that is flooded ends all the same, when it is told to."""

from __future__ import annotations

import signal

import pytest

from patrol.messages.feed import FOG
from tests.hostile.conftest import Attack

pytestmark = pytest.mark.processes


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
