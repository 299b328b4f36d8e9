"""What the world publishes of a run while it goes on: the journal, in batches, and for a late viewer all before.

    truth/ticks    `Batch`      the journal's records as they are written, several at a time; a batch may be lost
    truth/fog      `SoFar`      the answer to a query under this key: all that a viewer needs to begin with

Records are numbered from 0, the header. A viewer that misses some finds a gap in the numbers, and queries the fog
again. Nothing that decides anything reads any of this.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

TICKS = "ticks"
FOG = "fog"
"""The last parts of the keys (`patrol.net.keys.FleetKeys.truth`)."""

MAX_BATCH = 1 << 25
"""Bytes of the longest batch that a viewer looks at."""

MAX_POINTS = 1 << 27
"""Points of the largest terrain that a viewer takes."""

_LEVEL = 1


class Garbled(ValueError):
    """Bytes that are neither a batch nor an answer."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Records of the journal, packed as it holds them (`patrol.journal.file.unpack`).

    A batch may be empty, where only `running` or `pace` has changed.

    Attributes:
        first: the number of the first record.
        records: in order.
        running: whether ticks go on by themselves.
        pace: the requested factor of real time, None for as fast as possible.
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
        areas: what robots can see, one for each kind of body.
        area_of: by robot number, the index of its area.
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
        number: of the next record.
        header: packed record.
        last: packed record of the newest tick, or None.
        last_seen: int32 (h, w), of the true fog after that tick.
        events: packed records, the latest ones.
        event: how many events there were before those.
        asked: packed records, all events of operators' controls.
        every: distance in ticks between the values of the series.
        mfow: float32, ticks, of every `every`-th tick from the first on.
        fog_mean: float32, ticks, the same.
        running: whether ticks go on by themselves.
        pace: the requested factor of real time, None for as fast as possible.
        ground: the grids.
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
        batch: to send.
    """
    packed: bytes = msgpack.packb([batch.first, batch.records, batch.running, batch.pace])
    return packed


def read_batch(payload: bytes) -> Batch:
    """The batch in a payload.

    Args:
        payload: any bytes.

    Raises:
        Garbled: for anything but a batch.
    """
    says = _unpacked(payload)
    if not isinstance(says, list) or len(says) != 4:
        raise Garbled("not a batch")
    first, records, running, pace = says
    fits = isinstance(records, list) and all(isinstance(record, bytes) for record in records)
    if type(first) is not int or first < 0 or not fits or not _is_manner(running, pace):
        raise Garbled("not a batch")
    return Batch(first, tuple(records), running, pace)


def so_far_bytes(so_far: SoFar) -> bytes:
    """An answer as it is sent; takes a while for a large terrain.

    Args:
        so_far: to send.
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


def read_so_far(payload: bytes) -> SoFar:
    """The answer in a payload.

    Args:
        payload: any bytes.

    Raises:
        Garbled: for anything but an answer.
    """
    says = _unpacked(payload)
    if not isinstance(says, dict):
        raise Garbled("not an answer")
    try:
        height, width = (int(side) for side in says["shape"])
        if not (height > 0 and width > 0 and height * width <= MAX_POINTS) or not _is_manner(
            says["running"], says["pace"]
        ):
            raise Garbled("no terrain")
        ground = Ground(
            _grid(says["passable"], height, width),
            _grid(says["keep_out"], height, width),
            tuple(_grid(area, height, width) for area in says["areas"]),
            {int(number): int(area) for number, area in says["area_of"]},
        )
        if not ground.areas or any(not 0 <= area < len(ground.areas) for area in ground.area_of.values()):
            raise Garbled("no patrolled area")
        patrolled = ground.patrolled
        last_seen = np.full((height, width), -1, dtype=np.int32)
        last_seen[patrolled] = np.frombuffer(_inflated(says["seen"], 4 * int(patrolled.sum())), dtype="<i4")
        return SoFar(
            number=int(says["number"]),
            header=bytes(says["header"]),
            last=None if says["last"] is None else bytes(says["last"]),
            last_seen=last_seen,
            events=tuple(bytes(event) for event in says["events"]),
            event=max(0, int(says["event"])),
            asked=tuple(bytes(event) for event in says["asked"]),
            every=max(1, int(says["every"])),
            mfow=np.frombuffer(says["mfow"], dtype="<f4").astype(np.float32),
            fog_mean=np.frombuffer(says["fog_mean"], dtype="<f4").astype(np.float32),
            running=says["running"],
            pace=says["pace"],
            ground=ground,
        )
    except (KeyError, TypeError, ValueError, zlib.error, MemoryError) as error:
        raise Garbled(f"not an answer ({type(error).__name__})") from None


def _unpacked(payload: bytes) -> Any:
    try:
        return msgpack.unpackb(payload, raw=False, strict_map_key=True)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise Garbled(f"not msgpack ({type(error).__name__})") from None


def _is_manner(running: object, pace: object) -> bool:
    return type(running) is bool and (pace is None or (type(pace) is float and pace > 0.0))


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
        values: the series.
        every: n.

    Returns:
        float32.
    """
    return np.array(values, dtype=np.float32)[::every]
