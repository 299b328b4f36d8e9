"""Whatever bytes come over a wire: each decoder gives a value or its documented exception, with bounded memory.

Files are fuzzed elsewhere. `FOGWATCH_FUZZ_S` is how long the long version takes, in seconds; an hour unless set.
"""

import math
import os
import time
import tracemalloc
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import seed as drawn_from
from hypothesis import strategies as st

from patrol.errors import BadInput, Malformed
from patrol.exchange import Reply, Sensed
from patrol.journal import Event, Status, pack, unpack
from patrol.pose import Pose, Velocity
from patrol.radio.message import CONTACT, MAX_FRAME, Position, Rejected
from patrol.radio.message import decode as decode_frame
from patrol.radio.message import encode as encode_frame
from patrol.random import Draws, Purpose
from patrol.scenario.controls import read_control
from patrol.wire import read, read_sparingly
from runtime.messages import phases
from runtime.messages.feed import MAX_ANSWER as MAX_SO_FAR
from runtime.messages.feed import MAX_BATCH, Batch, batch_bytes, longest_record, read_so_far
from runtime.messages.telemetry import (
    MAX_NOTICE,
    Metrics,
    Notice,
    RobotView,
    Telemetry,
    Traffic,
    longest_metrics,
    pack_view,
    read_traffic,
)
from runtime.security.control_auth import (
    MAX_ANSWER,
    MAX_REQUEST,
    ControlClient,
    ControlGate,
    RequestRefused,
    Unanswered,
)
from runtime.security.keys import fleet_keys
from tests.fleets import answer_so_far
from tests.hostile.strangers.payloads import changed, noise

MB = 1 << 20
MOST_MB = 64
"""Memory that one payload may take while it is decoded, MB."""
BOMB = 4 * MB
"""Bytes of the longest payload that is tried."""
ROBOTS = 5
KEYS = fleet_keys("f")
TOKEN = "t" * 32
EXAMPLES = 60
FUZZ_S = float(os.environ.get("FOGWATCH_FUZZ_S", "3600"))

HEAD = (1, 7, 3, 9)
POSE = Pose(1.0, 2.0, 0.5)


def control(payload: bytes) -> object:
    """What a world does with a request, and with what a request says."""
    gate = ControlGate("f", TOKEN, 1, b"s" * 16, lambda: 100.0)
    for take in (gate.challenge, gate.open):
        with_none(lambda take=take: take(payload), RequestRefused)  # type: ignore[misc]
    try:
        says = msgpack.unpackb(payload, strict_map_key=False)
    except Exception:  # noqa: BLE001 - the request is for JSON values of any kind, and these are the nearest
        says = payload
    return with_none(lambda: read_control(says), BadInput)


def answer(payload: bytes) -> object:
    """What an operator does with an answer, to a challenge and to a request."""

    class Wire:
        def answers_until(
            self, keys: Sequence[str], payload_: bytes, longest: int, wait_s: float
        ) -> Iterable[tuple[str, bytes]]:
            del payload_, wait_s
            yield from [(keys[0], payload)] if len(payload) <= longest else []

    client = ControlClient(Wire(), KEYS, TOKEN, lambda: 100.0, bytes)
    return with_none(lambda: client.ask({"do": "pause"}, 1.0), Unanswered)


def with_none(read: Callable[[], object], refused: type[Exception]) -> object:
    try:
        return read()
    except refused:
        return None


@dataclass(frozen=True)
class Decoder:
    """A decoder, what it raises for bytes that it does not take, and bytes that it takes."""

    decode: Callable[[bytes], object]
    refuses: type[Exception] | None
    longest: int
    honest: tuple[bytes, ...]


