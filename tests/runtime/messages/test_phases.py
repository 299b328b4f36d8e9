from dataclasses import replace
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import Malformed
from patrol.exchange import LEAST_WEIGHT, MOST_WEIGHT, MOST_ZONES, Reply, Sensed
from patrol.pose import Drive, Pose, Twist, Velocity
from patrol.radio.message import MAX_CONTACTS, MAX_FRAMES
from runtime.messages import phases

counts = st.integers(0, 2**31 - 1)
ids = st.integers(0, 2**63 - 1)
finite = st.floats(allow_nan=False, allow_infinity=False)
anything = st.floats(allow_nan=False)
words = st.text("abcdefghij -", max_size=32)
heads = (counts, ids, counts, ids)
poses = st.builds(Pose, finite, finite, finite)
pairs = st.lists(st.tuples(finite, finite), max_size=MAX_CONTACTS).map(tuple)


numbers = st.integers(0, MOST_ZONES - 1)
zones = st.none() | st.lists(numbers, max_size=MOST_ZONES).map(tuple)
weights = st.lists(st.tuples(numbers, st.floats(LEAST_WEIGHT, MOST_WEIGHT)), max_size=MOST_ZONES).map(tuple)


def phase_a(head: tuple[int, int, int, int], *seen: Any, **zones: Any) -> phases.PhaseA:
    return phases.PhaseA(*head, Sensed(head[2], *seen, **zones))


to_robot: st.SearchStrategy[phases.ToRobot] = st.one_of(
    st.builds(phases.Hello, *heads),
    st.builds(phase_a, st.tuples(*heads), poses, st.booleans(), pairs, finite, zones=zones, weights=weights),
    st.builds(phases.PhaseB, *heads, st.lists(st.binary(max_size=64), max_size=8).map(tuple)),
    st.builds(phases.Stop, *heads, st.booleans(), words),
)
commands = st.one_of(*(st.builds(command, anything, anything) for command in (Drive, Twist, Velocity)))
to_world: st.SearchStrategy[phases.ToWorld] = st.one_of(
    st.builds(phases.HelloReply, *heads, words, counts),
    st.builds(phases.ReplyA, *heads, st.lists(st.binary(max_size=100), max_size=MAX_FRAMES).map(tuple)),
    st.builds(
        phases.ReplyB, *heads, st.builds(Reply, commands, words, st.none() | st.tuples(finite, finite), finite, ids)
    ),
    st.builds(phases.Failed, *heads, words),
    st.builds(phases.Farewell, *heads),
)


@given(to_robot)
def test_a_message_to_a_robot_comes_back_bit_for_bit(message: phases.ToRobot) -> None:
    assert phases.decode_to_robot(phases.encode(message)) == message


@given(to_world)
def test_a_message_to_the_world_comes_back_bit_for_bit(message: phases.ToWorld) -> None:
    assert phases.decode_to_world(phases.encode(message)) == message


@given(to_robot, st.data())
def test_a_torn_or_bent_message_is_refused_or_whole(message: phases.ToRobot, data: st.DataObject) -> None:
    payload = bytearray(phases.encode(message))
    place = data.draw(st.integers(0, len(payload) - 1))
    with pytest.raises(Malformed):
        phases.decode_to_robot(bytes(payload[:place]))
    with pytest.raises(Malformed):
        phases.decode_to_robot(bytes(payload) + b"\x00")


