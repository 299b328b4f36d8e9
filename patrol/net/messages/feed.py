"""What the world publishes of a run while it goes on: the journal, in batches, and for a late viewer all before.

    truth/ticks    `Batch`      the journal's records as they are written, several at a time; a batch may be lost
    truth/fog      `SoFar`      the answer to a query under this key: all that a viewer needs to begin with

Records are numbered from 0, the header. A viewer that misses some finds a gap in the numbers, and queries the fog
again. Nothing that decides anything reads any of this.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from patrol.net.messages.packed import Reader, Unexpected
from patrol.net.settings import MAX_MESSAGE

TICKS = "ticks"
FOG = "fog"
"""The last parts of the keys (`patrol.net.keys.FleetKeys.truth`)."""

MAX_BATCH = MAX_MESSAGE
"""Bytes of the longest batch that a viewer looks at."""

MAX_RECORDS = 4096
"""Records of the longest batch; the world sends a batch at 32 kB, and no record is shorter than 8 bytes."""

MAX_NUMBER = 1 << 40
"""The greatest number of a record: more than any run has."""

MAX_ANSWER = MAX_MESSAGE
"""Bytes of the longest answer that a viewer looks at."""

MAX_GRIDS = 300_000_000
"""Bytes that the grids of an answer may take as arrays: with one kind of body, those of 37 million points."""

MAX_TICKS_BEFORE = 1 << 25
"""Ticks of the longest run that can be joined late; the fog keeps a number for each of them."""

MAX_EVENTS = 1 << 17
"""Events in an answer: the latest ones, and those of operators."""

MAX_SERIES = 1 << 14
"""Points of each curve in an answer."""

MAX_AREAS = 1 << 16
"""Kinds of bodies, and robots, of the largest fleet."""

MAX_FIELDS = 64
"""Fields of an answer, with room for those of later versions."""

MAX_PACE = 1e12
"""The greatest factor of real time."""

_LEVEL = 1


class Garbled(ValueError):
    """Bytes that are neither a batch nor an answer."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Records of the journal, packed as it holds them (`patrol.journal.file.unpack`).

    A batch may be empty, where only `running` or `pace` has changed.

    Attributes:
        first: The number of the first record.
        records: In order.
        running: Whether ticks go on by themselves.
        pace: The requested factor of real time, None for as fast as possible.
    """

    first: int
    records: tuple[bytes, ...]
    running: bool
    pace: float | None


@dataclass(frozen=True, eq=False)
class Ground:
    """The grids of a run, none of which ever changes: bool (h, w).

    Attributes:
        passable: False is an obstacle.
        keep_out: True where bodies may not go.
        areas: What robots can see, one for each kind of body.
        area_of: By robot number, the index of its area.
    """

    passable: NDArray[np.bool_]
    keep_out: NDArray[np.bool_]
    areas: tuple[NDArray[np.bool_], ...]
    area_of: Mapping[int, int]

    @property
    def patrolled(self) -> NDArray[np.bool_]:
        """What some robot can see."""
        return np.asarray(np.logical_or.reduce(self.areas), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class SoFar:
    """A run up to now.

    Attributes:
        number: Of the next record.
        header: Packed record.
        last: Packed record of the newest tick, or None.
        last_seen: int32 (h, w), of the true fog after that tick.
        events: Packed records, the latest ones.
        event: How many events there were before those.
        asked: Packed records, all events of operators' controls.
        every: Distance in ticks between the values of the series.
        mfow: float32, ticks, of every `every`-th tick from the first on.
        fog_mean: float32, ticks, the same.
        running: Whether ticks go on by themselves.
        pace: The requested factor of real time, None for as fast as possible.
        ground: The grids.
    """

    number: int
    header: bytes
    last: bytes | None
    last_seen: NDArray[np.int32]
    events: tuple[bytes, ...]
    event: int
    asked: tuple[bytes, ...]
    every: int
    mfow: NDArray[np.float32]
    fog_mean: NDArray[np.float32]
    running: bool
    pace: float | None
    ground: Ground


def batch_bytes(batch: Batch) -> bytes:
    """A batch as it is sent.

    Args:
        batch: To send.
    """
    packed: bytes = msgpack.packb([batch.first, batch.records, batch.running, batch.pace])
    return packed


def read_batch(payload: bytes) -> Batch:
    """The batch in a payload.

    Args:
        payload: Any bytes.

    Raises:
        Garbled: For anything but a batch.
    """
    try:
        reader = Reader(payload)
        if reader.array(4) != 4:
            raise Garbled("not a batch")
        first = reader.value()
        records = tuple(reader.values(bytes, MAX_RECORDS))
        running, pace = reader.value(), reader.value()
        reader.end()
    except Unexpected as error:
        raise Garbled(f"not a batch ({error})") from None
    if type(first) is not int or not 0 <= first <= MAX_NUMBER or not _is_manner(running, pace):
        raise Garbled("not a batch")
    return Batch(first, records, running, pace)


def longest_record(robots: int) -> int:
    """Bytes of the longest record that a viewer unpacks; objects take many times the bytes that they are packed in.

    Args:
        robots: In the roster. Each has a row, frames, and links to all others.
    """
    return min(MAX_BATCH, (1 << 17) + (robots << 11) + (robots * robots << 6))


def so_far_bytes(so_far: SoFar) -> bytes:
    """An answer as it is sent; takes a while for a large terrain.

    Args:
        so_far: To send.
    """
    ground = so_far.ground
    patrolled = ground.patrolled
    packed: bytes = msgpack.packb(
        {
            "number": so_far.number,
            "header": so_far.header,
            "last": so_far.last,
            "shape": patrolled.shape,
            "passable": _bits(ground.passable),
            "keep_out": _bits(ground.keep_out),
            "areas": [_bits(area) for area in ground.areas],
            "area_of": list(ground.area_of.items()),
            "seen": zlib.compress(so_far.last_seen[patrolled].astype("<i4").tobytes(), _LEVEL),
            "events": so_far.events,
            "event": so_far.event,
            "asked": so_far.asked,
            "every": so_far.every,
            "mfow": so_far.mfow.astype("<f4").tobytes(),
            "fog_mean": so_far.fog_mean.astype("<f4").tobytes(),
            "running": so_far.running,
            "pace": so_far.pace,
        }
    )
    return packed


def read_so_far(
    payload: bytes, known: SoFar | None = None, fits: Callable[[bytes, int, int], bool] = lambda *_: True
) -> SoFar:
    """The answer in a payload. Nothing is decompressed before its size is known and allowed.

    Args:
        payload: Any bytes.
        known: An earlier answer of the same run, whose grids are kept; None for the first.
        fits: Says of the header and the terrain's height and width whether they can be of one run.

    Raises:
        Garbled: For anything but an answer, for one of another run than `known`, and for one too large.
    """
    if len(payload) > MAX_ANSWER:
        raise Garbled(f"an answer of {len(payload)} bytes")
    try:
        says = _fields(Reader(payload))
        header = _bytes(says["header"])
        height, width = says["shape"]
        if not 0 < height * width <= MAX_GRIDS or min(height, width) <= 0 or not fits(header, height, width):
            raise Garbled("a terrain of another size than its run has")
        if known is not None and (header != known.header or (height, width) != known.last_seen.shape):
            raise Garbled("an answer of another run")
        # By point: two grids, one for each kind of body, one for all of them, and four bytes of the fog.
        if height * width * (7 + len(says["areas"])) > MAX_GRIDS:
            raise Garbled(f"{len(says['areas'])} kinds of bodies on {height} x {width} points take too much memory")
        ground = known.ground if known is not None else _ground(says, height, width)
        return _so_far(says, header, ground)
    except (KeyError, TypeError, ValueError, OverflowError, zlib.error, MemoryError) as error:
        if isinstance(error, Garbled):
            raise
        raise Garbled(f"not an answer ({type(error).__name__})") from None


def _fields(reader: Reader) -> dict[str, Any]:
    """The fields of an answer; those that are not known may hold single values only."""
    arrays: Mapping[str, tuple[type, int]] = {
        "shape": (int, 2),
        "areas": (bytes, MAX_AREAS),
        "events": (bytes, MAX_EVENTS),
        "asked": (bytes, MAX_EVENTS),
    }
    says: dict[str, Any] = {}
    for _ in range(reader.mapping(MAX_FIELDS)):
        name = reader.value()
        if name in arrays:
            says[name] = reader.values(*arrays[name])
        elif name == "area_of":
            says[name] = [reader.values(int, 2) for _ in range(reader.array(MAX_AREAS))]
        else:
            says[name] = reader.value()
    reader.end()
    return says


def _ground(says: Mapping[str, Any], height: int, width: int) -> Ground:
    areas = says["areas"]
    area_of: dict[int, int] = dict(says["area_of"])
    if not areas or not all(0 <= area < len(areas) for area in area_of.values()):
        raise Garbled("no patrolled area")
    grids = [_grid(_bytes(says[name]), height, width) for name in ("passable", "keep_out")]
    return Ground(grids[0], grids[1], tuple(_grid(area, height, width) for area in areas), area_of)


def _so_far(says: Mapping[str, Any], header: bytes, ground: Ground) -> SoFar:
    patrolled = ground.patrolled
    if not patrolled.any():
        raise Garbled("no patrolled ground")
    last_seen = np.full(patrolled.shape, -1, dtype=np.int32)
    seen = np.frombuffer(_inflated(_bytes(says["seen"]), 4 * int(patrolled.sum())), dtype="<i4")
    last_seen[patrolled] = seen
    mfow, fog_mean = (_curve(says[name]) for name in ("mfow", "fog_mean"))
    every, number = _whole(says["every"]), _whole(says["number"])
    ticks = every * len(mfow)
    if not 1 <= every <= MAX_TICKS_BEFORE or len(mfow) != len(fog_mean) or ticks > MAX_TICKS_BEFORE + every:
        raise Garbled("no curves")
    if int(seen.min()) < -1 or int(seen.max()) >= max(ticks, 1) or ticks - every >= max(number, 1):
        raise Garbled("points seen after the last tick")
    if not _is_manner(says["running"], says["pace"]):
        raise Garbled("no pace")
    return SoFar(
        number=number,
        header=header,
        last=None if says["last"] is None else _bytes(says["last"]),
        last_seen=last_seen,
        events=tuple(says["events"]),
        event=_whole(says["event"]),
        asked=tuple(says["asked"]),
        every=every,
        mfow=mfow,
        fog_mean=fog_mean,
        running=says["running"],
        pace=says["pace"],
        ground=ground,
    )


def _whole(value: object) -> int:
    if type(value) is not int or not 0 <= value <= MAX_NUMBER:
        raise Garbled("not a whole number")
    return value


def _bytes(value: object) -> bytes:
    if type(value) is not bytes:
        raise Garbled("not bytes")
    return value


def _curve(packed: object) -> NDArray[np.float32]:
    values = np.frombuffer(_bytes(packed), dtype="<f4").astype(np.float32)
    if len(values) > MAX_SERIES or not np.isfinite(values).all():
        raise Garbled("no curve")
    return values


def _is_manner(running: object, pace: object) -> bool:
    return type(running) is bool and (pace is None or (type(pace) is float and 0.0 < pace <= MAX_PACE))


def _bits(grid: NDArray[np.bool_]) -> bytes:
    return zlib.compress(np.packbits(grid).tobytes(), _LEVEL)


def _grid(packed: bytes, height: int, width: int) -> NDArray[np.bool_]:
    points = height * width
    bits = np.frombuffer(_inflated(packed, -(-points // 8)), dtype=np.uint8)
    return np.unpackbits(bits, count=points).reshape(height, width).astype(np.bool_)


def _inflated(packed: bytes, size: int) -> bytes:
    """Decompress to at most `size` bytes; Garbled when there are fewer."""
    inflater = zlib.decompressobj()
    data = inflater.decompress(packed, size)
    if len(data) != size:
        raise Garbled("too short")
    return data


def thinned(values: Sequence[float], every: int) -> NDArray[np.float32]:
    """Every n-th of the values, as a copy: the values may grow while somebody still looks at these.

    Args:
        values: The series.
        every: n.

    Returns:
        float32.
    """
    return np.array(values, dtype=np.float32)[::every]
