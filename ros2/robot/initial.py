"""The place where a robot stands at first: read from a command line or a file of ROS, and told to its localisation.

AMCL says nothing until it is told on ``initialpose`` where the robot is; RViz does that with a click. A message that is
sent before AMCL listens is lost, so it is repeated until the localisation agrees. A localisation that knows where the
robot is already is told nothing: it would believe a wrong place too.

    tell (1.5, 2, 0)    ... no transform yet ...    tell again    ... map -> odom comes, 0.1 m off: the robot is found
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from patrol.errors import BadInput, quoted
from patrol.files.untrusted import POSE
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.pose import Pose
from ros2.robot.localisation import VARIANCES, Variances
from ros2.wire.frames import apart, heading_given
from ros2.wire.messages import PoseWithCovarianceStamped
from ros2.wire.ports import Sender

AGAIN_S = 2.0
"""Time between two messages while the localisation does not agree, s. AMCL answers with its next scan."""

SETTLED_S = 1.0
"""Time for the localisation to take in the first message, s; until then it may speak of another place."""

NEAR_M, NEAR_RAD = 1.0, 0.5
"""Distance and angle within which a localisation agrees: two standard deviations of the pose that it was told."""

_EXPORTS = "the output of 'ros2 topic echo --once /amcl_pose', or Nav2 parameters with amcl's initial_pose"


class InitialPose:
    """Tells a robot's localisation where the robot is, until it agrees.

    `start` is on our map, `told` is the same on the robot's map, as it is sent; its stamp does not matter.
    """

    def __init__(self, start: Pose, told: PoseWithCovarianceStamped, sender: Sender[PoseWithCovarianceStamped]) -> None:
        self._start = start
        self._told = told
        self._sender = sender
        self._first_s = math.inf
        self._last_s = -math.inf

    def tell(self, stamp_ns: int, moment_s: float) -> None:
        """Send the pose, if it is time to; nothing is sent while the robot's time is unknown (0)."""
        if stamp_ns and moment_s - self._last_s >= AGAIN_S:
            message = self._told
            self._sender.send(PoseWithCovarianceStamped(stamp_ns, message.frame, message.pose, message.variances))
            self._first_s, self._last_s = min(self._first_s, moment_s), moment_s

    @property
    def was_told(self) -> bool:
        """True if the pose was sent. From then on the localisation says what it was told, be it right or not."""
        return not math.isinf(self._first_s)

    def doubt(self, pose: Pose, moment_s: float) -> str:
        """Return why the localisation does not agree, in one line; empty if it does.

        `pose` is where it says that the robot is, on our map.
        """
        if self.was_told and moment_s - self._first_s < SETTLED_S:
            return "its localisation has just been told where it is"
        away_m, turned = apart(pose, self._start)
        if away_m <= NEAR_M and turned <= NEAR_RAD:
            return ""
        where = f"({pose.x:.2f}, {pose.y:.2f}, {pose.heading:.2f})"
        return (
            f"its localisation has it at {where}, {away_m:.2f} m and {turned:.2f} rad from --start; "
            "correct --start or leave it out, or see whether its localisation takes poses on initialpose"
        )


def read_initial_pose(path: Path, option: str, frame: str) -> tuple[Pose, Variances]:
    """Read a pose on the robot's map, and its variances, from a file of ROS in one of two forms.

    A message, as ``ros2 topic echo --once /amcl_pose > pose.yaml`` writes it; of several the last counts. Or parameters
    of Nav2's AMCL, as in a file of parameters or from ``ros2 param dump``: ``initial_pose: {x: 1.5, y: 2, yaw: 0}``.

    A message has to be in `frame`. Its variances count as far as they are above 0, otherwise RViz's do. `option` is
    what gave the file, for errors.
    """
    where = f"{option} {path}"
    messages = [text for text in re.split(r"^---\s*$", read_text(path, POSE), flags=re.MULTILINE) if text.strip()]
    says = parse_yaml(messages[-1], str(path)) if messages else None
    if isinstance(says, Mapping) and isinstance(says.get("pose"), Mapping):
        return _of_message(where, says, frame)
    poses = list(_initial_poses(says, ""))
    if len(poses) > 1:
        names = ", ".join(name for name, _ in poses)
        raise BadInput(f"{where}: has an initial_pose of several nodes, {names}; leave the robot's own in a file")
    if not poses:
        raise BadInput(f"{where}: no pose in it; give {_EXPORTS}")
    name, pose = poses[0]
    within = f"{where}: {name}.initial_pose"
    x, y, yaw = (_read_number(within, pose, key) for key in ("x", "y", "yaw"))
    return Pose(x, y, heading_given(f"{within}.yaw", yaw)), VARIANCES


