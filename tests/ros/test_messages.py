"""The types of a real ROS 2, beside ours: the hashes that its publishers announce, and its messages in our codec."""

import importlib
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from patrol.pose import Pose
from ros2.wire import messages as ours
from ros2.wire.codec import CODINGS, decode, encode
from ros2.wire.definitions import ACTION, type_hash
from tests.routers import PATIENCE_S

pytestmark = [pytest.mark.ros, pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")]

NO_WHEEL = {"ackermann_msgs", "tf2_msgs"}
"""Packages of messages of which there is no wheel."""

STAMP = 1_700_000_000_123_456_789
POSE = Pose(1.5, -2.25, 0.75)
TWIST = ours.Twist(0.5, -0.25, 0.125)
MESSAGES: list[Any] = [
    ours.Bool(True),
    ours.Clock(STAMP),
    TWIST,
    ours.TwistStamped(STAMP, "base_link", TWIST),
    ours.PoseStamped(STAMP, "map", POSE),
    ours.PoseWithCovarianceStamped(STAMP, "map", POSE, (0.25, 0.5, 0.0625)),
    ours.Odometry(STAMP, "odom", "base_link", POSE, TWIST, (0.25, 0.5, 0.0625)),
    ours.OccupancyGrid(STAMP, "map", 0.0625, POSE, np.array([[0, 100, -1], [7, 50, 93]], dtype=np.int8)),
    ours.Path(STAMP, "map", (POSE, Pose(0.0, 0.0, 0.0))),
    ours.GoalStatusArray(((bytes(range(16)), 4),)),
]
TYPES = sorted(coding.type_name for coding in CODINGS.values() if "/msg/" in coding.type_name)


def class_of(type_name: str) -> Any:
    """Return rclpy's class of a message."""
    package, _, name = type_name.partition("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


@pytest.fixture(scope="module")
def node() -> Iterator[Any]:
    rclpy: Any = importlib.import_module("rclpy")
    with rclpy.init():
        yield rclpy.create_node("announces")


@pytest.mark.parametrize("type_name", [name for name in TYPES if name.partition("/")[0] not in NO_WHEEL])
def test_real_publishers_announce_our_hashes(type_name: str, node: Any) -> None:
    topic = f"/{type_name.replace('/', '_')}"
    publisher = node.create_publisher(class_of(type_name), topic, 1)
    end_s = time.monotonic() + PATIENCE_S
    while not (found := node.get_publishers_info_by_topic(topic)):
        assert time.monotonic() < end_s
    assert str(found[0].topic_type_hash) == type_hash(type_name)
    node.destroy_publisher(publisher)


def test_types_without_a_wheel_are_still_without(node: Any) -> None:
    """Once there is one, the tests above should know it."""
    del node
    for package in [*NO_WHEEL, ACTION.partition("/")[0]]:
        with pytest.raises(ImportError):
            importlib.import_module(f"{package}.msg")


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_messages_pass_through_the_codecs_of_both(message: Any) -> None:
    """Our bytes, read and written by ROS, are a message of ROS that says the same, and come back as they were."""
    serialization: Any = importlib.import_module("rclpy.serialization")
    kind = class_of(CODINGS[type(message)].type_name)
    payload = encode(message)
    theirs = serialization.deserialize_message(payload, kind)
    back = serialization.serialize_message(theirs)
    assert serialization.deserialize_message(back, kind) == theirs
    again, direct = decode(type(message), back), decode(type(message), payload)
    if isinstance(message, ours.OccupancyGrid):
        assert np.array_equal(again.cells, message.cells)
        again, direct = (replace(grid, cells=message.cells) for grid in (again, direct))
        again, direct = str(again), str(direct)
    assert again == direct
    assert theirs != kind()


def test_what_ros_reads_of_our_odometry() -> None:
    serialization: Any = importlib.import_module("rclpy.serialization")
    sent = ours.Odometry(STAMP, "odom", "base_link", POSE, TWIST, (0.25, 0.5, 0.0625))
    theirs = serialization.deserialize_message(encode(sent), class_of("nav_msgs/msg/Odometry"))
    assert (theirs.header.stamp.sec, theirs.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert (theirs.header.frame_id, theirs.child_frame_id) == ("odom", "base_link")
    assert (theirs.pose.pose.position.x, theirs.pose.pose.position.y) == (POSE.x, POSE.y)
    turned = theirs.pose.pose.orientation
    assert 2.0 * math.atan2(turned.z, turned.w) == pytest.approx(POSE.heading)
    assert list(theirs.pose.covariance[[0, 7, 35]]) == [0.25, 0.5, 0.0625]
    twist = theirs.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (TWIST.vx, TWIST.vy, TWIST.turn_rate)
