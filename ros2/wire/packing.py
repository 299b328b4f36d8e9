"""Messages of ours to messages of ROS and back, checked both ways: nothing that is not finite is sent or believed."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from patrol.errors import Malformed
from patrol.pose import Pose
from ros2.wire.definitions import store
from ros2.wire.messages import (
    AckermannDriveStamped,
    DiagnosticArray,
    OccupancyGrid,
    Odometry,
    Path,
    PoseStamped,
    TFMessage,
    Transform,
    Twist,
)

LARGEST = 1e9
"""The largest number that means anything in metres, seconds or radians."""
LONGEST_NAME = 255
MOST_CELLS = 1 << 26
"""Cells of the largest grid: 8192 x 8192."""
_NS = 1_000_000_000
_LAST_S = 2**31 - 1
_UNIT = (0.9, 1.1)
"""Bounds of the length of a quaternion that should have length 1."""


def number(value: float) -> float:
    """Return a number that means something. Raises Malformed for any other."""
    if not -LARGEST <= value <= LARGEST:
        raise Malformed(f"{float(value)} is not a number of metres, seconds or radians")
    return float(value)


def frame(name: str) -> str:
    """Return a frame's name. Raises Malformed for what cannot be one."""
    if not 0 < len(name) <= LONGEST_NAME or not name.isprintable():
        raise Malformed("a frame's name is empty, too long or not printable")
    return name


def optional_frame(name: str) -> str:
    """Return a frame's name, or nothing. Raises Malformed for what cannot be one."""
    return frame(name) if name else ""


def goal_id(value: Iterable[int]) -> bytes:
    """Return a goal's id. Raises Malformed for what cannot be one."""
    found = bytes(value)
    if len(found) != 16:
        raise Malformed("a goal's id has 16 bytes")
    return found


def nanoseconds(time: Any) -> int:
    """Return a time of ROS in ns. Raises Malformed for what cannot be one."""
    if time.sec < 0 or not 0 <= time.nanosec < _NS:
        raise Malformed("a time before the epoch, or with more than a second of nanoseconds")
    return int(time.sec) * _NS + int(time.nanosec)


def heading(turn: Any) -> float:
    """Return the heading of a quaternion, rad. Raises Malformed where it is of no use."""
    x, y, z, w = (float(value) for value in (turn.x, turn.y, turn.z, turn.w))
    length = math.hypot(x, y, z, w)
    if not _UNIT[0] <= length <= _UNIT[1]:
        raise Malformed(f"a rotation's quaternion is of length {length:.3g} and not 1")
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def plane_pose(position: Any, orientation: Any) -> Pose:
    """Return the pose in the plane. Raises Malformed where it is of no use."""
    number(position.z)
    return Pose(number(position.x), number(position.y), heading(orientation))


def plane_twist(twist: Any) -> Twist:
    """Return the velocity in the plane. Raises Malformed where it is of no use."""
    return Twist(number(twist.linear.x), number(twist.linear.y), number(twist.angular.z))


def variances(covariance: Any) -> tuple[float, float, float]:
    """Variances of x, y and heading; 0, unknown, where they are nonsense, which many robots send."""
    x, y, turn = (float(covariance[place]) for place in (0, 7, 35))
    return tuple(value if 0.0 <= value <= LARGEST else 0.0 for value in (x, y, turn))  # type: ignore[return-value]


def transforms(message: Any) -> TFMessage:
    """Return the transforms of a message that can be used."""
    good: list[Transform] = []
    for one in message.transforms:
        try:
            good.append(
                Transform(
                    nanoseconds(one.header.stamp),
                    frame(one.header.frame_id),
                    frame(one.child_frame_id),
                    plane_pose(one.transform.translation, one.transform.rotation),
                )
            )
        except Malformed:
            continue
    return TFMessage(tuple(good), len(message.transforms) - len(good))


def grid(message: Any) -> OccupancyGrid:
    """Return a grid. Raises Malformed where it is of no use."""
    info = message.info
    width, height = int(info.width), int(info.height)
    if not 0 < width * height == len(message.data) <= MOST_CELLS:
        raise Malformed(f"a grid of {width} x {height} with {len(message.data)} cells")
    if not 0.0 < info.resolution <= LARGEST:
        raise Malformed(f"a grid with cells of {float(info.resolution)} m")
    cells = np.asarray(message.data, dtype=np.int8).reshape(height, width).copy()
    return OccupancyGrid(
        nanoseconds(message.header.stamp),
        frame(message.header.frame_id),
        float(str(np.float32(info.resolution))),  # as it was meant: 0.05, and not the nearest float32
        plane_pose(info.origin.position, info.origin.orientation),
        cells,
    )


def path(message: Any) -> Path:
    """Return a path. Raises Malformed where it is of no use."""
    poses = tuple(plane_pose(one.pose.position, one.pose.orientation) for one in message.poses)
    return Path(nanoseconds(message.header.stamp), frame(message.header.frame_id), poses)


def make(kind: str, **fields: Any) -> Any:
    """Return a message of ROS."""
    return store().types[kind](**fields)


def ros_time(stamp_ns: int) -> Any:
    """Return a builtin_interfaces/Time. Raises Malformed for what cannot be one."""
    seconds, rest = divmod(stamp_ns, _NS)
    if not 0 <= seconds <= _LAST_S:
        raise Malformed("a time before the epoch or after 2038")
    return make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)


def ros_duration(seconds: float) -> Any:
    """Return a builtin_interfaces/Duration. Raises Malformed for what cannot be one."""
    whole, rest = divmod(round(number(seconds) * _NS), _NS)
    return make("builtin_interfaces/msg/Duration", sec=whole, nanosec=rest)