METRICS = Metrics(3, 10, 1.5, 2.0, 2.0, 3.0, 0.5, 99.0, (RobotView("r1", Status.ALIVE, "patrolling", 1.0, 2.0, 0.0),))
TELEMETRY = Telemetry(
    3, "patrolling", (1.0, 2.0), None, 0.5, 9, 1.5, 0, Traffic(1, 5, {"r1": 3, "r2": 4}, 0, final=False)
)
ONE, OF_CONTACT = (Position.of(number, 3, 1.5, POSE) for number in (1, CONTACT))
DECODERS: Mapping[str, Decoder] = {
    "phases, to a robot": Decoder(
        phases.decode_to_robot,
        Malformed,
        phases.max_to_robot(ROBOTS),
        (
            phases.encode(phases.Hello(*HEAD)),
            phases.encode(phases.PhaseA(*HEAD, Sensed(3, POSE, False, ((1.0, 2.0),), 1.5))),
            phases.encode(phases.PhaseB(*HEAD, (b"frame", b"other"))),
            phases.encode(phases.Stop(*HEAD, orderly=True, reason="the run is over")),
        ),
    ),
    "phases, to the world": Decoder(
        phases.decode_to_world,
        Malformed,
        phases.MAX_REPLY,
        (
            phases.encode(phases.HelloReply(*HEAD, "a" * 64)),
            phases.encode(phases.ReplyA(*HEAD, (b"frame",))),
            phases.encode(phases.ReplyB(*HEAD, Reply(Velocity(0.5, 0.25), "patrolling", (1.0, 2.0), 1.5, 0))),
            phases.encode(phases.Failed(*HEAD, "no plan")),
            phases.encode(phases.Farewell(*HEAD)),
        ),
    ),
    "batches": Decoder(
        partial(read_sparingly, Batch), Malformed, MAX_BATCH, (batch_bytes(Batch(3, (b"one", b"two"), True, 2.0)),)
    ),
    "answers to viewers": Decoder(read_so_far, Malformed, MAX_SO_FAR, (answer_so_far(),)),
    "records": Decoder(
        unpack, ValueError, longest_record(ROBOTS), (pack(Event(3, "dead", 1, "killed")), pack(Event(4, "x", None)))
    ),
    "metrics": Decoder(partial(read, Metrics), Malformed, longest_metrics(ROBOTS), (pack_view(METRICS),)),
    "notices": Decoder(
        partial(read, Notice), Malformed, MAX_NOTICE, (pack_view(Notice(3, "lost", "r1", "it is gone")),)
    ),
    "telemetry": Decoder(partial(read, Telemetry), Malformed, MAX_NOTICE, (pack_view(TELEMETRY),)),
    "traffic": Decoder(read_traffic, Malformed, MAX_NOTICE, (pack_view(TELEMETRY),)),
    "controls": Decoder(control, None, MAX_REQUEST, (msgpack.packb({"do": "step", "ticks": 3}), bytes(16))),
    "answers to operators": Decoder(answer, None, MAX_ANSWER, (bytes(64), b"m" * 32 + b'{"done": true, "text": "x"}')),
    "positions": Decoder(decode_frame, Rejected, MAX_FRAME + 1, (encode_frame(ONE), encode_frame(OF_CONTACT))),
    "positions with a key": Decoder(
        lambda frame: decode_frame(frame, b"key"), Rejected, MAX_FRAME + 1, (encode_frame(ONE, b"key"),)
    ),
}

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.sampled_from([0, 1, 2**31, 2**62, 2**63 - 1, math.nan, math.inf, 1e300, 5e-324, "", "\x1b[2J", b""])
    | st.floats()
    | st.text(max_size=9)
    | st.binary(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


def replaced(data: st.DataObject, says: Any) -> Any:
    """A value with one of the values in it replaced by another one."""
    inner = list(says) if isinstance(says, list | dict) else []
    if not inner or data.draw(st.integers(0, 4)) == 0:
        return data.draw(VALUES)
    copy = list(says) if isinstance(says, list) else dict(says)
    at = data.draw(st.integers(0, len(inner) - 1)) if isinstance(says, list) else data.draw(st.sampled_from(inner))
    copy[at] = replaced(data, says[at])
    return copy


def strange(data: st.DataObject, honest: bytes) -> bytes:
    """Bytes that are like honest ones, or not at all."""
    match data.draw(st.integers(0, 3)):
        case 0:
            return data.draw(st.binary(max_size=200))
        case 1:
            return changed(Draws(data.draw(st.integers(0, 2**32)), Purpose.STRANGER), honest)
        case 2:
            return noise(Draws(data.draw(st.integers(0, 2**32)), Purpose.STRANGER))
        case _:
            try:
                says = msgpack.unpackb(honest, strict_map_key=False)
            except (ValueError, msgpack.UnpackException):
                says = None
            return bytes(msgpack.packb(replaced(data, says)))


def decoded(decoder: Decoder, payload: bytes) -> None:
    """A value or the documented exception; what is too long is refused before it gets here."""
    if len(payload) > decoder.longest:
        return
    if decoder.refuses is None:
        decoder.decode(payload)
    else:
        with_none(lambda: decoder.decode(payload), decoder.refuses)


def search(decoder: Decoder, examples: int, number: int | None = None) -> None:
    """Try payloads: the same ones each time, or those of a number."""

    def check(data: st.DataObject) -> None:
        decoded(decoder, strange(data, data.draw(st.sampled_from(decoder.honest))))

    bounded = settings(deadline=None, max_examples=examples, suppress_health_check=list(HealthCheck))
    if number is None:
        bounded(given(st.data())(check))()
    else:
        drawn_from(number)(settings(bounded, derandomize=False, database=None)(given(st.data())(check)))()


@pytest.mark.parametrize("name", DECODERS)
def test_honest_bytes_are_taken(name: str) -> None:
    """What the others are changed from is taken, so that a change in one place gets as far as that place."""
    decoder = DECODERS[name]
    for payload in decoder.honest:
        assert len(payload) <= decoder.longest
        decoder.decode(payload)


@pytest.mark.parametrize("name", DECODERS)
def test_strange_bytes_give_a_value_or_the_documented_exception(name: str) -> None:
    search(DECODERS[name], EXAMPLES)


@pytest.mark.parametrize("name", DECODERS)
def test_long_payloads_take_little_memory(name: str) -> None:
    """Small objects take many times the bytes that they are packed in."""
    decoder = DECODERS[name]
    room = min(decoder.longest, BOMB)
    for filler in (b"\x80", b"\x90", b"\xc0", b"\xc4\x00", b"\x91", b"\x81\xa0", b"\xca\x00\x00\x00\x00"):
        for head in (b"", b"\xdd", b"\x94\x00\xdd", b"\x81\xa6robots\xdd", b"\x85\xa5areas\xdd", b"\xdf", b"\xc6"):
            many = max((room - len(head) - 4) // len(filler), 0)
            payload = head + (many.to_bytes(4, "big") if head else b"") + many * filler
            tracemalloc.start()
            decoded(decoder, payload)
            most = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            assert most < MOST_MB * MB, f"{head!r} {filler!r}: {most / MB:.0f} MB"


@pytest.mark.accept
@pytest.mark.timeout(round(FUZZ_S) + 600)
def test_a_long_search_finds_nothing() -> None:
    until = time.monotonic() + FUZZ_S
    number = 0
    while time.monotonic() < until:
        number += 1
        for decoder in DECODERS.values():
            search(decoder, 1000, number)
    assert number
