"""Messages of ours to CDR bytes and back. Whatever cannot be used raises `Malformed`, and nothing else."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from patrol.errors import Malformed
from ros2.wire import messages as ours
from ros2.wire import packing as ros
from ros2.wire.definitions import ACTION, CANCEL_GOAL, FEEDBACK, GET_RESULT, SEND_GOAL, store, type_hash

M = TypeVar("M")

HEADER = 4
"""Bytes of CDR's header."""
_KIB, _MIB = 1 << 10, 1 << 20
_LONGEST_TEXT = 4096


@dataclass(frozen=True, slots=True)
class Coding:
    """The coding of a class of messages."""

    type_name: str
    longest: int  # bytes of the longest payload that is read
    pack: Callable[[Any], Any]  # to a message of ROS
    unpack: Callable[[Any], Any] | None  # from one; None for what is only sent

    @property
    def type_hash(self) -> str:
        """The type's hash in ROS."""
        return type_hash(self.type_name)


def encode(message: object) -> bytes:
    """Return the bytes of a message: CDR, little endian, with its header.

    A message that holds what must not be sent raises Malformed.
    """
    coding = CODINGS[type(message)]
    return bytes(store().serialize_cdr(coding.pack(message), coding.type_name, little_endian=True))


def decode(kind: type[M], payload: bytes) -> M:
    """Return the message in a payload of any sender: CDR of either byte order, with its header.

    A payload that is no such message, or one that cannot be used, raises Malformed.
    """
    from rosbags.serde import SerdeError

    coding = CODINGS[kind]
    if coding.unpack is None:
        raise Malformed(f"{coding.type_name} is only sent")
    if len(payload) > coding.longest:
        raise Malformed(f"{len(payload)} bytes, and {coding.type_name} has at most {coding.longest}")
    if kind is ours.GetResultResponse:
        return _result(payload)  # type: ignore[return-value]
    try:
        found = store().deserialize_cdr(payload, coding.type_name)
    except (SerdeError, ValueError, IndexError, OverflowError, TypeError, struct.error):
        raise Malformed(f"{len(payload)} bytes that are no {coding.type_name}") from None
    message: M = coding.unpack(found)
    return message


def _result(payload: bytes) -> ours.GetResultResponse:
    """Return the status, which comes first; the rest differs from release to release."""
    if len(payload) <= HEADER or payload[:1] != b"\0" or payload[1] > 1:
        raise Malformed(f"{len(payload)} bytes that are no {GET_RESULT}_Response")
    return ours.GetResultResponse(struct.unpack_from("b", payload, HEADER)[0])


def _text(value: str) -> str:
    if len(value) > _LONGEST_TEXT:
        raise Malformed(f"a text of {len(value)} characters")
    return value


def _stamped(message: Any) -> tuple[int, str]:
    return ros.nanoseconds(message.header.stamp), ros.frame(message.header.frame_id)


def _pose_stamped(message: Any) -> ours.PoseStamped:
    return ours.PoseStamped(*_stamped(message), ros.plane_pose(message.pose.position, message.pose.orientation))


def _uncertain(message: Any) -> ours.PoseWithCovarianceStamped:
    pose = message.pose.pose
    return ours.PoseWithCovarianceStamped(
        *_stamped(message), ros.plane_pose(pose.position, pose.orientation), ros.variances(message.pose.covariance)
    )


def _odometry(message: Any) -> ours.Odometry:
    pose = message.pose.pose
    return ours.Odometry(
        *_stamped(message),
        ros.optional_frame(message.child_frame_id),
        ros.plane_pose(pose.position, pose.orientation),
        ros.plane_twist(message.twist.twist),
        ros.variances(message.pose.covariance),
    )


def _command_header(message: Any) -> tuple[int, str]:
    """Stamp and frame of a command, whose frame senders often leave empty."""
    return ros.nanoseconds(message.header.stamp), ros.optional_frame(message.header.frame_id)


def _drive(message: Any) -> ours.AckermannDriveStamped:
    drive = message.drive
    return ours.AckermannDriveStamped(
        *_command_header(message),
        ros.number(drive.speed),
        ros.number(drive.steering_angle),
        ros.number(drive.acceleration),
    )


def _send_goal(message: Any) -> ours.SendGoalRequest:
    identity = ros.goal_id(message.goal_id.uuid)
    return ours.SendGoalRequest(identity, _pose_stamped(message.goal.pose), _text(message.goal.behavior_tree))


def _simple(kind: str, **fields: str) -> Callable[[Any], Any]:
    """Packs a message whose fields in ROS are ours by another name."""
    return lambda message: ros.make(kind, **{name: getattr(message, own) for name, own in fields.items()})


