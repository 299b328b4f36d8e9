"""The journal: a run's own lossless record, append-only and readable after any crash.

A file is a line of magic and then records: length (u32) and CRC-32 (u32) of a payload, little-endian, and the payload,
a msgpack map whose ``type`` is header (first), tick, event or end (last). Floats are float64, so what is read equals
what was written to the bit.

Every record goes to the operating system in one write as soon as it is handed over, so that killing the writer loses
nothing; that costs less than packing the record. A reader takes whole records up to the first that is cut off or
damaged and says so. A damaged length, or one beyond what the run's robots can need, ends the reading as well.

The writer holds a lock on the file (flock) until it closes it or ends, however it ends, so a reader can tell a run that
goes on from one that was cut off.
"""

from __future__ import annotations

import fcntl
import io
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

import msgpack
import numpy as np

from patrol.errors import BadInput, Malformed
from patrol.files.untrusted import JOURNAL, open_untrusted
from patrol.journal.decode import decode, is_tick, longest_record
from patrol.journal.links import Drops, Links
from patrol.journal.records import End, Event, Header, Record, TickRecord

_KIND = b"fogwatch journal "
MAGIC = _KIND + b"1\n"
MOST_EVENTS = 1_000_000
REMEDY = "use the version that wrote it, or run the folder's scenario.yaml again"
_FRAME = struct.Struct("<II")
_MOST_ROBOTS = 0xFFFF
"""Robots of the largest fleet, where it is not known how many there are."""


class JournalWriter:
    """Writes a new journal.

    For example:

        with JournalWriter(path, header) as journal:
            journal.write(record)

    Args:
        path: The new file.
        header: The first record.

    Raises:
        OSError: When the file cannot be written; FileExistsError when it exists.
    """

    def __init__(self, path: Path, header: Header) -> None:
        # A writer refuses what its reader would take for damage.
        self._longest = longest_record(len(header.robots))
        self._bytes = 0
        # Unbuffered: each record is one write, so that killing the writer loses nothing.
        self._file = io.FileIO(path, "xb")
        with suppress(OSError):  # not every network drive has locks
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._write_data(
            MAGIC + self._frame_payload(pack(header))
        )  # at once: a journal without its header cannot be read

    def write(self, record: Record) -> None:
        """Append one record; when this returns the operating system has it.

        Args:
            record: Any record but the header.

        Raises:
            OSError: When the file cannot be written.
        """
        self.append(pack(record))

    def append(self, payload: bytes) -> None:
        """Append one record that is packed already; when this returns the operating system has it.

        Args:
            payload: From `pack`.

        Raises:
            OSError: When the file cannot be written.
            ValueError: For a record longer than a reader takes (`patrol.journal.decode.longest_record`).
        """
        self._write_data(self._frame_payload(payload))

    def close(self) -> None:
        """Close the file; closing twice is fine."""
        if not self._file.closed:
            with suppress(OSError):  # a process that was forked from this one may hold the file open
                fcntl.flock(self._file, fcntl.LOCK_UN)
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _frame_payload(self, payload: bytes) -> bytes:
        if len(payload) > self._longest:
            raise ValueError(f"a record of {len(payload)} bytes is longer than {self._longest}")
        return _FRAME.pack(len(payload), zlib.crc32(payload)) + payload

    def _write_data(self, data: bytes) -> None:
        unwritten = memoryview(data)
        try:
            while unwritten:
                unwritten = unwritten[self._file.write(unwritten) :]
        except OSError:
            with suppress(OSError):  # as on a full disk: what is written stays whole
                self._file.truncate(self._file.seek(self._bytes))
            raise
        self._bytes += len(data)


class _Rest(NamedTuple):
    """Facts that take a pass over the whole file."""

    events: tuple[Event, ...]
    end: End | None
    truncated: bool


class Journal:
    """A journal on disk. Ticks are streamed from the file on each pass; the rest is read once, when first needed.

    Attributes:
        path: The file.
        header: Its first record.

    Raises:
        BadInput: On opening and on reading, when an undamaged record is not what a journal holds.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        first = next(iter(_Records(path, None)), None)
        if not isinstance(first, Header):
            raise BadInput(f"{path}: has no complete header, so the run ended before it began; run it again")
        self.header = first

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order, as a new iterator over the file."""
        return (record for record in _Records(self.path, self.header) if isinstance(record, TickRecord))

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
        """True if the file goes on after its last whole record."""
        return self._rest.truncated

    @cached_property
    def _rest(self) -> _Rest:
        records = _Records(self.path, self.header, skip_ticks=True)
        events: list[Event] = []
        end: End | None = None
        for record in records:
            if isinstance(record, Event):
                events.append(record)
            elif isinstance(record, End):
                end = record
            if len(events) > MOST_EVENTS:
                raise BadInput(f"{self.path}: has more than {MOST_EVENTS} events; {REMEDY}")
        return _Rest(tuple(events), end, records.truncated)


def read_journal(path: Path) -> Journal:
    """Open a journal, which may be cut off anywhere or still be growing.

    For example, ``max(tick.mfow for tick in read_journal(path).ticks)`` is the greatest MFoW of a run, in ticks.

    Args:
        path: The file.

    Raises:
        BadInput: For any other file.
    """
    return Journal(path)


