"""The link of a node of ROS: what DDS matches, what the graph shows, what is not installed."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from patrol.errors import BadInput
from ros2.wire.definitions import CANCEL_GOAL
from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.messages import (
    AckermannDriveStamped,
    Bool,
    CancelRequest,
    CancelResponse,
    TFMessage,
    Twist,
    TwistStamped,
)
from ros2.wire.names import LATCHED, SENSOR, USUAL, EntityKind, NodeName, Qos
from ros2.wire.ports import Sender, Service
from ros2.wire.rclpy_link import RclpyLink, import_rclpy
from runtime.process.failures import CRASHED
from tests.present import present
from tests.ros.site import OFFICE
from tests.routers import PATIENCE_S

pytestmark = [
    pytest.mark.ros,
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
    # rclpy says so of its own warning that a subscription asks for more than a publisher gives.
    pytest.mark.filterwarnings("ignore:Deprecated in favor of:DeprecationWarning"),
]

Join = Callable[[str], RclpyLink]
AHEAD = TwistStamped(1_700_000_000_000_000_000, "base_link", Twist(1.0, 0.0, 0.5))


@pytest.fixture
def join(domain: int) -> Iterator[Join]:
    made: list[RclpyLink] = []

    def joined(name: str) -> RclpyLink:
        made.append(RclpyLink(import_rclpy(), NodeName(name, "robot1"), domain, print))
        return made[-1]

    yield joined
    for link in made:
        assert link.close(PATIENCE_S)


def until(is_so: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def reach(sender: Sender[TwistStamped], mailbox: RosMailbox[TwistStamped]) -> Received[TwistStamped]:
    end_s = time.monotonic() + PATIENCE_S
    while (received := mailbox.take(0.05)) is None:
        assert time.monotonic() < end_s
        sender.send(AHEAD)
    return received


@pytest.mark.parametrize("offered", [USUAL, SENSOR, LATCHED])
@pytest.mark.parametrize("wanted", [USUAL, SENSOR, LATCHED])
def test_every_subscription_hears_every_publisher_once(offered: Qos, wanted: Qos, join: Join) -> None:
    mailbox: RosMailbox[TwistStamped] = RosMailbox(1000)
    join("fogwatch").subscribe("cmd_vel", TwistStamped, mailbox, wanted)
    sender = join("base").publisher("cmd_vel", TwistStamped, offered)
    received = reach(sender, mailbox)
    assert received.message == AHEAD
    assert abs(time.time_ns() - (received.sent_ns or 0)) < PATIENCE_S * 1e9
    assert len(received.sender) == 16
    heard = [present(received.sequence), *(reach(sender, mailbox).sequence for _ in range(20))]
    assert len(set(heard)) == len(heard)


def test_what_is_latched_reaches_those_who_come_late(join: Join) -> None:
    mailbox: RosMailbox[Bool] = RosMailbox()
    sender = join("operator").publisher("stop", Bool, LATCHED)
    sender.send(Bool(True))
    join("fogwatch").subscribe("stop", Bool, mailbox, LATCHED)
    assert present(mailbox.take(PATIENCE_S)).message == Bool(True)


def test_the_graph_tells_our_own_from_another_of_our_name(join: Join) -> None:
    us = join("fogwatch")
    us.publisher("cmd_vel", TwistStamped)
    us.subscribe("cmd_vel", TwistStamped, RosMailbox())

    def others() -> set[tuple[EntityKind, str]]:
        return {(one.kind, one.topic) for one in us.graph(0.0) if not us.is_ours(one) and one.node.name == "fogwatch"}

    own = (EntityKind.PUBLISHER, "/robot1/cmd_vel")
    until(lambda: any(us.is_ours(one) and (one.kind, one.topic) == own for one in us.graph(0.0)))
    assert own not in others()
    assert (EntityKind.NODE, "") not in others()
    them = join("fogwatch")
    until(lambda: (EntityKind.NODE, "") in others())
    them.publisher("cmd_vel", TwistStamped)
    until(lambda: own in others())
    (only,) = {one.type_hash for one in us.graph(0.0) if one.topic == "/robot1/cmd_vel"}
    assert only.startswith("RIHS01_")


def test_what_ros_has_no_package_of_is_named(join: Join) -> None:
    us = join("fogwatch")
    mailbox: RosMailbox[TFMessage] = RosMailbox()
    us.subscribe("/tf", TFMessage, mailbox)
    assert mailbox.said == {"type": "/tf: this ROS has no tf2_msgs/msg/TFMessage; install its package tf2_msgs"}
    with pytest.raises(BadInput, match="install its package ackermann_msgs"):
        us.publisher("ackermann_cmd", AckermannDriveStamped)


def test_services_are_refused(join: Join) -> None:
    us = join("fogwatch")
    cancel = Service(CANCEL_GOAL, CancelRequest, CancelResponse)
    with pytest.raises(BadInput, match="--robot rclpy calls no services"):
        us.call("cancel", cancel, CancelRequest(bytes(16)), 1.0)
    with pytest.raises(BadInput, match="--robot rclpy offers no services"):
        us.serve("cancel", cancel, RosMailbox())


DEAF = """
import runpy
from rclpy.executors import SingleThreadedExecutor
spin_once = SingleThreadedExecutor.spin_once
def spin_once_and_fail(executor):
    spin_once(executor, timeout_sec=0.0)
    raise KeyError("publisher_gid")
SingleThreadedExecutor.spin_once = spin_once_and_fail
runpy.run_module("ros2.robot", run_name="__main__")
"""


def test_an_agent_that_can_hear_no_more_ends_with_the_error() -> None:
    words = ["--robot", "rclpy", "--namespace", "robot1", "--map", str(OFFICE), "--router", "tcp/127.0.0.1:1"]
    agent = [sys.executable, "-c", DEAF, *words, "--wait", str(PATIENCE_S)]
    ended = subprocess.run(agent, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert ended.returncode == CRASHED, ended.stderr
    assert "KeyError: 'publisher_gid'" in ended.stderr
    assert "was not found" not in ended.stderr
