"""The ROS 2 messages of a recording, as CDR bytes, and their definitions. ROS is not needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput

GRID = "nav_msgs/msg/OccupancyGrid"
POSE = "geometry_msgs/msg/PoseStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
NUMBER = "std_msgs/msg/Float64"
LOG = "rcl_interfaces/msg/Log"
FRAME = "map"

QOS = "offered_qos_profiles"
"""Key in a channel's metadata for the quality of service that a topic's publishers offered, as in rosbag2."""

LATCHED = frozenset({"/map"})
"""Topics whose last message late subscribers also receive."""

INFO, WARN, ERROR = 20, 30, 40
"""Levels of a Log."""

_SYSTEM_DEFAULT = 0
_KEEP_LAST = 1
_RELIABLE = 1
_TRANSIENT_LOCAL, _VOLATILE = 1, 2

UNKNOWN = -1
"""Value of a grid's points that do not count."""


def offered(topic: str) -> str:
    """Return, as YAML, the quality of service with which rosbag2 should publish a topic.

    The values are rmw's numbers, which rosbag2 expects in files without a version: keep last, reliable, and transient
    local for latched topics, else volatile. A duration of 0 means none.
    """
    durability = _TRANSIENT_LOCAL if topic in LATCHED else _VOLATILE
    return (
        f"- history: {_KEEP_LAST}\n  depth: 10\n  reliability: {_RELIABLE}\n  durability: {durability}\n"
        "  deadline:\n    sec: 0\n    nsec: 0\n  lifespan:\n    sec: 0\n    nsec: 0\n"
        f"  liveliness: {_SYSTEM_DEFAULT}\n  liveliness_lease_duration:\n    sec: 0\n    nsec: 0\n"
        "  avoid_ros_namespace_conventions: false"
    )


class Encoder:
    """Encodes messages. Times are ns since the beginning of the run."""

    def __init__(self) -> None:
        try:
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise BadInput("recordings need rosbags; install it with: pip install 'fogwatch[monitor]'") from None
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._types = self._store.types

    def definition(self, kind: str) -> bytes:
        """Return the definition of a message type and of all types in it."""
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        return text.encode()

    def number(self, value: float) -> bytes:
        """Return a std_msgs/Float64."""
        return self._encode_message(NUMBER, data=float(value))

    def log(self, at: int, level: int, name: str, text: str) -> bytes:
        """Return an rcl_interfaces/Log."""
        fields: dict[str, Any] = {"level": level, "name": name, "msg": text, "file": "", "function": "", "line": 0}
        return self._encode_message(LOG, stamp=self._make_time(at), **fields)

    def pose(self, at: int, x: float, y: float, heading: float) -> bytes:
        """Return a geometry_msgs/PoseStamped in the map's frame."""
        return self._encode_message(POSE, header=self._make_header(at), pose=self._make_pose(x, y, heading))

    def transforms(self, at: int, bodies: Sequence[tuple[str, float, float, float]]) -> bytes:
        """Return a tf2_msgs/TFMessage.

        Each body is (frame, x in m, y in m, heading in rad), in the map's frame.
        """
        header = self._make_header(at)
        kind, vector = "geometry_msgs/msg/TransformStamped", "geometry_msgs/msg/Vector3"
        stamped = []
        for name, x, y, heading in bodies:
            shift = self._make_message(vector, x=x, y=y, z=0.0)
            transform = self._make_message(
                "geometry_msgs/msg/Transform", translation=shift, rotation=self._make_turn(heading)
            )
            stamped.append(self._make_message(kind, header=header, child_frame_id=name, transform=transform))
        return self._encode_message(TRANSFORMS, transforms=stamped)

    def grid(self, at: int, point: float, origin: tuple[float, float], values: NDArray[np.int8]) -> bytes:
        """Return a nav_msgs/OccupancyGrid.

        `point` is the side of a point and `origin` the lower left corner, m. `values` is int8 (h, w), row 0 lowest: 0
        to 100, or `UNKNOWN`.
        """
        height, width = values.shape
        metadata = self._make_message(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._make_time(0),
            resolution=point,
            width=width,
            height=height,
            origin=self._make_pose(*origin, 0.0),
        )
        return self._encode_message(
            GRID, header=self._make_header(at), info=metadata, data=np.ascontiguousarray(values).ravel()
        )

    def _encode_message(self, kind: str, **fields: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._make_message(kind, **fields), kind))

    def _make_message(self, kind: str, **fields: Any) -> Any:
        return self._types[kind](**fields)

    def _make_time(self, at: int) -> Any:
        return self._make_message("builtin_interfaces/msg/Time", sec=at // 1_000_000_000, nanosec=at % 1_000_000_000)

    def _make_header(self, at: int) -> Any:
        return self._make_message("std_msgs/msg/Header", stamp=self._make_time(at), frame_id=FRAME)

    def _make_pose(self, x: float, y: float, heading: float) -> Any:
        place = self._make_message("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
        return self._make_message("geometry_msgs/msg/Pose", position=place, orientation=self._make_turn(heading))

    def _make_turn(self, heading: float) -> Any:
        half = 0.5 * heading
        return self._make_message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