REST: list[object] = [0.0, None, [], None, []]
"""The last values of a phase A: clock, charge, what is blocked, zones, weights."""


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xc1",
        b"\x91" * 5000,
        b"\xdd\xff\xff\xff\xff",
        b"\xc6\xff\xff\xff\xff",
        b"\xd6\xff\x00\x00\x00\x00",
        b"\xd4\x05\x00",
        msgpack.packb({"kind": 1}),
        msgpack.packb([True, 1, 1, 0, 9]),
        msgpack.packb([1, 1.0, 1, 0, 9, b""]),
        msgpack.packb([1, 1, 1, 0, 9, [b"x"] * (MAX_FRAMES + 1)]),
        msgpack.packb([1, 1, 1, 0, 9, b"frame"]),
        msgpack.packb([1, 1, 1, 0, 9, 1.0, 2.0, 3.0, False, []]),
        msgpack.packb([1, 1, 1, 0, 9, 1.0, 2.0, 3.0, False, [1.0, 2.0] * (MAX_CONTACTS + 1), *REST]),
        msgpack.packb([2, 1, 1, 0, 9, [b"x"], b""]),
        msgpack.packb([4, 1, 1, 0, 9, 0]),
        msgpack.packb([4, 1, 1, 0]),
    ],
)
def test_hostile_bytes_are_malformed(payload: bytes) -> None:
    with pytest.raises(Malformed):
        phases.decode_to_robot(payload)
    with pytest.raises(Malformed):
        phases.decode_to_world(payload)


def test_an_oversized_reply_or_state_is_malformed() -> None:
    with pytest.raises(Malformed, match="at most"):
        phases.decode_to_world(phases.encode(phases.ReplyA(1, 1, 0, 9, (bytes(phases.MAX_REPLY),))))
    longest = phases.ReplyB(1, 2, 3, 4, Reply(Velocity(0.0, 0.0), "x" * phases.MAX_STATE, None, 0.0, 0))
    assert phases.decode_to_world(phases.encode(longest)) == longest
    longer = phases.encode(replace(longest, reply=replace(longest.reply, state="x" * (phases.MAX_STATE + 1))))
    with pytest.raises(Malformed, match=f"at most {phases.MAX_STATE} characters"):
        phases.decode_to_world(longer)


@pytest.mark.parametrize(("in_force", "zones", "known"), [((0, 1), 2, True), ((0, 2), 2, False), ((0,), 0, False)])
def test_a_zone_that_the_scenario_does_not_have_is_malformed(
    in_force: tuple[int, ...], zones: int, known: bool
) -> None:
    payload = phases.encode(phases.PhaseA(1, 1, 0, 9, Sensed(0, Pose(1.0, 2.0, 3.0), zones=in_force)))
    if known:
        assert isinstance(phases.decode_to_robot(payload, zones), phases.PhaseA)
        return
    with pytest.raises(Malformed, match=rf"zone {in_force[-1]} is in force, and the scenario's {zones} "):
        phases.decode_to_robot(payload, zones)
    sensed = Sensed(0, Pose(1.0, 2.0, 3.0), zones=(), weights=((in_force[-1], 2.0),))
    with pytest.raises(Malformed):
        phases.decode_to_robot(phases.encode(phases.PhaseA(1, 1, 0, 9, sensed)), zones)


def test_a_long_reason_is_cut_to_what_fits() -> None:
    stop, failed = phases.Stop(1, 1, 0, 9, orderly=False, reason="x" * 5000), phases.Failed(1, 1, 0, 9, "x" * 5000)
    assert phases.decode_to_robot(phases.encode(stop)) == replace(stop, reason="x" * 400)
    assert phases.decode_to_world(phases.encode(failed)) == replace(failed, reason="x" * 400)


def test_a_phase_a_says_one_tick_only() -> None:
    with pytest.raises(ValueError, match="phase A of tick 4 cannot say what was sensed at tick 5"):
        phases.encode(phases.PhaseA(1, 1, 4, 9, Sensed(5, Pose(1.0, 2.0, 3.0))))


def test_an_agent_of_an_earlier_version_is_still_understood_when_it_says_which() -> None:
    """Version 4 sent kind, incarnation, instance, k, run, scenario and protocol too, in this order."""
    old = msgpack.packb([0, 1, 77, 5, 9, "a" * 64, 4])
    assert phases.decode_to_world(old) == phases.HelloReply(1, 77, 5, 9, "a" * 64, 4)
