"""The bytes of each message and record, as versions since 0.2 send and keep them."""

import json
import tracemalloc
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgpack
import numpy as np
import pytest
from pydantic import Field

from patrol.errors import Malformed
from patrol.exchange import Reply, Sensed
from patrol.journal import End, Event, Header, RobotFacts, RobotTick, Status, TerrainFacts, TickRecord, pack, unpack
from patrol.journal.links import Drops, Links
from patrol.pose import Drive, Pose, Twist, Velocity
from patrol.wire import PRINTABLE, Finite, Row, Text, read, read_sparingly
from runtime.messages.feed import Batch, batch_bytes, read_so_far
from runtime.messages.phases import (
    Failed,
    Farewell,
    Hello,
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
from runtime.messages.stop_orders import Order, Outcome, outcome_of
from runtime.messages.telemetry import Metrics, Notice, RobotView, Telemetry, Traffic, pack_view, read_traffic
from tests.fleets import answer_so_far

HEAD = (1, 2**63 - 1, 70_000, 9)
SENSED = Sensed(70_000, Pose(1, -2.5, 0.125), True, ((1.0, 2.0), (-0.0, 4)), 35_000.5)
TRAFFIC = Traffic(2, 30, {"r2": 29, "r3": 0}, 1, final=True)
METRICS = Metrics(3, 10, 1.5, 2.0, 1.0, 2.5, 0.5, 40.0, (RobotView("r1", 1, "patrolling", 1.0, 2.0, 0.5),), (2.5, -9.5))
TELEMETRY = Telemetry(3, "patrolling", (1.0, 2.0), None, 0.5, 9, 1.5, 0)
ROBOTS = (
    RobotTick(1, Status.ALIVE, 1.5, -0.0, 1e-300, 4.4, -1 / 3, True, "patrolling", (1.5, 2.5), 0.7, 0),
    RobotTick(65535, Status.LEFT, -7.0, 3.0, 0.1, 0.0, 0.0, False, "", None, None, None, True),
)
HEADER = Header(
    "0.2.0",
    {"name": "yards", "robots": [{"count": 2, "speed": 1.5, "spare": None}]},
    "ab" * 32,
    (RobotFacts(1, "r1", "car", 1.0), RobotFacts(65535, "scout", "holonomic", 0.3)),
    TerrainFacts("yards", 1000, 880, 0.1, (-1.5, 0.0)),
    6837.25,
    16.4,
    "2026-01-01T12:00:00+00:00",
)
NOTES = {
    "exit_codes": {"r1": 0},
    "wall_s": 2.5,
    "late_frames": {1: 3},
    "refused": {"r1": 2},
    "direct": {"missed": {"r1": 0}, "said": {"r1": {"sent": 3, "heard": {"r2": 2}, "refused": 0, "final": True}}},
}
TICK = TickRecord(
    k=3,
    robots=ROBOTS,
    frames=((1, b"frame"), (65535, b""), (0, b"forged")),
    deliveries=((1, 2, 3), (1, 3, 3), (2, 1, 3), (0, 1, 2**40)),
    dropped=((1, 2, 3, "range"), (1, 3, 3, "range"), (1, 4, 3, "jam:f1")),
    mfow=3,
    fog_mean=1.25,
    seen=51,
    copies=((1, 2, 3, "f2"),),
    delayed=((2, 1, 3, "f3"),),
    forged=("f4",),
)


def columns(*values: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    return np.array(values, dtype=np.int64)


IN_COLUMNS = TickRecord(
    k=3,
    robots=(),
    frames=(),
    deliveries=Links(columns(1, 1, 2), columns(2, 3, 1), columns(3, 3, 3)),
    dropped=Drops(columns(1, 1), columns(2, 3), columns(3, 3), columns(0, 1), ("range", "jam:f1")),
    mfow=0,
    fog_mean=0.0,
    seen=0,
)

BATCH, TO_WORLD, TO_ROBOT = partial(read_sparingly, Batch), (encode, decode_to_world), (encode, decode_to_robot)
RECORD, ORDER = (pack, unpack), (lambda order: order.encode(), lambda payload: Order(payload.decode()))
MESSAGES: Mapping[str, tuple[Any, tuple[Callable[[Any], bytes], Callable[[bytes], object]]]] = {
    "hello": (Hello(*HEAD), TO_ROBOT),
    "phase a": (PhaseA(*HEAD, SENSED), TO_ROBOT),
    "phase b": (PhaseB(*HEAD, (b"frame", b"")), TO_ROBOT),
    "stop": (Stop(*HEAD, orderly=True, reason="the run is over"), TO_ROBOT),
    "hello reply": (HelloReply(*HEAD, "a" * 64), TO_WORLD),
    "reply a": (ReplyA(*HEAD, (b"frame", b"x" * 100)), TO_WORLD),
    "reply b": (ReplyB(*HEAD, Reply(Drive(1.5, -0.0), "patrolling", (1, 2.0), 1.5, 7)), TO_WORLD),
    "reply b, no goal": (ReplyB(*HEAD, Reply(Twist(1.0, 0.5), "", None, 0.0, 0)), TO_WORLD),
    "reply b, refused": (ReplyB(*HEAD, Reply(Velocity(1e400, 0.0), "", None, 0.0, 0)), TO_WORLD),
    "failed": (Failed(*HEAD, "no plan" * 100), TO_WORLD),
    "farewell": (Farewell(*HEAD), TO_WORLD),
    "batch": (Batch(2**40, (b"one", b""), running=True, pace=2.0), (batch_bytes, BATCH)),
    "empty batch": (Batch(0, (), running=False, pace=None), (batch_bytes, BATCH)),
    "metrics": (METRICS, (pack_view, partial(read, Metrics))),
    "notice": (Notice(3, "lost", "r1", "no answer"), (pack_view, partial(read, Notice))),
    "telemetry": (TELEMETRY, (pack_view, partial(read, Telemetry))),
    "traffic": (Telemetry(1, "holding", None, (1.0, 2.0), None, 3, 4.0, 5, TRAFFIC), (pack_view, read_traffic)),
    "stop order": (Order.STOP, ORDER),
    "release": (Order.RELEASE, ORDER),
    "outcome": (Outcome(done=False, text="it still drives"), (Outcome.to_bytes, outcome_of)),
    "header": (HEADER, RECORD),
    "tick": (TICK, RECORD),
    "tick in columns": (IN_COLUMNS, RECORD),
    "event": (Event(3, "dead", 1, "killed"), RECORD),
    "event of the run": (Event(3, "over"), RECORD),
    "end": (End("duration", "cd" * 32, NOTES), RECORD),
}
READ_OTHERWISE: Mapping[str, object] = {"failed": Failed(*HEAD, ("no plan" * 100)[:400]), "traffic": TRAFFIC}

BYTES: Mapping[str, str] = json.loads((Path(__file__).parent / "wire_bytes.json").read_text(encoding="utf-8"))
"""What version 0.2 made of the messages, as hexadecimal digits; phases, greeting and farewell are of protocol 8."""


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_is_sent_and_read_as_it_always_was(name: str) -> None:
    message, (write, read) = MESSAGES[name]
    assert write(message).hex() == BYTES[name]
    assert read(bytes.fromhex(BYTES[name])) == READ_OTHERWISE.get(name, message)


def test_an_answer_to_a_viewer_is_sent_as_it_always_was() -> None:
    """Versions of zlib differ in what they make of the same grid, so it is compared as it is unpacked."""
    says = msgpack.unpackb(answer_so_far())
    grids = {name: zlib.decompress(says.pop(name)).hex() for name in ("passable", "keep_out", "seen")}
    assert grids == {"passable": "fffff0", "keep_out": "000000", "seen": 20 * "02000000"}
    assert [zlib.decompress(area).hex() for area in says.pop("areas")] == ["fffff0"]
    curve = "000000000000803f00000040"
    assert list(says.items()) == [
        *(
            ("number", 9),
            ("header", b"header"),
            ("last", None),
            ("shape", [4, 5]),
            ("area_of", [[1, 0]]),
            ("events", []),
        ),
        *(("event", 0), ("asked", [b"asked"]), ("every", 1), ("mfow", bytes.fromhex(curve))),
        *(("fog_mean", bytes.fromhex(curve)), ("running", True), ("pace", None), ("charge", [[1, 0.5]])),
    ]
    assert list(msgpack.unpackb(answer_so_far())) == [
        *("number", "header", "last", "shape", "passable", "keep_out", "areas", "area_of", "seen", "events"),
        *("event", "asked", "every", "mfow", "fog_mean", "running", "pace", "charge"),
    ]
    assert read_so_far(answer_so_far()).number == 9


@pytest.mark.parametrize("name", ["header", "event", "end"])
def test_a_record_with_a_field_of_a_later_version_is_refused(name: str) -> None:
    says = {**msgpack.unpackb(bytes.fromhex(BYTES[name]), strict_map_key=False), "news": 1}
    with pytest.raises(Malformed, match="news: Unexpected keyword argument"):
        unpack(msgpack.packb(says))


def test_a_record_of_an_earlier_version_is_read() -> None:
    """Runs had no start, no notes and no faults that add or delay frames, once."""
    says = msgpack.unpackb(bytes.fromhex(BYTES["header"]))
    del says["started"]
    assert unpack(msgpack.packb(says)) == Header(
        *(getattr(HEADER, name) for name in HEADER.__slots__ if name != "started")
    )
    assert unpack(msgpack.packb({"type": "end", "reason": "duration", "trace_hash": ""})) == End("duration", "")
    says = msgpack.unpackb(bytes.fromhex(BYTES["tick in columns"]))
    for name in ("copies", "delayed", "forged"):
        del says[name]
    assert unpack(msgpack.packb(says)) == IN_COLUMNS


def test_a_tick_by_another_writer_is_read() -> None:
    """In another order, with whole numbers for some of the floats, and with a field that nobody knows."""
    says = msgpack.unpackb(bytes.fromhex(BYTES["tick"]))
    kind = says.pop("type")
    says["robots"][0][2] = 2
    read = unpack(msgpack.packb({**says, "type": kind, "news": 1}))
    assert isinstance(read, TickRecord)
    assert read.robots[0].x == 2.0
    assert read.deliveries == TICK.deliveries


@dataclass(frozen=True, slots=True)
class Ping(Row):
    k: Annotated[int, Field(strict=True, ge=0, le=9)]
    who: Annotated[Text, Field(max_length=4), PRINTABLE]
    at: Finite


@dataclass(frozen=True, slots=True)
class Pings:
    pings: Annotated[tuple[Ping, ...], Field(max_length=3, fail_fast=True)]
    note: Text | None = None


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([10, "r1", 1.0], "k: Input should be less than or equal to 9"),
        ([True, "r1", 1.0], "k: Input should be a valid integer"),
        ([3, "long name", 1.0], "who: String should have at most 4 characters"),
        ([3, "\x1b[2J", 1.0], "who: is not printable"),
        ([3, "r1", 1], "at: Input should be an instance of float"),
        ([3, "r1", float("nan")], "at: Input should be a finite number"),
        ([3, "r1"], "at: Field required"),
        ([3, "r1", 1.0, 2.0], "Tuple should have at most 3 items"),
        ({"k": 3, "who": "r1", "at": 1.0}, "Input should be a valid tuple"),
    ],
)
def test_what_is_wrong_is_named(values: object, says: str) -> None:
    with pytest.raises(Malformed, match=says):
        read(Ping, msgpack.packb(values))
    with pytest.raises(Malformed):
        read_sparingly(Ping, msgpack.packb(values))


