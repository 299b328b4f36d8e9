"""Messages of ROS 2 as this program needs them: SI units, angles in rad, times in ns since the epoch, and the plane.

Of a pose in space only x, y and the heading are kept. A frame's name is printable and has 1 to 255 characters, but it
may be empty in commands. `codec.py` reads from the annotations where each field lies in ROS.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from patrol.errors import Malformed
from patrol.pose import Pose
from ros2.wire import packing as ros
from ros2.wire.codec import PACKINGS, message, part
from ros2.wire.definitions import CANCEL_GOAL, FEEDBACK, GET_RESULT, SEND_GOAL, make

UNKNOWN_VARIANCES = (0.0, 0.0, 0.0)
"""Variances of x (m²), y (m²) and heading (rad²) that are unknown: ROS writes them as 0."""

MOST_CELLS = 1 << 26
"""Cells of the largest grid: 8192 x 8192."""

_KIB, _MIB = 1 << 10, 1 << 20
_CDR_HEADER = 4

Stamp = Annotated[int, "header.stamp", ros.TIME]
Frame = Annotated[str, "header.frame_id", ros.FRAME]
CommandFrame = Annotated[str, "header.frame_id", ros.OPTIONAL_FRAME]
"""Senders of commands often leave the frame empty."""
Variances = Annotated[tuple[float, float, float], "pose.covariance", ros.VARIANCES]
"""Of x (m²), y (m²) and heading (rad²)."""
GoalId = Annotated[bytes, "goal_id.uuid", ros.GOAL_ID]
"""16 bytes."""


@message("std_msgs/msg/Bool", 64)
@dataclass(frozen=True, slots=True)
class Bool:
    """std_msgs/Bool."""

    data: bool


@message("rosgraph_msgs/msg/Clock", 64)
@dataclass(frozen=True, slots=True)
class Clock:
    """rosgraph_msgs/Clock: the time in a simulation."""

    stamp_ns: Annotated[int, "clock", ros.TIME]


@message("geometry_msgs/msg/Twist", 128)
@dataclass(frozen=True, slots=True)
class Twist:
    """geometry_msgs/Twist: a velocity in a body's own frame."""

    vx: Annotated[float, "linear.x"]  # m/s, forward
    vy: Annotated[float, "linear.y"]  # m/s, to the left
    turn_rate: Annotated[float, "angular.z"]  # rad/s, to the left


@message("geometry_msgs/msg/TwistStamped", 2 * _KIB)
@dataclass(frozen=True, slots=True)
class TwistStamped:
    """geometry_msgs/TwistStamped."""

    stamp_ns: Stamp
    frame: CommandFrame
    twist: Twist


@message("ackermann_msgs/msg/AckermannDriveStamped", 2 * _KIB)
@dataclass(frozen=True, slots=True)
class AckermannDriveStamped:
    """ackermann_msgs/AckermannDriveStamped."""

    stamp_ns: Stamp
    frame: CommandFrame
    speed: Annotated[float, "drive.speed"]  # m/s, forward
    # rad, to the left, of a wheel in the middle of the front axle
    steering_angle: Annotated[float, "drive.steering_angle"]
    # m/s², the most that may be used; 0 leaves it to the robot
    acceleration: Annotated[float, "drive.acceleration"] = 0.0


@message("geometry_msgs/msg/PoseStamped", 2 * _KIB)
@dataclass(frozen=True, slots=True)
class PoseStamped:
    """geometry_msgs/PoseStamped."""

    stamp_ns: Stamp
    frame: Frame
    pose: Pose


@message("geometry_msgs/msg/PoseWithCovarianceStamped", 4 * _KIB)
@dataclass(frozen=True, slots=True)
class PoseWithCovarianceStamped:
    """geometry_msgs/PoseWithCovarianceStamped."""

    stamp_ns: Stamp
    frame: Frame
    pose: Annotated[Pose, "pose.pose"]
    variances: Variances = UNKNOWN_VARIANCES


