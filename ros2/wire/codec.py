"""Messages of ours to CDR bytes and back. A message that cannot be used raises `Malformed`, and nothing else.

The classes of `messages.py` say by their annotations where each of their fields lies in ROS, and how it is packed:

    child_frame: Annotated[str, "child_frame_id", OPTIONAL_FRAME]
    data: bool                                                       the same name in ROS, packed by its type

All other fields of a type of ROS are sent as zero, and not read. A class with the methods `to_ros` and `of_ros` packs
itself, and one with `of_payload` reads bytes itself.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from patrol.errors import Malformed
from patrol.pose import Pose
from ros2.wire.definitions import make, store, type_hash
from ros2.wire.packing import ANY_TEXT, INTEGER, NUMBER, POSE, YES_NO, Packing, listed

M = TypeVar("M")

PACKINGS: dict[type, Packing] = {bool: YES_NO, int: INTEGER, float: NUMBER, str: ANY_TEXT, Pose: POSE}
"""The packing of each type of a field, the messages in messages included."""


@dataclass(frozen=True, slots=True)
class Coding:
    """The coding of a class of messages."""

    type_name: str
    longest: int  # bytes of the longest payload that is read; 0 for what is only sent

    @property
    def type_hash(self) -> str:
        """The type's hash in ROS."""
        return type_hash(self.type_name)


CODINGS: dict[type, Coding] = {}
"""The coding of each class of messages."""


def part(type_name: str) -> Callable[[type[M]], type[M]]:
    """Let a class stand for a type of ROS that is a part of messages."""

    def declare(kind: Any) -> Any:
        own = hasattr(kind, "to_ros")
        PACKINGS[kind] = Packing(kind.to_ros, kind.of_ros) if own else _packing_of_fields(kind, type_name)
        return kind

    return declare


def message(type_name: str, longest: int) -> Callable[[type[M]], type[M]]:
    """Let a class stand for a message of ROS of at most `longest` bytes; with 0 it is only sent."""

    def declare(kind: type[M]) -> type[M]:
        CODINGS[kind] = Coding(type_name, longest)
        return part(type_name)(kind)

    return declare


def _packing_of_fields(kind: Callable[..., Any], type_name: str) -> Packing:
    places = {name: _place_field(name, hint) for name, hint in get_type_hints(kind, include_extras=True).items()}
    readers = {name: (attrgetter(path), packing.unpack) for name, (path, packing) in places.items()}

    def pack(message: Any) -> Any:
        return make(type_name, {path: packing.pack(getattr(message, name)) for name, (path, packing) in places.items()})

    return Packing(pack, lambda found: kind(**{name: unpack(read(found)) for name, (read, unpack) in readers.items()}))


def _place_field(name: str, hint: Any) -> tuple[str, Packing]:
    """Return the path of a field in ROS, and how it is packed."""
    kind, path, *extra = get_args(hint) if get_origin(hint) is Annotated else (hint, name)
    if extra:
        return path, extra[0]
    if get_origin(kind) is tuple:
        return path, listed(PACKINGS[get_args(kind)[0]])
    return path, PACKINGS[kind]


def encode(message: object) -> bytes:
    """Return the bytes of a message: CDR, little endian, with its header.

    A message that holds what must not be sent raises Malformed.
    """
    kind = type(message)
    return bytes(store().serialize_cdr(PACKINGS[kind].pack(message), CODINGS[kind].type_name, little_endian=True))


def decode(kind: type[M], payload: bytes) -> M:
    """Return the message in a payload of any sender: CDR of either byte order, with its header.

    A payload that is no such message, or one that cannot be used, raises Malformed.
    """
    from rosbags.serde import SerdeError

    coding = CODINGS[kind]
    if not coding.longest:
        raise Malformed(f"{coding.type_name} is only sent")
    if len(payload) > coding.longest:
        raise Malformed(f"{len(payload)} bytes, and {coding.type_name} has at most {coding.longest}")
    if (read := getattr(kind, "of_payload", None)) is not None:
        return cast("M", read(payload))
    try:
        # The reader trusts its input, so any error of it means a payload that is no such message.
        raw = store().deserialize_cdr(payload, coding.type_name)
    except (SerdeError, ValueError, IndexError, OverflowError, TypeError, struct.error):
        raise Malformed(f"{len(payload)} bytes that are no {coding.type_name}") from None
    return cast("M", PACKINGS[kind].unpack(raw))
