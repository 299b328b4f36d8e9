"""The pose that a robot's localisation is told: from files of ROS, and until it agrees."""

import math
from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.pose import Pose
from ros2.robot.initial import InitialPose, read_initial_pose
from ros2.wire.codec import decode, encode
from ros2.wire.messages import PoseWithCovarianceStamped
from tests.ros2_hub import Hub

# Not the product's own, so that a wrong one there is noticed.
AGAIN_S = 2.0
SETTLED_S = 1.0
VARIANCES = (0.25, 0.25, (math.pi / 12.0) ** 2)

ECHOED = """header:
  stamp:
    sec: 1717430000
    nanosec: 250000000
  frame_id: map
pose:
  pose:
    position:
      x: {x}
      y: -2.0
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: {z}
      w: {w}
  covariance:
{covariance}
---
"""
"""A PoseWithCovarianceStamped as ``ros2 topic echo`` writes it."""


def echoed(x: float = 1.5, heading: float = 0.5, variances: tuple[float, float, float] = (0.01, 0.02, 0.03)) -> str:
    numbers = [0.0] * 36
    numbers[0], numbers[7], numbers[35] = variances
    listed = "\n".join(f"  - {number}" for number in numbers)
    return ECHOED.format(x=x, z=math.sin(heading / 2), w=math.cos(heading / 2), covariance=listed)


WITHOUT = echoed().partition("  covariance:")[0]


def read(folder: Path, text: str) -> tuple[Pose, tuple[float, float, float]]:
    path = folder / "pose.yaml"
    path.write_text(text, encoding="utf-8")
    return read_initial_pose(path, "--start", "map")


@pytest.mark.parametrize(
    "text",
    [
        "amcl:\n  ros__parameters:\n    set_initial_pose: true\n    initial_pose: {x: 1.5, y: -2, z: 0.0, yaw: 0.5}\n",
        "/robot1/amcl:\n  ros__parameters:\n    initial_pose:\n      x: 1.5\n      y: -2.0\n      yaw: 0.5\n",
        "robot1:\n  amcl: {ros__parameters: {initial_pose: {x: 1.5, y: -2.0, yaw: 0.5}}}\n  map_server: {}\n",
        echoed(variances=(0.0, 0.0, 0.0)),
        echoed(x=9.0) + echoed(variances=(0.0, 0.0, 0.0)),
        "pose: {position: {x: 1.5, y: -2.0}, orientation: {x: 0, y: 0, z: 0.2474039592545229, w: 0.9689124217106447}}",
    ],
)
def test_files_of_ros_are_read(text: str, tmp_path: Path) -> None:
    pose, variances = read(tmp_path, text)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.5, -2.0, 0.5))
    assert variances == VARIANCES


def test_the_variances_of_a_message_are_kept(tmp_path: Path) -> None:
    assert read(tmp_path, echoed())[1] == (0.01, 0.02, 0.03)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no pose in it; give the output of 'ros2 topic echo --once /amcl_pose'"),
        ("amcl: {ros__parameters: {max_beams: 60}}", "no pose in it"),
        ("amcl: {ros__parameters: {initial_pose: {x: 1, y: 2}}}", "amcl.initial_pose.yaw = null: expected a finite"),
        (
            "{r1: {amcl: {ros__parameters: {initial_pose: {}}}}, r2: {amcl: {ros__parameters: {initial_pose: {}}}}}",
            "an initial_pose of several nodes, r1/amcl, r2/amcl; leave the robot's own",
        ),
        ("pose: {position: {x: 1, y: 2}}", "pose.orientation: missing"),
        ("pose: {position: {x: a, y: 2}, orientation: {x: 0, y: 0, z: 0, w: 1}}", 'pose.position.x = "a": expected'),
        ("pose: {position: {x: 1, y: 2}, orientation: {x: 0, y: 0, z: 0, w: 0}}", "a quaternion that is not 1 long"),
        ("pose: {position: {x: 1, y: .inf}, orientation: {x: 0, y: 0, z: 0, w: 1}}", "y = Infinity: expected"),
        (
            "amcl: {ros__parameters: {initial_pose: {x: 1, y: 2, yaw: 90}}}",
            "amcl.initial_pose.yaw = 90: more than a full turn; give rad, for example 1.57 for 90 degrees",
        ),
        (
            echoed().replace("  - 0.03\n", ""),
            "pose.covariance = 35 numbers: expected 36 numbers; export the pose again",
        ),
        (WITHOUT + "  covariance: wide\n", 'pose.covariance = "wide": expected 36 numbers'),
        (WITHOUT, "pose.covariance = null: expected 36 numbers"),
        (echoed().replace("  - 0.0\n", "  - .nan\n", 1), "pose.covariance.1 = NaN: expected a finite number"),
        (echoed().replace("frame_id: map", "frame_id: odom"), 'header.frame_id = "odom": expected map'),
    ],
)
def test_what_holds_no_pose_is_refused_in_one_line(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path, text)
    assert words in str(caught.value)
    assert str(tmp_path / "pose.yaml") in str(caught.value)


def test_the_pose_is_told_until_the_localisation_agrees() -> None:
    hub = Hub()
    sender = hub.link("fogwatch", "robot1").publisher("initialpose", PoseWithCovarianceStamped)
    start = Pose(1.5, 2.0, 3.0)
    initial = InitialPose(start, PoseWithCovarianceStamped(0, "map", start, VARIANCES), sender)
    told = hub.sent["/robot1/initialpose"]
    assert not initial.doubt(start, 0.0), "a localisation that agrees is told nothing"
    assert not initial.was_told
    initial.tell(0, 0.0)
    assert not told, "the robot's time is unknown"
    for moment_s in (0.5, 1.0, 0.5 + AGAIN_S, 0.6 + AGAIN_S):
        initial.tell(7, moment_s)
    assert told == [PoseWithCovarianceStamped(7, "map", start, VARIANCES)] * 2
    assert decode(PoseWithCovarianceStamped, encode(told[0])) == told[0]
    now_s = 0.5 + SETTLED_S
    assert initial.was_told
    assert initial.doubt(start, now_s - 0.1)
    assert initial.doubt(Pose(2.3, 2.0, -3.1), now_s) == ""
    assert "has it at (4.50, 6.00, 3.00), 5.00 m and 0.00 rad from --start" in initial.doubt(Pose(4.5, 6.0, 3.0), now_s)
    assert "1.00 rad from --start" in initial.doubt(Pose(1.5, 2.0, 2.0), now_s)
