"""The position message: the only thing robots tell each other.

A frame is one msgpack array

    [version, robot, sequence, time_ms, x_cm, y_cm, heading_mrad]  +  [trail]  +  [tag]

of small integers. `trail`, when there, is a flat array ``[dx1, dy1, dx2, dy2, ...]`` of centimetres: ``(dx1, dy1)``
leads from this position to the one before it, ``(dx2, dy2)`` from there to the one before that. `tag`, when there, is
an 8-byte msgpack *bin*: keyed BLAKE2b over every byte before the bin's own two-byte header. An array and a bin cannot
be confused, so no flag says which of the two a frame carries. The longest bare frame is 28 bytes, with the longest
trail and a tag 63; no frame above `MAX_FRAME` is looked at.

Numbers are rounded to the nearest unit (ties to even), headings to the nearest milliradian round the circle.
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from enum import StrEnum
from hashlib import blake2b
from typing import Any

import msgpack

from patrol.pose import TAU, Pose, wrap
from patrol.radio.units import CM_PER_M, MRAD_PER_RAD, cm_to_m, rad_to_mrad, s_to_ms

VERSION = 1
MAX_FRAME = 64
CONTACT = 0
"""The robot number of a contact: an intruder's position, reported by a robot that sees it."""

MAX_CONTACTS = 4
"""Contacts that a robot reports in one tick."""

MAX_FRAMES = 1 + MAX_CONTACTS
"""Frames that a robot sends in one tick: its own position first, then its contacts."""

MAX_TRAIL = 4
MAX_KEY = 64
MAX_ROBOT = 0xFFFF
MAX_SEQUENCE = 0xFFFF_FFFF
MAX_TIME_MS = 0xFFFF_FFFF
MAX_CM = 0x7FFF_FFFF
MIN_CM = -MAX_CM - 1
MAX_STEP_CM = 0x7FFF
MIN_STEP_CM = -MAX_STEP_CM - 1
MAX_HEADING_MRAD = 6283

_RANGES = {
    "robot": (0, MAX_ROBOT),
    "sequence": (0, MAX_SEQUENCE),
    "time_ms": (0, MAX_TIME_MS),
    "x_cm": (MIN_CM, MAX_CM),
    "y_cm": (MIN_CM, MAX_CM),
    "heading_mrad": (0, MAX_HEADING_MRAD),
}
_FIELDS = 7
_LONGEST_BARE = 28
_LONGEST_STEP = 6
_TAG_BYTES = 8
_TAG_HEADER = b"\xc4\x08"
_TAG_LENGTH = len(_TAG_HEADER) + _TAG_BYTES
_NEARER_TO_ZERO = (MAX_HEADING_MRAD + rad_to_mrad(TAU)) / 2.0
"""Headings beyond it, mrad, are nearer to a whole turn than to the largest heading."""


class RejectReason(StrEnum):
    """Why a frame was dropped."""

    MALFORMED = "malformed"
    VERSION = "version"
    TAG = "tag"
    OWN = "own"
    UNKNOWN = "unknown"
    OUTSIDE = "outside"
    OLD = "old"
    AHEAD = "ahead"
    TOO_FAST = "too_fast"


