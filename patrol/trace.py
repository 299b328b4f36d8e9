"""The trace hash: one number for everything that happened in a run, and nothing that a clock decides."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable
from itertools import chain

from patrol.records import TickRecord

_COUNTED = struct.Struct("<qI")
_ROBOT = struct.Struct("<HB5d")
_LAST = struct.Struct("<Iq")
_SHORT = 2**32 - 1


class TraceHash:
    """SHA-256 over the ticks of a run.

    Each tick, little-endian: k (i64), number of robots (u32); per robot in roster order its number (u16), status (u8),
    x, y, heading and the command's two numbers (f64 each); the deliveries sorted, as source (u16), destination (u16)
    and sequence (u32, or u64 where 32 bits do not hold it); how many there were (u32) and the true MFoW in ticks (i64).
    Diagnostics and wall times have no part in it.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        parts = [_COUNTED.pack(record.k, len(record.robots))]
        parts += [
            _ROBOT.pack(robot.number, robot.status, robot.x, robot.y, robot.heading, robot.c0, robot.c1)
            for robot in record.robots
        ]
        deliveries = sorted(record.deliveries)
        shape = "".join("HHI" if sequence <= _SHORT else "HHQ" for _, _, sequence in deliveries)
        parts.append(struct.Struct("<" + shape).pack(*chain.from_iterable(deliveries)))
        parts.append(_LAST.pack(len(record.deliveries), record.mfow))
        self._hash.update(b"".join(parts))

    def hexdigest(self) -> str:
        """The hash of the ticks so far, 64 hex digits."""
        return self._hash.hexdigest()


def trace_hash(ticks: Iterable[TickRecord]) -> str:
    """The trace hash of a whole run."""
    trace = TraceHash()
    for record in ticks:
        trace.tick(record)
    return trace.hexdigest()
