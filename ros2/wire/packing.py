"""Values of our messages to ROS and back, checked both ways: nothing that is not finite is sent or believed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from patrol.errors import Malformed
from patrol.pose import Pose
from ros2.wire.definitions import make

LARGEST = 1e9
"""The largest number that means anything in metres, seconds or radians."""
LONGEST_NAME = 255
LONGEST_TEXT = 4096
_NS = 1_000_000_000
_LAST_S = 2**31 - 1
_UNIT = (0.9, 1.1)
"""Bounds of the length of a quaternion that should have length 1."""
_PLANE = [0, 7, 35]
"""Places of the variances of x, y and heading in a covariance of 6 x 6."""


class Packing(NamedTuple):
    """The way of one kind of value to ROS and back; both functions raise Malformed."""

    pack: Callable[[Any], Any]
    unpack: Callable[[Any], Any]


def sent_only(pack: Callable[[Any], Any]) -> Packing:
    """Return the packing of a value that is never read."""

    def refuse(found: Any) -> Any:
        raise Malformed(f"{type(found).__name__} is only sent")

    return Packing(pack, refuse)


def listed(packing: Packing) -> Packing:
    """Return the packing of a tuple of values that are all of one kind."""
    return Packing(lambda values: [*map(packing.pack, values)], lambda values: (*map(packing.unpack, values),))


def usable(packing: Packing) -> Packing:
    """Return the packing of a tuple of values; one that cannot be used costs no other."""

    def unpack(values: Iterable[Any]) -> tuple[Any, ...]:
        good = []
        for value in values:
            with suppress(Malformed):
                good.append(packing.unpack(value))
        return tuple(good)

    return Packing(listed(packing).pack, unpack)


def number(value: float) -> float:
    """Return a number that means something. Raises Malformed for any other.

    For example, 2 becomes 2.0, and NaN, infinities and 1e10 are refused.
    """
    if not -LARGEST <= value <= LARGEST:
        raise Malformed(f"{float(value)} is not a number of metres, seconds or radians")
    return float(value)


def frame(name: str) -> str:
    """Return a frame's name. Raises Malformed for what cannot be one."""
    if not 0 < len(name) <= LONGEST_NAME or not name.isprintable():
        raise Malformed("a frame's name is empty, too long or not printable")
    return name


def _optional_frame(name: str) -> str:
    return frame(name) if name else ""


def _check_text(value: str) -> str:
    if len(value) > LONGEST_TEXT:
        raise Malformed(f"a text of {len(value)} characters")
    return value


def _goal_id(value: Iterable[int]) -> bytes:
    identity = bytes(value)
    if len(identity) != 16:
        raise Malformed("a goal's id has 16 bytes")
    return identity


def _as_nanoseconds(time: Any) -> int:
    # Both fields of a stranger's message may hold anything that fits into 32 bits.
    if time.sec < 0 or not 0 <= time.nanosec < _NS:
        raise Malformed("a time before the epoch, or with more than a second of nanoseconds")
    return int(time.sec) * _NS + int(time.nanosec)


def _ros_time(stamp_ns: int) -> Any:
    seconds, remainder = divmod(stamp_ns, _NS)
    if not 0 <= seconds <= _LAST_S:
        raise Malformed("a time before the epoch or after 2038")
    return make("builtin_interfaces/msg/Time", {"sec": seconds, "nanosec": remainder})


def _ros_duration(seconds: float) -> Any:
    whole_s, remainder_ns = divmod(round(number(seconds) * _NS), _NS)
    return make("builtin_interfaces/msg/Duration", {"sec": whole_s, "nanosec": remainder_ns})


def _heading_of(turn: Any) -> float:
    x, y, z, w = (float(value) for value in (turn.x, turn.y, turn.z, turn.w))
    # Robots send quaternions of length 0 before they know their pose: no heading at all.
    length = math.hypot(x, y, z, w)
    if not _UNIT[0] <= length <= _UNIT[1]:
        raise Malformed(f"a rotation's quaternion is of length {length:.3g} and not 1")
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def _ros_turn(angle: float) -> Any:
    half = 0.5 * number(angle)
    return make("geometry_msgs/msg/Quaternion", {"z": math.sin(half), "w": math.cos(half)})


def _read_variances(covariance: Any) -> tuple[float, ...]:
    """Return the variances of x, y and heading; 0, unknown, where they are nonsense, which many robots send.

    For example, a variance of -1 or of 1e30 m² reads as 0.
    """
    variances = [float(covariance[index]) for index in _PLANE]
    return tuple(value if 0.0 <= value <= LARGEST else 0.0 for value in variances)


def _make_covariance(variances: tuple[float, float, float]) -> Any:
    covariance = np.zeros(36)
    covariance[_PLANE] = [number(value) for value in variances]
    return covariance


def _plane_pose(type_name: str, position: str, orientation: str) -> Packing:
    """Return the packing of a pose in the plane; its height is not used, but must be a number too.

    For example, a heading of pi / 2 becomes the quaternion (0, 0, 0.7071, 0.7071).
    """
    read_position, read_turn = attrgetter(position), attrgetter(orientation)

    def pack(pose: Pose) -> Any:
        x, y = number(pose.x), number(pose.y)
        return make(type_name, {f"{position}.x": x, f"{position}.y": y, orientation: _ros_turn(pose.heading)})

    def unpack(found: Any) -> Pose:
        spot = read_position(found)
        number(spot.z)
        return Pose(number(spot.x), number(spot.y), _heading_of(read_turn(found)))

    return Packing(pack, unpack)


NUMBER = Packing(number, number)
INTEGER = Packing(int, int)
YES_NO = Packing(bool, bool)
TEXT, ANY_TEXT = Packing(_check_text, _check_text), Packing(str, str)
TIME = Packing(_ros_time, _as_nanoseconds)
DURATION = sent_only(_ros_duration)
FRAME = Packing(_optional_frame, frame)
OPTIONAL_FRAME = Packing(_optional_frame, _optional_frame)
VARIANCES = Packing(_make_covariance, _read_variances)
GOAL_ID = Packing(lambda value: np.frombuffer(_goal_id(value), dtype=np.uint8), _goal_id)
POSE = _plane_pose("geometry_msgs/msg/Pose", "position", "orientation")
TRANSFORM = _plane_pose("geometry_msgs/msg/Transform", "translation", "rotation")
GOAL_INFO = Packing(
    lambda identity: make("action_msgs/msg/GoalInfo", {"goal_id.uuid": GOAL_ID.pack(identity)}),
    lambda found: GOAL_ID.unpack(found.goal_id.uuid),
)
GOAL_STATUS = Packing(
    lambda goal: make("action_msgs/msg/GoalStatus", {"goal_info": GOAL_INFO.pack(goal[0]), "status": goal[1]}),
    lambda found: (GOAL_INFO.unpack(found.goal_info), int(found.status)),
)
KEY_VALUE = sent_only(lambda pair: make("diagnostic_msgs/msg/KeyValue", {"key": pair[0], "value": pair[1]}))
