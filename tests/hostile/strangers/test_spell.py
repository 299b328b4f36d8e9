"""Spells follow from their seeds, and what strangers send is what it claims to be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from patrol.exchange import Sensed
from patrol.messages.phases import (
    Failed,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    decode_to_robot,
    decode_to_world,
    encode,
)
from patrol.pose import Pose
from patrol.random import Draws, Purpose
from patrol.scenario import as_mapping
from patrol.security.keys import fleet_keys
from patrol.security.roles import VIEWER
from tests.hostile.strangers.payloads import all_keys, changed, forged, forged_farewell, noise
from tests.hostile.strangers.spell import Holds, draw_spell, role_of_stranger

KEYS = fleet_keys("f")
ROBOTS = ("r1", "r2")


def test_a_seed_draws_the_same_spell_again() -> None:
    one, again = draw_spell(7), draw_spell(7)
    assert (one.holds, one.victim, one.page) == (again.holds, again.victim, again.page)
    assert as_mapping(one.scenario) == as_mapping(again.scenario)


def test_all_sorts_of_spells_are_drawn() -> None:
    spells = [draw_spell(seed) for seed in range(60)]
    assert {spell.holds for spell in spells} == set(Holds)
    assert {spell.victim for spell in spells} == {"r1", "r2", "r3"}
    for share in (
        [spell.lockstep for spell in spells],
        [spell.page for spell in spells],
        [bool(spell.scenario.faults) for spell in spells],
    ):
        assert 5 < sum(share) < 55


def test_a_stranger_gets_in_as_what_it_holds() -> None:
    assert role_of_stranger(Holds.NOTHING, "r2") is None
    assert role_of_stranger(Holds.VIEWER, "r2") == VIEWER
    role = role_of_stranger(Holds.ROBOT, "r2")
    assert role is not None
    assert role.user == "robot-r2"


def test_forgeries_are_messages_that_decoders_take() -> None:
    """So that they reach the checks behind the decoders; the others reach the decoders only."""
    newest = PhaseA(1, 77, 5, 9, Sensed(5, Pose(1.0, 2.0, 0.0), False, (), 2.5))
    dice = Draws(3, Purpose.STRANGER)
    kinds: Counter[object] = Counter()
    decoders: dict[str, Callable[[bytes], object]] = {"tick": decode_to_robot, "reply": decode_to_world}
    for heard in (None, newest):
        for _ in range(300):
            key, payload = forged(dice, KEYS, ROBOTS, heard)
            last = key.rpartition("/")[2]
            decode = decoders.get(last)
            message = last if decode is None else decode(payload)
            kinds[message if isinstance(message, str) else type(message)] += 1
            if heard is not None and isinstance(message, ReplyB):
                assert (message.incarnation, message.instance, message.run) == (1, 77, 9)
    assert {PhaseA, PhaseB, Stop, HelloReply, ReplyA, ReplyB, "metrics", "events", "ticks"} <= set(kinds)
    assert isinstance(decode_to_world(encode(forged_farewell(newest))), Failed)


def test_changed_messages_differ_and_noise_is_bounded() -> None:
    dice = Draws(4, Purpose.STRANGER)
    payload = b"\x94\x01\x02\x03\x04" * 8
    changes = {changed(dice, payload) for _ in range(200)}
    assert len(changes) > 100
    assert len(changes - {payload}) > 100
    assert all(len(noise(dice, 64)) <= 64 for _ in range(200))
    assert isinstance(changed(dice, b""), bytes)


def test_every_key_of_a_fleet_is_attacked() -> None:
    keys = all_keys(KEYS, ROBOTS)
    parts = {key.split("/")[2] for key in keys}
    assert parts == {"robot", "position", "telemetry", "truth", "control"}
    assert KEYS.tick("r2") in keys
    assert KEYS.reply("r1") in keys
