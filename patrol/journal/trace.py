"""The trace hash: one number for everything that happened in a run, and nothing that a clock decides."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Collection, Iterable
from itertools import chain

import numpy as np

from patrol.journal.links import MAX_SHORT, Links, WholeLinks, links_of, places_of
from patrol.journal.records import Status, TickRecord

_COUNTED = struct.Struct("<qI")
_ROBOT = struct.Struct("<HB5d")
_LAST = struct.Struct("<Iq")


class TraceHash:
    """SHA-256 over the ticks of a run.

    Each tick, little-endian: k (i64), number of robots (u32); per robot in roster order its number (u16), status (u8),
    x, y, heading and the command's two numbers (f64 each); the deliveries sorted, as source (u16), destination (u16)
    and sequence (u32, or u64 where 32 bits do not hold it); how many there were (u32) and the true MFoW in ticks (i64).
    Diagnostics and wall times have no part in it. A spare robot is no robot of a tick before it has joined, so that
    robots that might have joined leave the hash as it is without them.
    """

    def __init__(self, spares: Collection[int] = ()) -> None:
        """Begin before the first tick."""
        self._hash = hashlib.sha256()
        self._spares = frozenset(spares)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        robots = [row for row in record.robots if row.status is not Status.ABSENT or row.number not in self._spares]
        parts = [_COUNTED.pack(record.k, len(robots))]
        parts += [
            _ROBOT.pack(robot.number, robot.status, robot.x, robot.y, robot.heading, robot.c0, robot.c1)
            for robot in robots
        ]
        self._hash.update(b"".join(parts))
        links = links_of(record.deliveries)
        self._hash.update(_pack_deliveries(links))
        self._hash.update(_LAST.pack(len(links), record.mfow))

    def hexdigest(self) -> str:
        """Return the hash of the ticks so far, 64 hex digits."""
        return self._hash.hexdigest()


def _pack_deliveries(links: Links) -> bytes:
    """Return the deliveries of a tick, sorted."""
    if isinstance(links, WholeLinks) and links.pairs.rises and not (links.of_frames > MAX_SHORT).any():
        return (links.pairs.robots | (links.of_frames << 32)[links.pairs.frame]).astype("<i8", copy=False).tobytes()
    source, destination, sequence = links.source, links.destination, links.sequence
    places = places_of(links)
    # Nearly always sorted already: asking is far faster than sorting.
    if places is None or (places[1:] < places[:-1]).any():
        order = np.lexsort((sequence, destination, source))
        source, destination, sequence = source[order], destination[order], sequence[order]
    if places is not None:
        # The least significant bits come first in little-endian: source, destination, sequence.
        words = destination << 16
        words |= source
        words |= sequence << 32
        return words.astype("<i8", copy=False).tobytes()
    shape = "".join("HHI" if sequence_number <= MAX_SHORT else "HHQ" for sequence_number in sequence.tolist())
    rows = zip(source.tolist(), destination.tolist(), sequence.tolist(), strict=True)
    return struct.Struct("<" + shape).pack(*chain.from_iterable(rows))


def trace_hash(ticks: Iterable[TickRecord], spares: Collection[int] = ()) -> str:
    """Return the trace hash of a whole run, 64 hex digits, from its ticks in order.

    For example, of a finished run without spare robots ``trace_hash(journal.ticks) == journal.end.trace_hash``.
    """
    trace = TraceHash(spares)
    for record in ticks:
        trace.tick(record)
    return trace.hexdigest()