def _of_message(where: str, says: Mapping[str, Any], frame: str) -> tuple[Pose, Variances]:
    """Return pose and variances of a PoseWithCovarianceStamped, or of a PoseStamped, which has no variances."""
    header = says.get("header")
    frame_id = header.get("frame_id", frame) if isinstance(header, Mapping) else frame
    if frame_id != frame:
        raise BadInput(
            f"{where}: header.frame_id = {quoted(frame_id)}: expected {frame}, the robot's map; echo amcl_pose"
        )
    outer, within = says["pose"], "pose"
    if isinstance(outer.get("pose"), Mapping):
        variances = _read_variances(where, outer.get("covariance"))
        outer, within = outer["pose"], "pose.pose"
    else:
        variances = VARIANCES
    position, turn = (_read_mapping(f"{where}: {within}", outer, key) for key in ("position", "orientation"))
    x, y = (_read_number(f"{where}: {within}.position", position, key) for key in ("x", "y"))
    qx, qy, qz, qw = (_read_number(f"{where}: {within}.orientation", turn, key) for key in ("x", "y", "z", "w"))
    if not 0.9 <= math.hypot(qx, qy, qz, qw) <= 1.1:
        raise BadInput(f"{where}: {within}.orientation: a quaternion that is not 1 long; export the pose again")
    heading = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return Pose(x, y, heading), variances


def _read_variances(where: str, covariance: Any) -> tuple[float, float, float]:
    """Return the variances of x, y and the heading in a covariance; the usual ones where it has none."""
    if not isinstance(covariance, list) or len(covariance) != 36:
        listed = f"{len(covariance)} numbers" if isinstance(covariance, list) else quoted(covariance)
        raise BadInput(f"{where}: pose.covariance = {listed}: expected 36 numbers; export the pose again")
    # The 36 are a 6 by 6 matrix over x, y, z and three angles, row by row: its diagonal has x at 0, y at 7 and the
    # heading at 35.
    numbers = dict(enumerate(covariance))
    matrix = [_read_number(f"{where}: pose.covariance", numbers, index) for index in numbers]
    vx, vy, turned = (
        matrix[index] if matrix[index] > 0.0 else usual for index, usual in zip((0, 7, 35), VARIANCES, strict=True)
    )
    return vx, vy, turned


def _initial_poses(says: Any, name: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Find nodes' parameters with an initial pose, however deep their namespaces are; with the nodes' names."""
    if not isinstance(says, Mapping):
        return
    parameters = says.get("ros__parameters")
    if isinstance(parameters, Mapping) and isinstance(parameters.get("initial_pose"), Mapping):
        yield name, parameters["initial_pose"]
    for key, inner in says.items():
        if key != "ros__parameters":
            yield from _initial_poses(inner, f"{name}/{key}".replace("//", "/").lstrip("/"))


def _read_mapping(where: str, says: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    mapping = says.get(key)
    if not isinstance(mapping, Mapping):
        raise BadInput(f"{where}.{key}: missing; export the pose again")
    return mapping


def _read_number(where: str, says: Mapping[Any, Any], key: Any) -> float:
    number = says.get(key)
    if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
        raise BadInput(f"{where}.{key} = {quoted(number)}: expected a finite number")
    return float(number)