class Rejected(Exception):
    """A frame that must not be used, and why."""

    def __init__(self, reason: RejectReason, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Position:
    """Where a robot says it is, in the units of the wire.

    Attributes:
        robot: 1..65535, or 0 for a *contact* (an intruder's position reported by a robot).
        sequence: 0..2^32-1, one more each step.
        time_ms: 0..2^32-1, ms of the sender's clock.
        x_cm: cm, signed 32 bits.
        y_cm: cm, signed 32 bits.
        heading_mrad: 0..6283.
        trail: Up to `MAX_TRAIL` pairs of cm, signed 16 bits, newest first.

    Raises:
        ValueError: For anything else.
    """

    robot: int
    sequence: int
    time_ms: int
    x_cm: int
    y_cm: int
    heading_mrad: int
    trail: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        robot, sequence, time_ms, heading_mrad = self.robot, self.sequence, self.time_ms, self.heading_mrad
        x_cm, y_cm = self.x_cm, self.y_cm
        # All at once, without the table: every frame is checked, and hardly any is wrong.
        if not (
            type(robot) is type(sequence) is type(time_ms) is type(x_cm) is type(y_cm) is type(heading_mrad) is int
            and 0 <= robot <= MAX_ROBOT
            and 0 <= sequence <= MAX_SEQUENCE
            and 0 <= time_ms <= MAX_TIME_MS
            and MIN_CM <= x_cm <= MAX_CM
            and MIN_CM <= y_cm <= MAX_CM
            and 0 <= heading_mrad <= MAX_HEADING_MRAD
        ):
            raise ValueError(next(wrong for name in _RANGES if (wrong := _wrong(name, getattr(self, name)))))
        if self.trail:
            self._check_trail()

    def _check_trail(self) -> None:
        if len(self.trail) > MAX_TRAIL:
            raise ValueError(f"trail has {len(self.trail)} positions, at most {MAX_TRAIL} fit")
        for dx, dy in self.trail:
            if not (type(dx) is type(dy) is int and min(dx, dy) >= MIN_STEP_CM and max(dx, dy) <= MAX_STEP_CM):
                raise ValueError(f"trail has a step that is no pair of integers in {MIN_STEP_CM}..{MAX_STEP_CM}")

    @classmethod
    def of(
        cls, robot: int, sequence: int, time_s: float, pose: Pose, trail: tuple[tuple[int, int], ...] = ()
    ) -> Position:
        """The position to send for a pose.

        Args:
            robot: The sender's number.
            sequence: The tick.
            time_s: Of the sender's clock, s.
            pose: m and rad.
            trail: Steps back to earlier positions, cm.

        Raises:
            ValueError: When a number does not fit.
        """
        try:
            time_ms = round(s_to_ms(time_s))
        except (OverflowError, ValueError):
            raise ValueError(f"the time {time_s} s is not finite") from None
        return cls(robot, sequence, time_ms, *_rounded(pose), trail)

    @classmethod
    def of_contact(cls, sequence: int, time_s: float, x: float, y: float) -> Position:
        """The report of an intruder.

        Args:
            sequence: Of the reporter's position.
            time_s: Of the reporter's position, s.
            x: m.
            y: m.

        Raises:
            ValueError: When a number does not fit.
        """
        return cls.of(CONTACT, sequence, time_s, Pose(x, y, 0.0))

    @property
    def pose(self) -> Pose:
        """The pose that receivers compute with (m, rad)."""
        return Pose(self.x_cm / CM_PER_M, self.y_cm / CM_PER_M, wrap(self.heading_mrad / MRAD_PER_RAD))

    @property
    def past(self) -> tuple[tuple[float, float], ...]:
        """The trail as absolute (x, y) in m, newest first."""
        if not self.trail:
            return ()
        places = []
        x, y = self.x_cm, self.y_cm
        for dx, dy in self.trail:
            x, y = x + dx, y + dy
            places.append((cm_to_m(x), cm_to_m(y)))
        return tuple(places)


def as_received(pose: Pose) -> Pose:
    """A pose as every receiver of its frame computes with it: rounded to centimetres and milliradians.

    Every footprint is computed from such a pose, so that truth, belief and observers agree to the point.

    Args:
        pose: In m and rad.

    Returns:
        The nearest pose that a frame can hold, in m and rad.

    Raises:
        ValueError: If a frame cannot hold the pose.
    """
    x_cm, y_cm, heading_mrad = _rounded(pose)
    if not (MIN_CM <= x_cm <= MAX_CM and MIN_CM <= y_cm <= MAX_CM):
        raise ValueError(f"{pose} is outside {MIN_CM}..{MAX_CM} cm")
    return Pose(x_cm / CM_PER_M, y_cm / CM_PER_M, wrap(heading_mrad / MRAD_PER_RAD))


def longest_frame(trail: int, *, tagged: bool) -> int:
    """The most bytes that a frame can have.

    Args:
        trail: How many past positions it carries.
        tagged: Whether it carries a tag.
    """
    return _LONGEST_BARE + (1 + _LONGEST_STEP * trail if trail else 0) + (_TAG_LENGTH if tagged else 0)


def encode(position: Position, key: bytes | None = None) -> bytes:
    """The frame for a position: at most 28 bytes bare, at most 63 with trail and tag.

    Args:
        position: To send.
        key: 1 to 64 bytes shared by the fleet, or None for a frame without a tag.

    Raises:
        ValueError: For a key of another length.
    """
    _check_key(key)
    body: list[object] = [
        VERSION,
        position.robot,
        position.sequence,
        position.time_ms,
        position.x_cm,
        position.y_cm,
        position.heading_mrad,
    ]
    if position.trail:
        body.append([delta for step in position.trail for delta in step])
    if key is None:
        return _packed(body)
    untagged = _packed([*body, bytes(_TAG_BYTES)])[:-_TAG_LENGTH]
    return untagged + _TAG_HEADER + _tag(untagged, key)


def decode(frame: bytes, key: bytes | None = None) -> Position:
    """The position in a frame.

    With a key every frame must carry its tag; without one a tag is skipped unchecked.

    Args:
        frame: Any bytes at all.
        key: 1 to 64 bytes shared by the fleet, or None.

    Raises:
        Rejected: Malformed, version or tag.
        ValueError: For a key of another length.
    """
    _check_key(key)
    values = _unpack(frame)
    if values[0] != VERSION:
        raise Rejected(RejectReason.VERSION, f"version {values[0]}, this is version {VERSION}")
    tagged = type(values[-1]) is bytes
    rest = values[_FIELDS : len(values) - tagged]
    if len(values) < _FIELDS + tagged or len(rest) > 1:
        raise Rejected(RejectReason.MALFORMED, "wrong number of values")
    try:
        trail = _trail(rest[0]) if rest else ()
        _, robot, sequence, time_ms, x_cm, y_cm, heading_mrad = values[:_FIELDS]
        position = Position(robot, sequence, time_ms, x_cm, y_cm, heading_mrad, trail)
    except ValueError as error:
        raise Rejected(RejectReason.MALFORMED, str(error)) from None
    if tagged and frame[-_TAG_LENGTH:-_TAG_BYTES] != _TAG_HEADER:
        raise Rejected(RejectReason.MALFORMED, f"a tag is a bin of {_TAG_BYTES} bytes")
    if key is not None and not (tagged and _genuine(frame, key)):
        raise Rejected(RejectReason.TAG, "the tag is wrong" if tagged else "no tag")
    return position


def _packed(values: list[object]) -> bytes:
    packed: bytes = msgpack.packb(values)
    return packed


def _unpack(frame: bytes) -> list[Any]:
    """The frame's outermost array, its first value an int; `Rejected` otherwise."""
    if len(frame) > MAX_FRAME:
        raise Rejected(RejectReason.MALFORMED, f"{len(frame)} bytes, at most {MAX_FRAME} are allowed")
    try:
        values = msgpack.unpackb(frame, raw=False, strict_map_key=True, ext_hook=_no_extension)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise Rejected(RejectReason.MALFORMED, f"not msgpack ({type(error).__name__})") from None
    if type(values) is not list or not values or type(values[0]) is not int:
        raise Rejected(RejectReason.MALFORMED, "not an array that begins with a version")
    return values


def _no_extension(code: int, _data: bytes) -> object:
    raise ValueError(f"extension type {code}")


def _trail(flat: object) -> tuple[tuple[int, int], ...]:
    if type(flat) is not list or not flat:
        raise ValueError("a trail is an array of pairs")
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def _wrong(name: str, value: object) -> str:
    """What is wrong with a number of a position; nothing where it fits."""
    least, most = _RANGES[name]
    if type(value) is not int:
        return f"{name} is not an integer"
    return "" if least <= value <= most else f"{name} is {value}, outside {least}..{most}"


def _check_key(key: bytes | None) -> None:
    if key is not None and not 1 <= len(key) <= MAX_KEY:
        raise ValueError(f"a key has 1 to {MAX_KEY} bytes, this one {len(key)}")


def _rounded(pose: Pose) -> tuple[int, int, int]:
    """The nearest x and y in cm and heading in mrad, the latter round the circle of 6283.185 mrad."""
    try:
        mrad = pose.heading % TAU * MRAD_PER_RAD
        return round(pose.x * CM_PER_M), round(pose.y * CM_PER_M), 0 if mrad > _NEARER_TO_ZERO else round(mrad)
    except (OverflowError, ValueError):  # an infinity has no nearest integer, and NaN neither
        raise ValueError(f"{pose} is not finite") from None


def _tag(body: bytes, key: bytes) -> bytes:
    return blake2b(body, key=key, digest_size=_TAG_BYTES).digest()


def _genuine(frame: bytes, key: bytes) -> bool:
    return hmac.compare_digest(frame[-_TAG_BYTES:], _tag(frame[:-_TAG_LENGTH], key))