@message("nav_msgs/msg/Odometry", 4 * _KIB)
@dataclass(frozen=True, slots=True)
class Odometry:
    """nav_msgs/Odometry."""

    stamp_ns: Stamp
    frame: Frame  # of the pose
    # the body's own, that of the velocity; may be empty
    child_frame: Annotated[str, "child_frame_id", ros.OPTIONAL_FRAME]
    pose: Annotated[Pose, "pose.pose"]
    twist: Annotated[Twist, "twist.twist"]
    variances: Variances = UNKNOWN_VARIANCES


@part("geometry_msgs/msg/TransformStamped")
@dataclass(frozen=True, slots=True)
class Transform:
    """geometry_msgs/TransformStamped: where a frame is in another."""

    stamp_ns: Stamp
    frame: Frame  # the frame that it is in
    child_frame: Annotated[str, "child_frame_id", ros.FRAME]
    pose: Annotated[Pose, "transform", ros.TRANSFORM]  # the child's origin and heading


@message("tf2_msgs/msg/TFMessage", 256 * _KIB)
@dataclass(frozen=True, slots=True)
class TFMessage:
    """tf2_msgs/TFMessage."""

    transforms: Annotated[tuple[Transform, ...], "transforms", ros.usable(PACKINGS[Transform])]


@message("nav_msgs/msg/OccupancyGrid", MOST_CELLS + 4 * _KIB)
@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """nav_msgs/OccupancyGrid."""

    stamp_ns: Stamp
    frame: Frame
    resolution: float  # m, side of a cell
    origin: Pose  # outer corner of the first cell, and the heading of the first row
    cells: NDArray[np.int8]  # (h, w), row 0 first: 0 free to 100 occupied, -1 unknown

    def to_ros(self) -> Any:
        """Return it in ROS."""
        height, width = self.cells.shape
        if not 0 < width * height <= MOST_CELLS or self.cells.dtype != np.int8:
            raise Malformed(f"a grid of {width} x {height} {self.cells.dtype}")
        stamp = ros.TIME.pack(self.stamp_ns)
        values = {
            "header.stamp": stamp,
            "header.frame_id": ros.FRAME.pack(self.frame),
            "info.map_load_time": stamp,
            "info.resolution": ros.NUMBER.pack(self.resolution),
            "info.width": width,
            "info.height": height,
            "info.origin": ros.POSE.pack(self.origin),
            "data": np.ascontiguousarray(self.cells).ravel(),
        }
        return make("nav_msgs/msg/OccupancyGrid", values)

    @classmethod
    def of_ros(cls, found: Any) -> OccupancyGrid:
        """Return the content of a message of ROS."""
        grid_info = found.info
        width, height = int(grid_info.width), int(grid_info.height)
        if not 0 < width * height == len(found.data) <= MOST_CELLS:
            raise Malformed(f"a grid of {width} x {height} with {len(found.data)} cells")
        if not 0.0 < grid_info.resolution <= ros.LARGEST:
            raise Malformed(f"a grid with cells of {float(grid_info.resolution)} m")
        return cls(
            ros.TIME.unpack(found.header.stamp),
            ros.FRAME.unpack(found.header.frame_id),
            float(str(np.float32(grid_info.resolution))),  # as it was meant: 0.05, and not the nearest float32
            ros.POSE.unpack(grid_info.origin),
            np.asarray(found.data, dtype=np.int8).reshape(height, width).copy(),
        )


@message("nav_msgs/msg/Path", _MIB)
@dataclass(frozen=True, slots=True)
class Path:
    """nav_msgs/Path; all its poses have its stamp and its frame."""

    stamp_ns: Stamp
    frame: Frame
    poses: tuple[Pose, ...]

    def to_ros(self) -> Any:
        """Return it in ROS, where each pose has a header."""
        header = make(
            "std_msgs/msg/Header", {"stamp": ros.TIME.pack(self.stamp_ns), "frame_id": ros.FRAME.pack(self.frame)}
        )
        poses = [{"header": header, "pose": ros.POSE.pack(pose)} for pose in self.poses]
        stamped = [make("geometry_msgs/msg/PoseStamped", values) for values in poses]
        return make("nav_msgs/msg/Path", {"header": header, "poses": stamped})

    @classmethod
    def of_ros(cls, found: Any) -> Path:
        """Return the content of a message of ROS."""
        poses = tuple(ros.POSE.unpack(stamped.pose) for stamped in found.poses)
        return cls(ros.TIME.unpack(found.header.stamp), ros.FRAME.unpack(found.header.frame_id), poses)