def test_what_is_wrong_far_inside_is_named_and_many_wrong_values_make_one_error() -> None:
    with pytest.raises(Malformed, match=r"pings\.1\.k: Input should be less than or equal to 9"):
        read(Pings, msgpack.packb({"pings": [[3, "r1", 1.0], [10, "r1", 1.0]]}))
    wrong = msgpack.packb({**msgpack.unpackb(bytes.fromhex(BYTES["metrics"])), "robots": [None] * 100_000})
    with at_most_bytes(4_000_000), pytest.raises(Malformed, match=r"robots\.0"):
        read(Metrics, wrong)


@pytest.mark.parametrize("reads", [read, read_sparingly])
def test_a_message_is_read_into_its_class_and_what_is_not_known_is_skipped(
    reads: Callable[[type[Pings], bytes], Pings],
) -> None:
    payload = msgpack.packb({"news": 1, "pings": [[3, "r1", 1.5]]})
    assert reads(Pings, payload) == Pings((Ping(3, "r1", 1.5),))
    with pytest.raises(Malformed):
        reads(Pings, payload + b"\x00")
    with pytest.raises(Malformed):
        reads(Pings, payload[:-1])


@pytest.mark.parametrize(
    "says", [{"pings": [[3, "r1", 1.5]] * 4}, {"pings": [], "news": []}, {"pings": [[3, "r1", [1.5]]]}, {"pings": {}}]
)
def test_what_is_read_sparingly_makes_no_more_objects_than_are_declared(says: object) -> None:
    with pytest.raises(Malformed):
        read_sparingly(Pings, msgpack.packb(says))


