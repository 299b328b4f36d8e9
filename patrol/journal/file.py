"""The journal: a run's own lossless record, append-only and readable after any crash.

A file is a line of magic and then records: length (u32) and CRC-32 (u32) of a payload, little-endian, and the payload,
a msgpack map whose ``type`` is header (first), tick, event or end (last). Floats are float64, so what is read equals
what was written to the bit.

Every record goes to the operating system in one write as soon as it is handed over, so that killing the writer loses
nothing; that costs less than packing the record. A reader takes whole records up to the first that is cut off or
damaged and says so.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import msgpack

from patrol.errors import BadInput
from patrol.journal.records import End, Event, Header, Record, RobotFacts, RobotTick, Status, TerrainFacts, TickRecord

_KIND = b"fogwatch journal "
MAGIC = _KIND + b"1\n"
MAX_RECORD = 1 << 28
REMEDY = "use the version that wrote it, or run the folder's scenario.yaml again"
_FRAME = struct.Struct("<II")


class JournalWriter:
    """Writes a new journal.

    Args:
        path: the new file.
        header: the first record.

    Raises:
        OSError: when the file cannot be written; FileExistsError when it exists.
    """

    def __init__(self, path: Path, header: Header) -> None:
        self._file = io.FileIO(path, "xb")
        self._put(MAGIC)
        self.write(header)

    def write(self, record: Record) -> None:
        """Append one record; when this returns the operating system has it.

        Args:
            record: any record but the header.

        Raises:
            OSError: when the file cannot be written.
        """
        self.append(pack(record))

    def append(self, payload: bytes) -> None:
        """Append one record that is packed already; when this returns the operating system has it.

        Args:
            payload: from `pack`.

        Raises:
            OSError: when the file cannot be written.
            ValueError: for a record longer than MAX_RECORD.
        """
        if len(payload) > MAX_RECORD:
            raise ValueError(f"a record of {len(payload)} bytes is longer than {MAX_RECORD}")
        self._put(_FRAME.pack(len(payload), zlib.crc32(payload)) + payload)

    def close(self) -> None:
        """Close the file; closing twice is fine."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]


class _Rest(NamedTuple):
    """What takes a pass over the whole file to find out."""

    events: tuple[Event, ...]
    end: End | None
    truncated: bool


class Journal:
    """A journal on disk. Ticks are streamed from the file on each pass; the rest is read once, when first needed.

    Attributes:
        path: the file.
        header: its first record.

    Raises:
        BadInput: on opening and on reading, when an undamaged record is not what a journal holds.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        first = next(iter(_Records(path)), None)
        if not isinstance(first, Header):
            raise BadInput(f"{path}: has no complete header, so the run ended before it began; run it again")
        self.header = first

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order, as a new iterator over the file."""
        return (record for record in _Records(self.path) if isinstance(record, TickRecord))

    @property
    def events(self) -> tuple[Event, ...]:
        """The events in order."""
        return self._rest.events

    @property
    def end(self) -> End | None:
        """The end record, or None for a run that was cut off."""
        return self._rest.end

    @property
    def truncated(self) -> bool:
        """Whether the file goes on after its last whole record."""
        return self._rest.truncated

    @cached_property
    def _rest(self) -> _Rest:
        records = _Records(self.path, skip_ticks=True)
        events: list[Event] = []
        end: End | None = None
        for record in records:
            if isinstance(record, Event):
                events.append(record)
            elif isinstance(record, End):
                end = record
        return _Rest(tuple(events), end, records.truncated)


def read_journal(path: Path) -> Journal:
    """Open a journal, which may be cut off anywhere or still be growing.

    Args:
        path: the file.

    Raises:
        BadInput: for any other file.
    """
    return Journal(path)


class _Records:
    """One pass over a file's whole records; afterwards `truncated` says whether anything else follows them."""

    def __init__(self, path: Path, skip_ticks: bool = False) -> None:
        self.path = path
        self.truncated = False
        self._skip_ticks = skip_ticks

    def __iter__(self) -> Iterator[Record]:
        try:
            with self.path.open("rb") as file:
                self._check_magic(file.readline(len(MAGIC) + 8))
                for number, payload in enumerate(self._payloads(file)):
                    yield from self._record(number, payload)
        except OSError as error:
            raise BadInput(f"{self.path}: cannot be read ({error.strerror})") from None

    def _check_magic(self, magic: bytes) -> None:
        if not magic:
            raise BadInput(f"{self.path}: is empty, so the run ended before it began; run it again")
        if not magic.startswith(_KIND):
            raise BadInput(f"{self.path}: is not a fogwatch journal; give the folder of a run")
        if magic != MAGIC:
            raise BadInput(f"{self.path}: is a journal of another format, while this version reads format 1; {REMEDY}")

    def _payloads(self, file: io.BufferedReader) -> Iterator[bytes]:
        while frame := file.read(_FRAME.size):
            self.truncated = True
            if len(frame) < _FRAME.size:
                return
            length, checksum = _FRAME.unpack(frame)
            payload = file.read(length) if length <= MAX_RECORD else b""
            if len(payload) != length or zlib.crc32(payload) != checksum:
                return
            self.truncated = False
            yield payload

    def _record(self, number: int, payload: bytes) -> Iterator[Record]:
        try:
            value = msgpack.unpackb(payload, strict_map_key=False)
            if not (self._skip_ticks and value["type"] == "tick"):
                yield _typed(value)
        except (ValueError, TypeError, LookupError, AttributeError, msgpack.UnpackException) as error:
            what = f"record {number} is damaged or of another version ({type(error).__name__})"
            raise BadInput(f"{self.path}: {what}; {REMEDY}") from None