def ros_header(stamp_ns: int, frame_id: str) -> Any:
    """Return a std_msgs/Header."""
    return make("std_msgs/msg/Header", stamp=ros_time(stamp_ns), frame_id=optional_frame(frame_id))


def ros_turn(angle: float) -> Any:
    """Return a geometry_msgs/Quaternion round the vertical axis."""
    half = 0.5 * number(angle)
    return make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))


def ros_vector(x: float, y: float, z: float, kind: str = "Vector3") -> Any:
    """Return a geometry_msgs/Vector3 or Point."""
    return make(f"geometry_msgs/msg/{kind}", x=number(x), y=number(y), z=number(z))


def ros_pose(pose: Pose) -> Any:
    """Return a geometry_msgs/Pose."""
    position = ros_vector(pose.x, pose.y, 0.0, "Point")
    return make("geometry_msgs/msg/Pose", position=position, orientation=ros_turn(pose.heading))


def ros_pose_stamped(message: PoseStamped) -> Any:
    """Return a geometry_msgs/PoseStamped."""
    header = ros_header(message.stamp_ns, message.frame)
    return make("geometry_msgs/msg/PoseStamped", header=header, pose=ros_pose(message.pose))


def ros_twist(twist: Twist) -> Any:
    """Return a geometry_msgs/Twist."""
    linear, angular = ros_vector(twist.vx, twist.vy, 0.0), ros_vector(0.0, 0.0, twist.turn_rate)
    return make("geometry_msgs/msg/Twist", linear=linear, angular=angular)


def ros_uncertain_pose(pose: Pose, spread: tuple[float, float, float]) -> Any:
    """Return a geometry_msgs/PoseWithCovariance."""
    covariance = np.zeros(36)
    covariance[[0, 7, 35]] = [number(value) for value in spread]
    return make("geometry_msgs/msg/PoseWithCovariance", pose=ros_pose(pose), covariance=covariance)


def ros_odometry(message: Odometry) -> Any:
    """Return a nav_msgs/Odometry."""
    kind = "geometry_msgs/msg/TwistWithCovariance"
    return make(
        "nav_msgs/msg/Odometry",
        header=ros_header(message.stamp_ns, message.frame),
        child_frame_id=optional_frame(message.child_frame),
        pose=ros_uncertain_pose(message.pose, message.variances),
        twist=make(kind, twist=ros_twist(message.twist), covariance=np.zeros(36)),
    )


def ros_drive(message: AckermannDriveStamped) -> Any:
    """Return an ackermann_msgs/AckermannDriveStamped."""
    drive = make(
        "ackermann_msgs/msg/AckermannDrive",
        steering_angle=number(message.steering_angle),
        steering_angle_velocity=0.0,
        speed=number(message.speed),
        acceleration=number(message.acceleration),
        jerk=0.0,
    )
    kind = "ackermann_msgs/msg/AckermannDriveStamped"
    return make(kind, header=ros_header(message.stamp_ns, message.frame), drive=drive)


def ros_transforms(message: TFMessage) -> Any:
    """Return a tf2_msgs/TFMessage."""
    stamped = [
        make(
            "geometry_msgs/msg/TransformStamped",
            header=ros_header(one.stamp_ns, one.frame),
            child_frame_id=optional_frame(one.child_frame),
            transform=make(
                "geometry_msgs/msg/Transform",
                translation=ros_vector(one.pose.x, one.pose.y, 0.0),
                rotation=ros_turn(one.pose.heading),
            ),
        )
        for one in message.transforms
    ]
    return make("tf2_msgs/msg/TFMessage", transforms=stamped)


def ros_grid(message: OccupancyGrid) -> Any:
    """Return a nav_msgs/OccupancyGrid."""
    height, width = message.cells.shape
    if not 0 < width * height <= MOST_CELLS or message.cells.dtype != np.int8:
        raise Malformed(f"a grid of {width} x {height} {message.cells.dtype}")
    info = make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=ros_time(message.stamp_ns),
        resolution=number(message.resolution),
        width=width,
        height=height,
        origin=ros_pose(message.origin),
    )
    data = np.ascontiguousarray(message.cells).ravel()
    return make("nav_msgs/msg/OccupancyGrid", header=ros_header(message.stamp_ns, message.frame), info=info, data=data)


def ros_path(message: Path) -> Any:
    """Return a nav_msgs/Path."""
    header = ros_header(message.stamp_ns, message.frame)
    poses = [make("geometry_msgs/msg/PoseStamped", header=header, pose=ros_pose(pose)) for pose in message.poses]
    return make("nav_msgs/msg/Path", header=header, poses=poses)


def ros_diagnostics(message: DiagnosticArray) -> Any:
    """Return a diagnostic_msgs/DiagnosticArray."""
    kind, pair = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/KeyValue"
    statuses = [
        make(
            kind,
            level=int(status.level),
            name=status.name,
            message=status.message,
            hardware_id=status.hardware_id,
            values=[make(pair, key=key, value=value) for key, value in status.values],
        )
        for status in message.statuses
    ]
    return make("diagnostic_msgs/msg/DiagnosticArray", header=ros_header(message.stamp_ns, ""), status=statuses)


def ros_goal_id(value: bytes) -> Any:
    """Return a unique_identifier_msgs/UUID. Raises Malformed for what cannot be one."""
    return make("unique_identifier_msgs/msg/UUID", uuid=np.frombuffer(goal_id(value), dtype=np.uint8))


def ros_goal_info(value: bytes, stamp_ns: int) -> Any:
    """Return an action_msgs/GoalInfo."""
    return make("action_msgs/msg/GoalInfo", goal_id=ros_goal_id(value), stamp=ros_time(stamp_ns))