@contextmanager
def at_most_bytes(most: int) -> Iterator[None]:
    tracemalloc.start()
    yield
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < most


def many(entries: int) -> dict[str, str]:
    return {str(number): "wrong" for number in range(entries)}


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (read_traffic, {"traffic": {"incarnation": 1, "sent": 0, "heard": many(50_000), "refused": 0, "final": True}}),
        (unpack, {"type": "end", "reason": "", "trace_hash": "", "notes": {"refused": many(50_000)}}),
        (unpack, {"type": "end", "reason": "", "trace_hash": "", "notes": {"late_frames": many(50_000)}}),
        (unpack, {"type": "end", "reason": "", "trace_hash": "", "notes": {"direct": {"said": many(50_000)}}}),
        (unpack, {"type": "event", "k": 1, "kind": "dead", **many(200_000)}),
    ],
)
def test_many_wrong_entries_of_a_map_make_one_error(read: Callable[[bytes], object], says: object) -> None:
    wrong = msgpack.packb(says)
    with pytest.raises(Malformed):
        read(wrong)  # the first reading makes the validators
    with at_most_bytes(25_000_000), pytest.raises(Malformed):  # an error for each entry takes 36 MB and more
        read(wrong)


def test_a_scenario_that_is_nested_too_deeply_is_refused() -> None:
    says = msgpack.unpackb(bytes.fromhex(BYTES["header"]))
    packed = msgpack.packb({**says, "scenario": {"deep": "here"}})
    with pytest.raises(Malformed, match="nested too deeply"):
        unpack(packed.replace(b"\xa4here", 1000 * b"\x91" + b"\x90"))
