"""Messages of ROS 2 as this program needs them: SI units, angles in rad, times in ns since the epoch, and the plane.

Of a pose in space only x, y and the heading are kept. A frame's name is printable and has 1 to 255 characters, but it
may be empty in commands.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from numpy import int8
from numpy.typing import NDArray

from patrol.pose import Pose

UNKNOWN_VARIANCES = (0.0, 0.0, 0.0)
"""Variances of x (m²), y (m²) and heading (rad²) that are unknown: ROS writes them as 0."""


@dataclass(frozen=True, slots=True)
class Bool:
    """std_msgs/Bool."""

    data: bool


@dataclass(frozen=True, slots=True)
class Empty:
    """std_msgs/Empty."""


@dataclass(frozen=True, slots=True)
class String:
    """std_msgs/String, of at most 4096 characters."""

    data: str


@dataclass(frozen=True, slots=True)
class Clock:
    """rosgraph_msgs/Clock: what time it is in a simulation."""

    stamp_ns: int


@dataclass(frozen=True, slots=True)
class Twist:
    """geometry_msgs/Twist: a velocity in a body's own frame."""

    vx: float  # m/s, forward
    vy: float  # m/s, to the left
    turn_rate: float  # rad/s, to the left


@dataclass(frozen=True, slots=True)
class TwistStamped:
    """geometry_msgs/TwistStamped."""

    stamp_ns: int
    frame: str
    twist: Twist


@dataclass(frozen=True, slots=True)
class AckermannDriveStamped:
    """ackermann_msgs/AckermannDriveStamped."""

    stamp_ns: int
    frame: str
    speed: float  # m/s, forward
    steering_angle: float  # rad, to the left, of a wheel in the middle of the front axle
    acceleration: float = 0.0  # m/s², the most that may be used; 0 leaves it to the robot


@dataclass(frozen=True, slots=True)
class PoseStamped:
    """geometry_msgs/PoseStamped."""

    stamp_ns: int
    frame: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class PoseWithCovarianceStamped:
    """geometry_msgs/PoseWithCovarianceStamped."""

    stamp_ns: int
    frame: str
    pose: Pose
    variances: tuple[float, float, float] = UNKNOWN_VARIANCES  # of x (m²), y (m²) and heading (rad²)


@dataclass(frozen=True, slots=True)
class Odometry:
    """nav_msgs/Odometry."""

    stamp_ns: int
    frame: str  # of the pose
    child_frame: str  # the body's own, that of the velocity; may be empty
    pose: Pose
    twist: Twist
    variances: tuple[float, float, float] = UNKNOWN_VARIANCES  # of the pose: x (m²), y (m²) and heading (rad²)


@dataclass(frozen=True, slots=True)
class Transform:
    """geometry_msgs/TransformStamped: where a frame is in another."""

    stamp_ns: int
    frame: str  # the frame that it is in
    child_frame: str
    pose: Pose  # the child's origin and heading


@dataclass(frozen=True, slots=True)
class TFMessage:
    """tf2_msgs/TFMessage."""

    transforms: tuple[Transform, ...]
    refused: int = 0  # transforms of a received message that cannot be used; tf ignores them too, and keeps the others


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """nav_msgs/OccupancyGrid."""

    stamp_ns: int
    frame: str
    resolution: float  # m, side of a cell
    origin: Pose  # outer corner of the first cell, and the heading of the first row
    cells: NDArray[int8]  # (h, w), row 0 first: 0 free to 100 occupied, -1 unknown


@dataclass(frozen=True, slots=True)
class Path:
    """nav_msgs/Path; all its poses have its stamp and its frame."""

    stamp_ns: int
    frame: str
    poses: tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class SendGoalRequest:
    """The request of nav2_msgs/action/NavigateToPose/send_goal."""

    goal_id: bytes  # 16 bytes
    target: PoseStamped
    behavior_tree: str = ""  # a file's name; empty for the robot's own


@dataclass(frozen=True, slots=True)
class SendGoalResponse:
    """The response of send_goal: whether the goal was accepted, and when."""

    accepted: bool
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class GetResultRequest:
    """The request of get_result, which is answered when the goal has ended."""

    goal_id: bytes


@dataclass(frozen=True, slots=True)
class GetResultResponse:
    """The response of get_result: how the goal ended (`ros2.wire.goals.Status`). The rest differs by release."""

    status: int


@dataclass(frozen=True, slots=True)
class CancelRequest:
    """The request of action_msgs/CancelGoal."""

    goal_id: bytes  # 16 bytes; zeros for any goal
    stamp_ns: int = 0  # goals accepted up to then; 0 for the one goal, or for all goals if the id is zeros


@dataclass(frozen=True, slots=True)
class CancelResponse:
    """The response of action_msgs/CancelGoal: 0 when accepted, and the goals that will be cancelled."""

    code: int
    goals: tuple[bytes, ...] = ()


@dataclass(frozen=True, slots=True)
class Feedback:
    """The feedback of NavigateToPose; only sent here, since what it holds differs by release."""

    goal_id: bytes  # 16 bytes
    current: PoseStamped
    elapsed_s: float
    distance_left: float  # m


@dataclass(frozen=True, slots=True)
class GoalStatusArray:
    """action_msgs/GoalStatusArray: the goals of an action and how they are (`ros2.wire.goals.Status`)."""

    goals: tuple[tuple[bytes, int], ...] = field(default=())


class DiagnosticLevel(IntEnum):
    """How a part of a robot does, as diagnostic_msgs/DiagnosticStatus numbers it."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """diagnostic_msgs/DiagnosticStatus."""

    level: DiagnosticLevel
    name: str  # of the part; unique among all that a robot's nodes publish
    message: str
    hardware_id: str
    values: tuple[tuple[str, str], ...] = ()  # names and values for people


@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray: how some parts of a robot do; only sent here."""

    stamp_ns: int
    statuses: tuple[DiagnosticStatus, ...]


Message = Any
"""One of the classes above."""
