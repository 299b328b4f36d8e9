"""The journal of a run as the world publishes it: in batches, and for a late viewer all earlier ones.

    truth/ticks    `Batch`      the journal's records as they are written, several at a time; a batch may be lost
    truth/fog      `SoFar`      the answer to a query under this key: all that a viewer needs to begin with

Records are numbered from 0, the header. A viewer that misses some finds a gap in the numbers, and queries the fog
again. Nothing that decides anything reads any of this.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any

import msgpack
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from patrol.errors import Malformed
from patrol.wire import NO_WHOLE, Bytes, Flag, Row, read_sparingly
from runtime.net.settings import MAX_MESSAGE

TICKS = "ticks"
FOG = "fog"
"""The last parts of the keys (`runtime.security.keys.FleetKeys.truth`)."""

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
"""Events in an answer: the latest ones, and those of operators and of the ground."""

MAX_SERIES = 1 << 14
"""Points of each curve in an answer."""

MAX_AREAS = 1 << 16
"""Kinds of bodies, and robots, of the largest fleet."""

MAX_PACE = 1e12
"""The greatest factor of real time."""

_LEVEL = 1


_Whole = Annotated[int, Field(strict=True, ge=0, le=MAX_NUMBER)]
_Pace = Annotated[float, Field(strict=True, gt=0.0, le=MAX_PACE), NO_WHOLE]
_Number = Annotated[int, Field(strict=True)]
_Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0), NO_WHOLE]
_Size = Annotated[int, Field(strict=True, ge=1, le=MAX_GRIDS)]
_Curve = Annotated[Bytes, Field(max_length=4 * MAX_SERIES)]
_Records = Annotated[tuple[Bytes, ...], Field(max_length=MAX_EVENTS, fail_fast=True)]


@dataclass(frozen=True, slots=True)
class Batch(Row):
    """Records of the journal, packed as it holds them (`patrol.journal.file.unpack`); read sparingly.

    A batch may be empty, where only `running` or `pace` has changed.
    """

    first: _Whole  # the number of the first record
    records: Annotated[tuple[Bytes, ...], Field(max_length=MAX_RECORDS, fail_fast=True)]
    running: Flag  # whether ticks go on by themselves
    pace: _Pace | None  # the requested factor of real time; None for as fast as possible


@dataclass(frozen=True, eq=False)
class Ground:
    """The grids of a run, none of which ever changes: bool (h, w)."""

    passable: NDArray[np.bool_]  # False is an obstacle
    keep_out: NDArray[np.bool_]  # True where bodies may not go
    areas: tuple[NDArray[np.bool_], ...]  # the ground that robots can see, one for each kind of body
    area_of: Mapping[int, int]  # by robot number, the index of its area

    @property
    def patrolled(self) -> NDArray[np.bool_]:
        """The ground that at least one robot can see, bool (height, width)."""
        return np.asarray(np.logical_or.reduce(self.areas), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class SoFar:
    """A run up to now."""

    number: int  # of the next record
    header: bytes  # packed record
    last: bytes | None  # packed record of the newest tick, None before the first
    last_seen: NDArray[np.int32]  # (h, w), of the true fog after that tick; -1 is never
    events: tuple[bytes, ...]  # packed records, the latest ones
    event: int  # number of events before those
    asked: tuple[bytes, ...]  # packed: all of operators' controls, the latest of each part of the ground
    every: int  # ticks between the values of the series
    mfow: NDArray[np.float32]  # ticks
    fog_mean: NDArray[np.float32]  # ticks
    running: bool  # ticks go on by themselves
    pace: float | None  # requested factor of real time, None for as fast as possible
    charge: Mapping[int, float]  # share left in each battery after that tick, by robot number
    ground: Ground


def batch_bytes(batch: Batch) -> bytes:
    """Pack a batch."""
    packed: bytes = msgpack.packb(batch.to_values())
    return packed


def longest_record(robots: int) -> int:
    """Return the length in bytes of the longest record that a viewer unpacks, for a roster of `robots`.

    Objects take many times their packed bytes.

    For example, 157,952 bytes for 10 robots.
    """
    return min(MAX_BATCH, (1 << 17) + (robots << 11) + (robots * robots << 6))


@dataclass(frozen=True, slots=True)
class _Answer:
    """A `SoFar` as it is sent: grids and numbers compressed, curves as float32."""

    number: _Whole
    header: Bytes
    last: Bytes | None
    shape: tuple[_Size, _Size]
    passable: Bytes
    keep_out: Bytes
    areas: Annotated[tuple[Bytes, ...], Field(min_length=1, max_length=MAX_AREAS, fail_fast=True)]
    area_of: Annotated[tuple[tuple[_Number, _Whole], ...], Field(max_length=MAX_AREAS, fail_fast=True)]
    seen: Bytes
    events: _Records
    event: _Whole
    asked: _Records
    every: Annotated[_Whole, Field(ge=1, le=MAX_TICKS_BEFORE)]
    mfow: _Curve
    fog_mean: _Curve
    running: Flag
    pace: _Pace | None
    charge: Annotated[tuple[tuple[_Number, _Share], ...], Field(max_length=MAX_AREAS, fail_fast=True)]


def so_far_bytes(so_far: SoFar) -> bytes:
    """Pack an answer; takes a while for a large terrain."""
    ground = so_far.ground
    patrolled = ground.patrolled
    grids = {
        "shape": patrolled.shape,
        "passable": _pack_grid(ground.passable),
        "keep_out": _pack_grid(ground.keep_out),
        "areas": [_pack_grid(area) for area in ground.areas],
        "area_of": list(ground.area_of.items()),
        "charge": list(so_far.charge.items()),
        "seen": zlib.compress(so_far.last_seen[patrolled].astype("<i4").tobytes(), _LEVEL),
        "mfow": so_far.mfow.astype("<f4").tobytes(),
        "fog_mean": so_far.fog_mean.astype("<f4").tobytes(),
    }
    names = [field.name for field in fields(_Answer)]
    packed: bytes = msgpack.packb({name: grids[name] if name in grids else getattr(so_far, name) for name in names})
    return packed


def read_so_far(
    payload: bytes, known: SoFar | None = None, fits: Callable[[bytes, int, int], bool] = lambda *_: True
) -> SoFar:
    """Read the answer in a payload, whose grids are those of `known` where that is given.

    Nothing is decompressed before its size is known and allowed. `fits` says of the header and the terrain's height and
    width whether they can be of one run. An answer of another run than `known`'s is malformed, like any other bytes.
    """
    if len(payload) > MAX_ANSWER:
        raise Malformed(f"an answer of {len(payload)} bytes")
    answer = read_sparingly(_Answer, payload)
    header, (height, width) = answer.header, answer.shape
    if not fits(header, height, width):
        raise Malformed("a terrain of another size than its run has")
    if known is not None and (header != known.header or (height, width) != known.last_seen.shape):
        raise Malformed("an answer of another run")
    # By point: two grids, one for each kind of body, one for all of them, and four bytes of the fog.
    # Checked before anything is decompressed.
    if height * width * (7 + len(answer.areas)) > MAX_GRIDS:
        raise Malformed(f"{len(answer.areas)} kinds of bodies on {height} x {width} points take too much memory")
    try:
        ground = known.ground if known is not None else _decode_ground(answer)
        return _so_far(answer, ground)
    except (zlib.error, MemoryError) as error:
        raise Malformed(f"not an answer ({type(error).__name__})") from None


def _decode_ground(answer: _Answer) -> Ground:
    if any(area >= len(answer.areas) for _, area in answer.area_of):
        raise Malformed("no patrolled area")
    passable, keep_out, *areas = [
        _unpack_grid(bits, *answer.shape) for bits in (answer.passable, answer.keep_out, *answer.areas)
    ]
    return Ground(passable, keep_out, tuple(areas), dict(answer.area_of))


def _so_far(answer: _Answer, ground: Ground) -> SoFar:
    patrolled = ground.patrolled
    if not patrolled.any():
        raise Malformed("no patrolled ground")
    last_seen = np.full(patrolled.shape, -1, dtype=np.int32)
    latest = np.frombuffer(_inflate_bytes(answer.seen, 4 * int(patrolled.sum())), dtype="<i4")
    last_seen[patrolled] = latest
    mfow, fog_mean = _decode_curve(answer.mfow), _decode_curve(answer.fog_mean)
    ticks = answer.every * len(mfow)
    if len(mfow) != len(fog_mean) or ticks > MAX_TICKS_BEFORE + answer.every:
        raise Malformed("no curves")
    # Curves tell how many ticks there were; a viewer computes ages from both.
    if int(latest.min()) < -1 or int(latest.max()) >= max(ticks, 1) or ticks - answer.every >= max(answer.number, 1):
        raise Malformed("points seen after the last tick")
    arrays: dict[str, Any] = {"last_seen": last_seen, "mfow": mfow, "fog_mean": fog_mean, "ground": ground}
    arrays |= {"charge": dict(answer.charge)}
    as_sent: dict[str, Any] = {
        field.name: getattr(answer, field.name) for field in fields(SoFar) if field.name not in arrays
    }
    return SoFar(**as_sent, **arrays)


def _decode_curve(packed: bytes) -> NDArray[np.float32]:
    curve = np.frombuffer(packed[: len(packed) // 4 * 4], dtype="<f4").astype(np.float32)
    if len(packed) % 4 or not np.isfinite(curve).all():
        raise Malformed("no curve")
    return curve


def _pack_grid(grid: NDArray[np.bool_]) -> bytes:
    return zlib.compress(np.packbits(grid).tobytes(), _LEVEL)


def _unpack_grid(packed: bytes, height: int, width: int) -> NDArray[np.bool_]:
    points = height * width
    bits = np.frombuffer(_inflate_bytes(packed, -(-points // 8)), dtype=np.uint8)
    return np.unpackbits(bits, count=points).reshape(height, width).astype(np.bool_)


def _inflate_bytes(packed: bytes, size: int) -> bytes:
    """Decompress to at most `size` bytes; Malformed when there are fewer.

    For example, a stranger's 1 kB that would inflate to 1 GB costs `size` bytes of memory at most.
    """
    inflater = zlib.decompressobj()
    inflated = inflater.decompress(packed, size)
    if len(inflated) != size:
        raise Malformed("too short")
    return inflated


def thinned(values: Sequence[float], every: int) -> NDArray[np.float32]:
    """Copy every n-th of the values as float32; the series may grow while the copy is still read.

    For example, of 0, 1, 2, 3, 4, 5, 6 every third gives 0, 3, 6.
    """
    return np.array(values, dtype=np.float32)[::every]