def pack(record: Record) -> bytes:
    """A record as a journal holds it.

    Args:
        record: any record.
    """
    packed: bytes = msgpack.packb(_plain(record))
    return packed


def unpack(payload: bytes) -> Record:
    """The record that was packed.

    Args:
        payload: from `pack`.

    Raises:
        ValueError: for anything else.
    """
    try:
        return _typed(msgpack.unpackb(payload, strict_map_key=False))
    except (TypeError, LookupError, AttributeError, msgpack.UnpackException) as error:
        raise ValueError(f"not a record of a journal ({type(error).__name__})") from None


def _plain(record: Record) -> dict[str, Any]:
    match record:
        case TickRecord():
            return _plain_tick(record)
        case Header():
            return {"type": "header", **asdict(record)}
        case Event():
            return {"type": "event", **asdict(record)}
        case End():
            return {"type": "end", **asdict(record)}


def _plain_tick(record: TickRecord) -> dict[str, Any]:
    return {
        "type": "tick",
        "k": record.k,
        "robots": [_row(robot) for robot in record.robots],
        "frames": record.frames,
        "delivered": _grouped((*delivery, "") for delivery in record.deliveries),
        "dropped": _grouped(record.dropped),
        "copies": _grouped(record.copies),
        "delayed": _grouped(record.delayed),
        "forged": record.forged,
        "mfow": record.mfow,
        "fog_mean": record.fog_mean,
        "seen": record.seen,
    }


def _row(r: RobotTick) -> tuple[Any, ...]:
    driven = (r.x, r.y, r.heading, r.c0, r.c1, r.bumped)
    return (r.number, r.status, *driven, r.state, r.goal, r.decision_ms, r.rejected, r.refused)


def _grouped(links: Iterable[tuple[int, int, int, str]]) -> list[tuple[int, int, str, list[int]]]:
    """(source, sequence, cause, destinations): neighbours that differ in the destination alone are drawn together.

    A frame that reaches a whole fleet is one entry; any order of links survives.
    """
    groups: list[tuple[int, int, str, list[int]]] = []
    last: tuple[int, int, str] | None = None
    destinations: list[int] = []
    for source, destination, sequence, cause in links:
        if last != (source, sequence, cause):
            last = (source, sequence, cause)
            destinations = []
            groups.append((source, sequence, cause, destinations))
        destinations.append(destination)
    return groups


def _typed(value: Any) -> Record:
    kind = value.pop("type")
    match kind:
        case "tick":
            return _typed_tick(value)
        case "event":
            return Event(**value)
        case "end":
            return End(**value)
        case "header":
            robots = tuple(RobotFacts(**facts) for facts in value.pop("robots"))
            terrain = value.pop("terrain")
            origin = (float(terrain["origin"][0]), float(terrain["origin"][1]))
            return Header(robots=robots, terrain=TerrainFacts(**{**terrain, "origin": origin}), **value)
    raise ValueError(f"unknown type {kind}")


def _typed_tick(value: dict[str, Any]) -> TickRecord:
    return TickRecord(
        k=value["k"],
        robots=tuple(map(_typed_robot, value["robots"])),
        frames=tuple((source, frame) for source, frame in value["frames"]),
        deliveries=tuple((source, to, seq) for source, seq, _, tos in value["delivered"] for to in tos),
        dropped=_links(value["dropped"]),
        mfow=value["mfow"],
        fog_mean=value["fog_mean"],
        seen=value["seen"],
        copies=_links(value.get("copies", ())),
        delayed=_links(value.get("delayed", ())),
        forged=tuple(value.get("forged", ())),
    )


def _links(groups: Iterable[tuple[int, int, str, list[int]]]) -> tuple[tuple[int, int, int, str], ...]:
    """What `_grouped` drew together."""
    return tuple((source, to, seq, why) for source, seq, why, tos in groups for to in tos)


def _typed_robot(row: Sequence[Any]) -> RobotTick:
    number, status, x, y, heading, c0, c1, bumped, state, goal, decision_ms, rejected, refused = row
    place = None if goal is None else (goal[0], goal[1])
    driven = (x, y, heading, c0, c1, bumped)
    return RobotTick(number, Status(status), *driven, state, place, decision_ms, rejected, refused)