@message(f"{SEND_GOAL}_Request", 32 * _KIB)
@dataclass(frozen=True, slots=True)
class SendGoalRequest:
    """The request of nav2_msgs/action/NavigateToPose/send_goal."""

    goal_id: GoalId
    target: Annotated[PoseStamped, "goal.pose"]
    behavior_tree: Annotated[str, "goal.behavior_tree", ros.TEXT] = ""  # a file's name; empty for the robot's own


@message(f"{SEND_GOAL}_Response", 64)
@dataclass(frozen=True, slots=True)
class SendGoalResponse:
    """The response of send_goal: whether the goal was accepted, and when."""

    accepted: bool
    stamp_ns: Annotated[int, "stamp", ros.TIME]


@message(f"{GET_RESULT}_Request", 64)
@dataclass(frozen=True, slots=True)
class GetResultRequest:
    """The request of get_result, which is answered when the goal has ended."""

    goal_id: GoalId


@message(f"{GET_RESULT}_Response", 64 * _KIB)
@dataclass(frozen=True, slots=True)
class GetResultResponse:
    """The response of get_result: how the goal ended (`ros2.wire.goals.Status`). The rest differs by release."""

    status: int

    @classmethod
    def of_payload(cls, payload: bytes) -> GetResultResponse:
        """Read the status, which comes first; the rest differs from release to release."""
        if len(payload) <= _CDR_HEADER or payload[:1] != b"\0" or payload[1] > 1:
            raise Malformed(f"{len(payload)} bytes that are no {GET_RESULT}_Response")
        return cls(struct.unpack_from("b", payload, _CDR_HEADER)[0])


@message(f"{CANCEL_GOAL}_Request", 64)
@dataclass(frozen=True, slots=True)
class CancelRequest:
    """The request of action_msgs/CancelGoal."""

    goal_id: Annotated[bytes, "goal_info.goal_id.uuid", ros.GOAL_ID]  # 16 bytes; zeros for any goal
    # goals accepted up to then; 0 for the one goal, or for all goals if the id is zeros
    stamp_ns: Annotated[int, "goal_info.stamp", ros.TIME] = 0


@message(f"{CANCEL_GOAL}_Response", 64 * _KIB)
@dataclass(frozen=True, slots=True)
class CancelResponse:
    """The response of action_msgs/CancelGoal: 0 when accepted, and the goals that will be cancelled."""

    code: Annotated[int, "return_code"]
    goals: Annotated[tuple[bytes, ...], "goals_canceling", ros.listed(ros.GOAL_INFO)] = ()


@message(FEEDBACK, 0)
@dataclass(frozen=True, slots=True)
class Feedback:
    """The feedback of NavigateToPose; only sent here, since its fields differ by release."""

    goal_id: GoalId
    current: Annotated[PoseStamped, "feedback.current_pose"]
    elapsed_s: Annotated[float, "feedback.navigation_time", ros.DURATION]
    distance_left: Annotated[float, "feedback.distance_remaining"]  # m


@message("action_msgs/msg/GoalStatusArray", 64 * _KIB)
@dataclass(frozen=True, slots=True)
class GoalStatusArray:
    """action_msgs/GoalStatusArray: the goals of an action and their states (`ros2.wire.goals.Status`)."""

    goals: Annotated[tuple[tuple[bytes, int], ...], "status_list", ros.listed(ros.GOAL_STATUS)] = ()


class DiagnosticLevel(IntEnum):
    """The state of a part of a robot, by the numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@part("diagnostic_msgs/msg/DiagnosticStatus")
@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """diagnostic_msgs/DiagnosticStatus."""

    level: Annotated[DiagnosticLevel, "level", ros.INTEGER]
    name: str  # of the part; unique among all that a robot's nodes publish
    message: str
    hardware_id: str
    # names and values for people
    values: Annotated[tuple[tuple[str, str], ...], "values", ros.listed(ros.KEY_VALUE)] = ()


@message("diagnostic_msgs/msg/DiagnosticArray", 0)
@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray: the states of parts of a robot; only sent here."""

    stamp_ns: Stamp
    statuses: Annotated[tuple[DiagnosticStatus, ...], "status"]
