"""The position message: the only thing robots tell each other.

A frame is one msgpack array

    [version, robot, sequence, time_ms, x_cm, y_cm, heading_mrad]  +  [trail]  +  [tag]

of small integers. `Position` declares them: encoder, decoder, limits, the layout in C (`deploy/c/layout.h`) and the
table in docs/radio.md follow from it. `trail`, when there, is a flat array ``[dx1, dy1, dx2, dy2, ...]`` of
centimetres: ``(dx1, dy1)`` leads from this position to the one before it, ``(dx2, dy2)`` from there to the one before
that. `tag`, when there, is an 8-byte msgpack *bin*: keyed BLAKE2b over every byte before the bin's own two-byte header.
An array and a bin cannot be confused, so no flag says which of the two a frame carries. The longest bare frame is 28
bytes, with the longest trail and a tag 63; no frame above `MAX_FRAME` is looked at.

Numbers are rounded to the nearest unit (ties to even), headings to the nearest milliradian round the circle.

For example, robot 3 at (12.34, 40.0) m with a heading of -0.5 rad, at 3.5 s in tick 7, sends these 16 bytes:

    97 01 03 07 cd 0d ac cd 04 d2 cd 0f a0 cd 16 97     [1, 3, 7, 3500, 1234, 4000, 5783]

Only here are units whole centimetres, milliradians and milliseconds; everything inside a program is in metres, radians
and seconds (`patrol.pose`). Functions that scale, such as `m_to_cm`, do not round: that happens when a frame is made.
There each pose is scaled with the numbers themselves, because a call costs more than what it does.
"""

from __future__ import annotations

import hmac
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from hashlib import blake2b
from operator import attrgetter
from types import MappingProxyType
from typing import Annotated, Any, get_type_hints

import msgpack

from patrol.errors import Unusable
from patrol.pose import TAU, Pose, wrap

__all__ = [
    "CONTACT",
    "FIELDS",
    "MAX_CM",
    "MAX_CONTACTS",
    "MAX_FRAME",
    "MAX_FRAMES",
    "MAX_HEADING_MRAD",
    "MAX_KEY",
    "MAX_ROBOT",
    "MAX_SEQUENCE",
    "MAX_STEP_CM",
    "MAX_TIME_MS",
    "MAX_TRAIL",
    "MIN_CM",
    "MIN_STEP_CM",
    "STEP",
    "TAG_BYTES",
    "VERSION",
    "Position",
    "RejectReason",
    "Rejected",
    "WireField",
    "as_received",
    "decode",
    "encode",
    "longest_frame",
]

CM_PER_M = 100.0
MRAD_PER_RAD = 1000.0
MS_PER_S = 1000.0


def m_to_cm(length: float) -> float:
    """Convert a length in m to cm."""
    return length * CM_PER_M


def cm_to_m(length: float) -> float:
    """Convert a length in cm to m."""
    return length / CM_PER_M


def s_to_ms(time: float) -> float:
    """Convert a time in s to ms."""
    return time * MS_PER_S


def ms_to_s(time: float) -> float:
    """Convert a time in ms to s."""
    return time / MS_PER_S


VERSION = 1
MAX_FRAME = 64
CONTACT = 0
"""The robot number of a contact: an intruder's position, reported by a robot that sees it."""

MAX_CONTACTS = 4
"""Contacts that a robot reports in one tick."""

MAX_FRAMES = 1 + MAX_CONTACTS
"""Frames that a robot sends in one tick: its own position first, then its contacts."""

SPAN = 64
"""Number of a sender's last sequences that a listener remembers, with the newest (as RFC 4303, 3.4.3, for IPsec)."""

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

TAG_BYTES = 8
_TAG_HEADER = bytes((0xC4, TAG_BYTES))
_TAG_LENGTH = len(_TAG_HEADER) + TAG_BYTES
_NEARER_TO_ZERO = (MAX_HEADING_MRAD + TAU * MRAD_PER_RAD) / 2.0
"""Headings beyond it, mrad, are nearer to a whole turn than to the largest heading."""


