"""Files as a stranger may write them: real ones, changed."""

import copy
import json
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
from hypothesis import strategies as st

from patrol.journal.file import MAGIC

FRAME = struct.Struct("<II")

VALUES: list[Any] = [
    *(None, True, False, 0, -1, 1, 2, 2**31, 2**53, 2**63, -(2**63), 2**64 - 1),
    *(0.5, -0.0, 1e-300, 1e308, -1e308, float("nan"), float("inf"), float("-inf")),
    *("", "x", "\ud800", "\x1b[2J", "\u202e", "$\\frac", "r1", "fault f1 begins: x", "a" * 300, "[" * 3000),
    *(b"", b"\xff" * 9, [], {}, [[]], [1, 2], [None] * 3, {"a": 1}, {"do": "pause"}),
    '{"do":"fault","fault":{"kind":"kill","who":"r1","at":1e300}}',
    '{"do":"fault","fault":{"kind":"loss","rate":0.5}}',
    '{"do":"intruder","place":[1e300,1]}',
    '{"do":"heal","id":"f1"}',
]
"""What stands in the place of an honest value: other types, numbers at and beyond limits, texts that mean something."""


def records_of(journal: bytes) -> list[bytes]:
    """The payloads of a journal."""
    at, payloads = len(MAGIC), []
    while at < len(journal):
        length, _ = FRAME.unpack_from(journal, at)
        payloads.append(journal[at + FRAME.size : at + FRAME.size + length])
        at += FRAME.size + length
    return payloads


def journal_of(payloads: list[bytes]) -> bytes:
    """A journal of some payloads, with right checksums."""
    return MAGIC + b"".join(FRAME.pack(len(one), zlib.crc32(one)) + one for one in payloads)


def places_in(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The keys and indices that lead to each part of a value, the value itself included."""
    yield place
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from places_in(inner, (*place, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from places_in(inner, (*place, index))


def changed(value: Any, place: tuple[Any, ...], new: Any) -> Any:
    """A value with another part in one place."""
    if not place:
        return new
    whole = copy.deepcopy(value)
    node = whole
    for key in place[:-1]:
        node = node[key]
    node[place[-1]] = new
    return whole


def without(value: Any, place: tuple[Any, ...]) -> Any:
    """A value without one of its parts."""
    whole = copy.deepcopy(value)
    node = whole
    for key in place[:-1]:
        node = node[key]
    del node[place[-1]]
    return whole


@st.composite
def strange_value(draw: st.DrawFn, value: Any) -> Any:
    """A value with one or two parts changed or missing."""
    for _ in range(draw(st.integers(1, 2))):
        places = list(places_in(value))
        place = draw(st.sampled_from(places))
        if place and draw(st.integers(0, 5)) == 0:
            value = without(value, place)
        else:
            value = changed(value, place, draw(st.sampled_from(VALUES)))
    return value


@st.composite
def strange_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes of which some are other ones, missing, or there twice."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        if not data:
            break
        at = draw(st.integers(0, len(data) - 1))
        match draw(st.integers(0, 3)):
            case 0:
                data[at] = draw(st.integers(0, 255))
            case 1:
                data[at : at + draw(st.integers(1, 16))] = draw(st.binary(max_size=16))
            case 2:
                del data[at:]
            case _:
                data[at:at] = data[at : at + draw(st.integers(1, 64))]
    return bytes(data)


@st.composite
def strange_journal(draw: st.DrawFn, journal: bytes) -> bytes:
    """A journal with a record that says something else, or with other bytes."""
    if draw(st.integers(0, 9)) == 0:
        return draw(strange_bytes(journal))
    payloads = records_of(journal)
    others = [place for place, payload in enumerate(payloads) if payload[1:11] != b"\xa4type\xa4tick"]
    place = draw(st.sampled_from(others) | st.integers(0, len(payloads) - 1))
    if draw(st.integers(0, 3)) == 0:
        payloads[place] = draw(strange_bytes(payloads[place]))
    else:
        record = msgpack.unpackb(payloads[place], strict_map_key=False)
        payloads[place] = msgpack.packb(draw(strange_value(record)), unicode_errors="surrogatepass")
    if draw(st.integers(0, 9)) == 0:
        payloads.insert(draw(st.integers(0, len(payloads))), draw(st.sampled_from(payloads)))
    return journal_of(payloads)


def rewrite_record(folder: Path, kind: str, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change the first record of a kind in a run folder's journal."""
    payloads = records_of((folder / "journal").read_bytes())
    for place, payload in enumerate(payloads):
        record = msgpack.unpackb(payload, strict_map_key=False)
        if record["type"] == kind:
            said = change(record)
            payloads[place] = msgpack.packb(record if said is None else said)
            (folder / "journal").write_bytes(journal_of(payloads))
            return
    raise AssertionError(f"no {kind}")


def add_event(folder: Path, **facts: Any) -> None:
    """Put an event before the first tick of a run folder's journal."""
    payloads = records_of((folder / "journal").read_bytes())
    payloads.insert(1, msgpack.packb({"type": "event", "k": 0, "kind": "fault", "robot": None, "detail": "", **facts}))
    (folder / "journal").write_bytes(journal_of(payloads))


def rewrite_summary(folder: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Change summary.json of a run folder."""
    path = folder / "summary.json"
    says = json.loads(path.read_text(encoding="utf-8"))
    said = change(says)
    path.write_text(json.dumps(says if said is None else said), encoding="utf-8")