CODINGS: dict[type, Coding] = {
    ours.Bool: Coding(
        "std_msgs/msg/Bool", 64, _simple("std_msgs/msg/Bool", data="data"), lambda m: ours.Bool(bool(m.data))
    ),
    ours.Empty: Coding("std_msgs/msg/Empty", 64, _simple("std_msgs/msg/Empty"), lambda _: ours.Empty()),
    ours.String: Coding(
        "std_msgs/msg/String",
        4 * _LONGEST_TEXT + 64,
        _simple("std_msgs/msg/String", data="data"),
        lambda m: ours.String(_text(m.data)),
    ),
    ours.Clock: Coding(
        "rosgraph_msgs/msg/Clock",
        64,
        lambda m: ros.make("rosgraph_msgs/msg/Clock", clock=ros.ros_time(m.stamp_ns)),
        lambda m: ours.Clock(ros.nanoseconds(m.clock)),
    ),
    ours.Twist: Coding("geometry_msgs/msg/Twist", 128, ros.ros_twist, ros.plane_twist),
    ours.TwistStamped: Coding(
        "geometry_msgs/msg/TwistStamped",
        2 * _KIB,
        lambda m: ros.make(
            "geometry_msgs/msg/TwistStamped", header=ros.ros_header(m.stamp_ns, m.frame), twist=ros.ros_twist(m.twist)
        ),
        lambda m: ours.TwistStamped(*_command_header(m), ros.plane_twist(m.twist)),
    ),
    ours.AckermannDriveStamped: Coding("ackermann_msgs/msg/AckermannDriveStamped", 2 * _KIB, ros.ros_drive, _drive),
    ours.PoseStamped: Coding("geometry_msgs/msg/PoseStamped", 2 * _KIB, ros.ros_pose_stamped, _pose_stamped),
    ours.PoseWithCovarianceStamped: Coding(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        4 * _KIB,
        lambda m: ros.make(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            header=ros.ros_header(m.stamp_ns, m.frame),
            pose=ros.ros_uncertain_pose(m.pose, m.variances),
        ),
        _uncertain,
    ),
    ours.Odometry: Coding("nav_msgs/msg/Odometry", 4 * _KIB, ros.ros_odometry, _odometry),
    ours.TFMessage: Coding("tf2_msgs/msg/TFMessage", 256 * _KIB, ros.ros_transforms, ros.transforms),
    ours.OccupancyGrid: Coding("nav_msgs/msg/OccupancyGrid", ros.MOST_CELLS + 4 * _KIB, ros.ros_grid, ros.grid),
    ours.Path: Coding("nav_msgs/msg/Path", _MIB, ros.ros_path, ros.path),
    ours.DiagnosticArray: Coding("diagnostic_msgs/msg/DiagnosticArray", 64 * _KIB, ros.ros_diagnostics, None),
    ours.SendGoalRequest: Coding(
        f"{SEND_GOAL}_Request",
        32 * _KIB,
        lambda m: ros.make(
            f"{SEND_GOAL}_Request",
            goal_id=ros.ros_goal_id(m.goal_id),
            goal=ros.make(f"{ACTION}_Goal", pose=ros.ros_pose_stamped(m.target), behavior_tree=_text(m.behavior_tree)),
        ),
        _send_goal,
    ),
    ours.SendGoalResponse: Coding(
        f"{SEND_GOAL}_Response",
        64,
        lambda m: ros.make(f"{SEND_GOAL}_Response", accepted=m.accepted, stamp=ros.ros_time(m.stamp_ns)),
        lambda m: ours.SendGoalResponse(bool(m.accepted), ros.nanoseconds(m.stamp)),
    ),
    ours.GetResultRequest: Coding(
        f"{GET_RESULT}_Request",
        64,
        lambda m: ros.make(f"{GET_RESULT}_Request", goal_id=ros.ros_goal_id(m.goal_id)),
        lambda m: ours.GetResultRequest(ros.goal_id(m.goal_id.uuid)),
    ),
    ours.GetResultResponse: Coding(
        f"{GET_RESULT}_Response",
        64 * _KIB,
        lambda m: ros.make(
            f"{GET_RESULT}_Response", status=m.status, result=ros.make(f"{ACTION}_Result", error_code=0)
        ),
        lambda m: ours.GetResultResponse(int(m.status)),
    ),
    ours.CancelRequest: Coding(
        f"{CANCEL_GOAL}_Request",
        64,
        lambda m: ros.make(f"{CANCEL_GOAL}_Request", goal_info=ros.ros_goal_info(m.goal_id, m.stamp_ns)),
        lambda m: ours.CancelRequest(ros.goal_id(m.goal_info.goal_id.uuid), ros.nanoseconds(m.goal_info.stamp)),
    ),
    ours.CancelResponse: Coding(
        f"{CANCEL_GOAL}_Response",
        64 * _KIB,
        lambda m: ros.make(
            f"{CANCEL_GOAL}_Response",
            return_code=m.code,
            goals_canceling=[ros.ros_goal_info(identity, 0) for identity in m.goals],
        ),
        lambda m: ours.CancelResponse(
            int(m.return_code), tuple(ros.goal_id(one.goal_id.uuid) for one in m.goals_canceling)
        ),
    ),
    ours.Feedback: Coding(
        FEEDBACK,
        4 * _KIB,
        lambda m: ros.make(
            FEEDBACK,
            goal_id=ros.ros_goal_id(m.goal_id),
            feedback=ros.make(
                f"{ACTION}_Feedback",
                current_pose=ros.ros_pose_stamped(m.current),
                navigation_time=ros.ros_duration(m.elapsed_s),
                estimated_time_remaining=ros.ros_duration(0.0),
                number_of_recoveries=0,
                distance_remaining=ros.number(m.distance_left),
            ),
        ),
        None,
    ),
    ours.GoalStatusArray: Coding(
        "action_msgs/msg/GoalStatusArray",
        64 * _KIB,
        lambda m: ros.make(
            "action_msgs/msg/GoalStatusArray",
            status_list=[
                ros.make("action_msgs/msg/GoalStatus", goal_info=ros.ros_goal_info(identity, 0), status=status)
                for identity, status in m.goals
            ],
        ),
        lambda m: ours.GoalStatusArray(
            tuple((ros.goal_id(one.goal_info.goal_id.uuid), int(one.status)) for one in m.status_list)
        ),
    ),
}
"""The coding of each class of messages."""