class _Records:
    """A pass over a file's whole records; afterwards `truncated` says whether anything else follows them."""

    def __init__(self, path: Path, header: Header | None, skip_ticks: bool = False) -> None:
        self.path = path
        self._header = header
        robots = 0 if header is None else len(header.robots)
        self.truncated = False
        self._robots = robots
        self._longest = longest_record(robots)
        self._skip_ticks = skip_ticks

    def __iter__(self) -> Iterator[Record]:
        try:
            with open_untrusted(self.path, JOURNAL) as file:
                self._check_magic(file.readline(len(MAGIC) + 8))
                for number, payload in enumerate(self._read_payloads(file)):
                    if not (self._skip_ticks and is_tick(payload)):
                        yield self._decode_record(number, payload)
        except OSError as error:
            raise BadInput(f"{self.path}: cannot be read ({error.strerror})") from None

    def _check_magic(self, magic: bytes) -> None:
        if not magic:
            raise BadInput(f"{self.path}: is empty, so the run ended before it began; run it again")
        if not magic.startswith(_KIND):
            raise BadInput(f"{self.path}: is not a fogwatch journal; give the folder of a run")
        # After the kind, so that a journal of another version is called that.
        if magic != MAGIC:
            raise BadInput(f"{self.path}: is a journal of another format, while this version reads format 1; {REMEDY}")

    def _read_payloads(self, file: BinaryIO) -> Iterator[bytes]:
        while frame := file.read(_FRAME.size):
            # Until the record has proved whole.
            self.truncated = True
            if len(frame) < _FRAME.size:
                return
            length, checksum = _FRAME.unpack(frame)
            # A damaged length could ask for gigabytes.
            payload = file.read(length) if length <= self._longest else b""
            if len(payload) != length or zlib.crc32(payload) != checksum:
                return
            self.truncated = False
            yield payload

    def _decode_record(self, number: int, payload: bytes) -> Record:
        try:
            record = decode(payload, self._robots)
            problem = record.problem if isinstance(record, Header) else ""
            if problem := problem or (self._header.unknown(record) if self._header else ""):
                raise Malformed(problem)
            return record
        except Malformed as error:
            problem = f"record {number} is damaged or of another version ({error})"
            raise BadInput(f"{self.path}: {problem}; {REMEDY}") from None


def pack(record: Record) -> bytes:
    """Pack a record as a journal holds it.

    For example, an event is the map ``{"type": "event", "k": 5, "kind": "dead", "robot": 2, "detail": "f1 kill"}``.

    Args:
        record: Any record.
    """
    packed: bytes = msgpack.packb(_plain_record(record))
    return packed


def unpack(payload: bytes) -> Record:
    """Unpack a record that was packed.

    Args:
        payload: From `pack`.

    Raises:
        Malformed: For anything else.
    """
    return decode(payload, _MOST_ROBOTS)


def _plain_record(record: Record) -> dict[str, Any]:
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
    delivered, dropped = record.deliveries, record.dropped
    localised = {"localised": record.localised} if record.localised else {}
    return {
        "type": "tick",
        "k": record.k,
        "robots": [robot.to_values() for robot in record.robots],
        "frames": record.frames,
        "delivered": _grouped_links(delivered)
        if isinstance(delivered, Links)
        else _group_links((*d, "") for d in delivered),
        "dropped": _grouped_links(dropped) if isinstance(dropped, Drops) else _group_links(dropped),
        "copies": _group_links(record.copies),
        "delayed": _group_links(record.delayed),
        "forged": record.forged,
        **localised,
        "mfow": record.mfow,
        "fog_mean": record.fog_mean,
        "seen": record.seen,
    }


def _grouped_links(links: Links | Drops) -> list[tuple[int, int, str, list[int]]]:
    """Group columns as `_group_links` groups rows.

    For example, the links (1, 2, 7) and (1, 3, 7) become (1, 7, "", [2, 3]).
    """
    if not len(links):
        return []
    # True where a link begins a new group: it differs from the one before in more than its destination.
    differs = (links.source[1:] != links.source[:-1]) | (links.sequence[1:] != links.sequence[:-1])
    if isinstance(links, Drops):
        differs |= links.cause[1:] != links.cause[:-1]
    firsts = np.flatnonzero(np.concatenate(([True], differs)))
    whys = [links.causes[cause] for cause in links.cause[firsts]] if isinstance(links, Drops) else [""] * firsts.size
    destinations = links.destination.tolist()
    ends = [*firsts[1:].tolist(), len(destinations)]
    heads = zip(links.source[firsts].tolist(), links.sequence[firsts].tolist(), whys, strict=True)
    spans = zip(firsts.tolist(), ends, strict=True)
    return [(*head, destinations[first:end]) for head, (first, end) in zip(heads, spans, strict=True)]


def _group_links(links: Iterable[tuple[int, int, int, str]]) -> list[tuple[int, int, str, list[int]]]:
    """(source, sequence, cause, destinations): neighbours that differ in the destination alone are drawn together.

    A frame that reaches a whole fleet is one entry; any order of links survives. For example, (1, 2, 7, "") and
    (1, 3, 7, "") become (1, 7, "", [2, 3]).
    """
    groups: list[tuple[int, int, str, list[int]]] = []
    group_key: tuple[int, int, str] | None = None
    destinations: list[int] = []
    for source, destination, sequence, cause in links:
        if group_key != (source, sequence, cause):
            group_key = (source, sequence, cause)
            destinations = []
            groups.append((source, sequence, cause, destinations))
        destinations.append(destination)
    return groups