class RejectReason(StrEnum):
    """Reasons for which a frame is dropped."""

    MALFORMED = "malformed"
    VERSION = "version"
    TAG = "tag"
    OWN = "own"
    UNKNOWN = "unknown"
    OUTSIDE = "outside"
    OLD = "old"
    AHEAD = "ahead"
    TOO_FAST = "too_fast"


class Rejected(Unusable):
    """A frame that must not be used, and why."""

    def __init__(self, reason: RejectReason, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason


@dataclass(frozen=True, slots=True)
class WireField:
    """An integer of the frame.

    For example, a heading is a ``WireField(0, 6283, "mrad", "counter-clockwise from the x axis")``.

    Attributes:
        least: Smallest value.
        most: Largest value.
        unit: For people; empty for none.
        means: What it says, for people.
    """

    least: int
    most: int
    unit: str
    means: str


@dataclass(frozen=True, slots=True)
class Position:
    """A robot's place as it reports it, in the units and the order of the wire.

    For example, ``Position(3, 7, 3500, 1234, 4000, 5783)`` is that of robot 3 in tick 7, at (12.34, 40.0) m.

    Attributes:
        robot: The sender, or `CONTACT` for a *contact* (an intruder's position reported by a robot).
        sequence: One more each step.
        time_ms: Of the sender's clock.
        x_cm: Of the robot's centre.
        y_cm: Of the robot's centre.
        heading_mrad: Counter-clockwise from the x axis.
        trail: Up to `MAX_TRAIL` pairs of `STEP`, newest first.

    Raises:
        ValueError: For a number that is none, or outside the range of its field.
    """

    robot: Annotated[int, WireField(0, MAX_ROBOT, "", "its number from 1, or 0 for an intruder that the sender sees")]
    sequence: Annotated[int, WireField(0, MAX_SEQUENCE, "", "the fleet's tick")]
    time_ms: Annotated[int, WireField(0, MAX_TIME_MS, "ms", "of the sender's clock; the most after 49.7 days")]
    x_cm: Annotated[int, WireField(MIN_CM, MAX_CM, "cm", "of the robot's centre")]
    y_cm: Annotated[int, WireField(MIN_CM, MAX_CM, "cm", "of the robot's centre")]
    heading_mrad: Annotated[
        int, WireField(0, MAX_HEADING_MRAD, "mrad", "counter-clockwise from the x axis, round the circle")
    ]
    trail: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        for number, (lower, upper) in zip(_numbers_of(self), _RANGES, strict=True):
            if type(number) is not int or not lower <= number <= upper:
                raise ValueError(
                    next(wrong for name in FIELDS if (wrong := _number_problem(name, getattr(self, name))))
                )
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
        """Make the position to send for a pose.

        For example, ``Position.of(3, 7, 3.5, Pose(12.34, 40.0, -0.5))`` has an `x_cm` of 1234 and a
        `heading_mrad` of 5783.

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
            time_ms = min(round(s_to_ms(time_s)), MAX_TIME_MS)  # a patrol that lasts longer goes on
        except (OverflowError, ValueError):
            raise ValueError(f"the time {time_s} s is not finite") from None
        return cls(robot, sequence, time_ms, *_round_pose(pose), trail=trail)

    @classmethod
    def of_contact(cls, sequence: int, time_s: float, x: float, y: float) -> Position:
        """Make the report of an intruder.

        For example, ``Position.of_contact(7, 3.5, 1.0, 2.0)`` is of robot 0, at 100 and 200 cm.

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
        """The pose that receivers compute with (m, rad).

        For example, 1234 cm and 5783 mrad are 12.34 m and -0.5002 rad.
        """
        return Pose(self.x_cm / CM_PER_M, self.y_cm / CM_PER_M, wrap(self.heading_mrad / MRAD_PER_RAD))

    @property
    def past(self) -> tuple[tuple[float, float], ...]:
        """The trail as absolute (x, y) in m, newest first.

        For example, at (10, 20) m the trail ((-50, 0), (-50, 10)) gives ((9.5, 20.0), (9.0, 20.1)).
        """
        if not self.trail:
            return ()
        places = []
        x, y = self.x_cm, self.y_cm
        for dx, dy in self.trail:
            x, y = x + dx, y + dy
            places.append((cm_to_m(x), cm_to_m(y)))
        return tuple(places)


FIELDS: Mapping[str, WireField] = MappingProxyType(
    {
        name: hint.__metadata__[0]
        for name, hint in get_type_hints(Position, include_extras=True).items()
        if hasattr(hint, "__metadata__")
    }
)
"""The numbers of a frame after its version, by name and in their order."""

STEP = WireField(MIN_STEP_CM, MAX_STEP_CM, "cm", "from a position to the one before it, along x or y")
"""A number of a trail."""

_numbers_of = attrgetter(*FIELDS)
_RANGES = tuple((field.least, field.most) for field in FIELDS.values())
_FIELDS = 1 + len(FIELDS)


def _longest_bytes(field: WireField) -> int:
    """Return the most bytes that a number of a field can have in msgpack.

    For example, 2 for a number from 0 to 255, and 3 for a robot's number.
    """
    return max(len(_pack_value(number)) for number in (field.least, field.most))


def as_received(pose: Pose) -> Pose:
    """Round a pose to centimetres and milliradians, as every receiver of its frame computes with it.

    For example, ``Pose(1.23456, 2.0, 0.12345)`` becomes ``Pose(1.23, 2.0, 0.123)``.

    Every footprint is computed from such a pose, so that truth, belief and observers agree to the point.

    Args:
        pose: In m and rad.

    Returns:
        The nearest pose that a frame can hold, in m and rad.

    Raises:
        ValueError: If a frame cannot hold the pose.
    """
    x_cm, y_cm, heading_mrad = _round_pose(pose)
    if not (MIN_CM <= x_cm <= MAX_CM and MIN_CM <= y_cm <= MAX_CM):
        raise ValueError(f"{pose} is outside {MIN_CM}..{MAX_CM} cm")
    return Pose(x_cm / CM_PER_M, y_cm / CM_PER_M, wrap(heading_mrad / MRAD_PER_RAD))


def longest_frame(trail: int, *, tagged: bool) -> int:
    """Return the most bytes that a frame can have.

    For example, 28 without trail and tag, 38 with a tag, and 63 with a tag and four past positions.

    Args:
        trail: How many past positions it carries.
        tagged: Whether it carries a tag.
    """
    bare = 1 + len(_pack_value(VERSION)) + sum(_longest_bytes(field) for field in FIELDS.values())
    return bare + (1 + 2 * _longest_bytes(STEP) * trail if trail else 0) + (_TAG_LENGTH if tagged else 0)


def encode(position: Position, key: bytes | None = None) -> bytes:
    """Encode a position as a frame: at most 28 bytes bare, at most 63 with trail and tag.

    For example, a position of 16 bytes takes 26 with a key.

    Args:
        position: To send.
        key: 1 to 64 bytes shared by the fleet, or None for a frame without a tag.

    Raises:
        ValueError: For a key of another length.
    """
    _check_key(key)
    body: list[object] = [VERSION, *_numbers_of(position)]
    if position.trail:
        body.append([delta for step in position.trail for delta in step])
    if key is None:
        return _pack_value(body)
    # Packed with room for the tag, so that the array's header already counts it: the tag covers the header too.
    untagged = _pack_value([*body, bytes(TAG_BYTES)])[:-_TAG_LENGTH]
    return untagged + _TAG_HEADER + _frame_tag(untagged, key)


def decode(frame: bytes, key: bytes | None = None) -> Position:
    """Decode the position in a frame.

    For example, the frame ``[2, 1]`` raises `Rejected`: "version: version 2, this is version 1".

    With a key every frame must carry its tag; without one a tag is skipped unchecked.

    Args:
        frame: Any bytes at all.
        key: 1 to 64 bytes shared by the fleet, or None.

    Raises:
        Rejected: Malformed, version or tag.
        ValueError: For a key of another length.
    """
    _check_key(key)
    numbers = _unpack_frame(frame)
    if numbers[0] != VERSION:
        raise Rejected(RejectReason.VERSION, f"version {numbers[0]}, this is version {VERSION}")
    tagged = type(numbers[-1]) is bytes
    trail_values = numbers[_FIELDS : len(numbers) - tagged]
    if len(numbers) < _FIELDS + tagged or len(trail_values) > 1:
        raise Rejected(RejectReason.MALFORMED, "wrong number of values")
    try:
        trail = _pair_trail(trail_values[0]) if trail_values else ()
        position = Position(*numbers[1:_FIELDS], trail=trail)  # type: ignore[misc]  # as many numbers as fields
    except ValueError as error:
        raise Rejected(RejectReason.MALFORMED, str(error)) from None
    # msgpack also has longer headers; the place of the tag is counted with the shortest.
    if tagged and frame[-_TAG_LENGTH:-TAG_BYTES] != _TAG_HEADER:
        raise Rejected(RejectReason.MALFORMED, f"a tag is a bin of {TAG_BYTES} bytes")
    if key is not None and not (tagged and _is_genuine(frame, key)):
        raise Rejected(RejectReason.TAG, "the tag is wrong" if tagged else "no tag")
    return position


def _pack_value(value: object) -> bytes:
    packed: bytes = msgpack.packb(value)
    return packed


def _unpack_frame(frame: bytes) -> list[Any]:
    """Unpack the frame's outermost array, its first value an int."""
    # Before unpacking, which costs time by the length of what a stranger sends.
    if len(frame) > MAX_FRAME:
        raise Rejected(RejectReason.MALFORMED, f"{len(frame)} bytes, at most {MAX_FRAME} are allowed")
    try:
        array = msgpack.unpackb(frame, raw=False, strict_map_key=True, ext_hook=_no_extension)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise Rejected(RejectReason.MALFORMED, f"not msgpack ({type(error).__name__})") from None
    if type(array) is not list or not array or type(array[0]) is not int:
        raise Rejected(RejectReason.MALFORMED, "not an array that begins with a version")
    return array


def _no_extension(code: int, _data: bytes) -> object:
    raise ValueError(f"extension type {code}")


def _pair_trail(flat: object) -> tuple[tuple[int, int], ...]:
    if type(flat) is not list or not flat:
        raise ValueError("a trail is an array of pairs")
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def _number_problem(name: str, value: object) -> str:
    """Say what is wrong with a number of a position; return an empty text where it fits."""
    field = FIELDS[name]
    if type(value) is not int:
        return f"{name} is not an integer"
    return "" if field.least <= value <= field.most else f"{name} is {value}, outside {field.least}..{field.most}"


def _check_key(key: bytes | None) -> None:
    if key is not None and not 1 <= len(key) <= MAX_KEY:
        raise ValueError(f"a key has 1 to {MAX_KEY} bytes, this one {len(key)}")


def _round_pose(pose: Pose) -> tuple[int, int, int]:
    """Round x and y to cm and the heading to mrad, the latter round the circle of 6283.185 mrad.

    For example, a heading of -0.00005 rad, which is nearer to a whole turn than to 6283 mrad, becomes 0.
    """
    try:
        # Python's remainder has the sign of the divisor, so a negative heading comes out in [0, 2 pi).
        mrad = pose.heading % TAU * MRAD_PER_RAD
        return round(pose.x * CM_PER_M), round(pose.y * CM_PER_M), 0 if mrad > _NEARER_TO_ZERO else round(mrad)
    except (OverflowError, ValueError):  # an infinity has no nearest integer, and NaN neither
        raise ValueError(f"{pose} is not finite") from None


def _frame_tag(body: bytes, key: bytes) -> bytes:
    return blake2b(body, key=key, digest_size=TAG_BYTES).digest()


def _is_genuine(frame: bytes, key: bytes) -> bool:
    return hmac.compare_digest(frame[-TAG_BYTES:], _frame_tag(frame[:-_TAG_LENGTH], key))
