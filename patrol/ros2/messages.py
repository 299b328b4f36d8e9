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
    """geometry_msgs/Twist: a velocity in a body's own frame.

    Attributes:
        vx: Forward, m/s.
        vy: To the left, m/s.
        turn_rate: To the left, rad/s.
    """

    vx: float
    vy: float
    turn_rate: float


@dataclass(frozen=True, slots=True)
class TwistStamped:
    """geometry_msgs/TwistStamped."""

    stamp_ns: int
    frame: str
    twist: Twist


@dataclass(frozen=True, slots=True)
class AckermannDriveStamped:
    """ackermann_msgs/AckermannDriveStamped.

    Attributes:
        stamp_ns: When it was sent.
        frame: The body's frame.
        speed: Forward, m/s.
        steering_angle: Of a wheel in the middle of the front axle, to the left, rad.
        acceleration: The most that may be used, m/s²; 0 leaves it to the robot.
    """

    stamp_ns: int
    frame: str
    speed: float
    steering_angle: float
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True)
class PoseStamped:
    """geometry_msgs/PoseStamped."""

    stamp_ns: int
    frame: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class PoseWithCovarianceStamped:
    """geometry_msgs/PoseWithCovarianceStamped.

    Attributes:
        stamp_ns: When it was so.
        frame: The frame of the pose.
        pose: The pose.
        variances: Of x (m²), y (m²) and heading (rad²).
    """

    stamp_ns: int
    frame: str
    pose: Pose
    variances: tuple[float, float, float] = UNKNOWN_VARIANCES


@dataclass(frozen=True, slots=True)
class Odometry:
    """nav_msgs/Odometry.

    Attributes:
        stamp_ns: When it was so.
        frame: The frame of the pose.
        child_frame: The body's own frame, that of the velocity; may be empty.
        pose: The pose.
        twist: The velocity.
        variances: Of the pose: x (m²), y (m²) and heading (rad²).
    """

    stamp_ns: int
    frame: str
    child_frame: str
    pose: Pose
    twist: Twist
    variances: tuple[float, float, float] = UNKNOWN_VARIANCES


@dataclass(frozen=True, slots=True)
class Transform:
    """geometry_msgs/TransformStamped: where a frame is in another.

    Attributes:
        stamp_ns: When it was so.
        frame: The frame that it is in.
        child_frame: The frame that is there.
        pose: The child's origin and heading.
    """

    stamp_ns: int
    frame: str
    child_frame: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class TFMessage:
    """tf2_msgs/TFMessage.

    Attributes:
        transforms: Those that can be used.
        refused: How many of a received message cannot: tf ignores them too, and keeps the others.
    """

    transforms: tuple[Transform, ...]
    refused: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """nav_msgs/OccupancyGrid.

    Attributes:
        stamp_ns: When it was made.
        frame: The frame of its origin.
        resolution: Side of a cell, m.
        origin: The outer corner of the first cell, and the heading of the first row.
        cells: int8 (h, w), row 0 first: 0 free to 100 occupied, -1 unknown.
    """

    stamp_ns: int
    frame: str
    resolution: float
    origin: Pose
    cells: NDArray[int8]


@dataclass(frozen=True, slots=True)
class Path:
    """nav_msgs/Path; all its poses have its stamp and its frame."""

    stamp_ns: int
    frame: str
    poses: tuple[Pose, ...]


@dataclass(frozen=True, slots=True)
class SendGoalRequest:
    """The request of nav2_msgs/action/NavigateToPose/send_goal.

    Attributes:
        goal_id: 16 bytes.
        target: Where to go.
        behavior_tree: File name of a behaviour tree; empty for the robot's own.
    """

    goal_id: bytes
    target: PoseStamped
    behavior_tree: str = ""


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
    """The response of get_result: how the goal ended (`patrol.ros2.goals.Status`). The rest differs by release."""

    status: int


@dataclass(frozen=True, slots=True)
class CancelRequest:
    """The request of action_msgs/CancelGoal.

    Attributes:
        goal_id: 16 bytes; zeros for any goal.
        stamp_ns: Goals accepted up to then; 0 for the one goal, or for all goals if the id is zeros.
    """

    goal_id: bytes
    stamp_ns: int = 0


@dataclass(frozen=True, slots=True)
class CancelResponse:
    """The response of action_msgs/CancelGoal: 0 when accepted, and the goals that will be cancelled."""

    code: int
    goals: tuple[bytes, ...] = ()


@dataclass(frozen=True, slots=True)
class Feedback:
    """The feedback of NavigateToPose; only sent here, since what it holds differs by release.

    Attributes:
        goal_id: 16 bytes.
        current: Where the robot is.
        elapsed_s: For how long it has been under way, s.
        distance_left: m.
    """

    goal_id: bytes
    current: PoseStamped
    elapsed_s: float
    distance_left: float


@dataclass(frozen=True, slots=True)
class GoalStatusArray:
    """action_msgs/GoalStatusArray: the goals of an action and how they are (`patrol.ros2.goals.Status`)."""

    goals: tuple[tuple[bytes, int], ...] = field(default=())


class DiagnosticLevel(IntEnum):
    """How a part of a robot does, as diagnostic_msgs/DiagnosticStatus numbers it."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """diagnostic_msgs/DiagnosticStatus.

    Attributes:
        level: How the part does.
        name: Of the part; unique among all that a robot's nodes publish.
        message: How it does, in one line.
        hardware_id: The robot.
        values: Names and values for people.
    """

    level: DiagnosticLevel
    name: str
    message: str
    hardware_id: str
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray: how some parts of a robot do; only sent here."""

    stamp_ns: int
    statuses: tuple[DiagnosticStatus, ...]


Message = Any
"""One of the classes above."""
