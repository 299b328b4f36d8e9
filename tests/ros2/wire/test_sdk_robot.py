"""An implementation of rmw_zenoh that is not ours, as the robot: it obeys our commands, and we read its odometry."""

import importlib.util
import json
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE

import pytest

from patrol.pose import Pose
from ros2.wire.definitions import store
from ros2.wire.formats import RmwZenoh
from ros2.wire.link import open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Odometry, Twist, TwistStamped
from ros2.wire.names import EntityKind, NodeName
from tests.ros2.wire import sdk_robot
from tests.routers import PATIENCE_S, routed

MISSING = importlib.util.find_spec("zenoh_ros2_sdk") is None
pytestmark = [pytest.mark.processes, pytest.mark.skipif(MISSING, reason="the package zenoh-ros2-sdk is not installed")]
NEEDED = [sdk_robot.COMMAND, sdk_robot.ODOMETRY]


@pytest.fixture
def definitions(tmp_path: Path) -> Path:
    """A folder as the SDK wants it: the text of each type and of all types in them, in files of their own."""
    waiting = list(NEEDED)
    while waiting:
        kind = waiting.pop()
        package, _, name = kind.split("/")
        text, _ = store().generate_msgdef(kind, ros_version=2)
        own, *others = text.split("=" * 80 + "\n")
        (tmp_path / package / "msg").mkdir(parents=True, exist_ok=True)
        (tmp_path / package / "msg" / f"{name}.msg").write_text(own, encoding="utf-8")
        inner = [other.partition("\n")[0].removeprefix("MSG: ").split("/") for other in others]
        waiting += [f"{package}/msg/{name}" for package, name in inner]
    return tmp_path


@pytest.fixture
def robot(definitions: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    with routed() as where:
        host, port = where.removeprefix("tcp/").split(":")
        command = [sys.executable, str(Path(sdk_robot.__file__)), host, port, str(definitions)]
        process = subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=PIPE, text=True)
        yield where, process
        process.kill()
        process.communicate(timeout=PATIENCE_S)


def test_we_drive_a_robot_that_is_not_ours_and_see_where_it_is(robot: tuple[str, subprocess.Popen[str]]) -> None:
    where, process = robot
    us = open_ros2(where, RmwZenoh(), NodeName("fogwatch", "robot1"), PATIENCE_S)
    odometry: RosMailbox[Odometry] = RosMailbox()
    us.subscribe("odom", Odometry, odometry)
    received = odometry.take(PATIENCE_S)
    assert received is not None, process.communicate(timeout=PATIENCE_S)
    expected = Odometry(5_000_000_007, "odom", "base_link", Pose(1.0, 2.0, 0.0), Twist(0.5, 0.0, 0.0))
    assert received.message == expected
    assert len(received.sender) == 16
    assert not odometry.refused

    kinds = {(one.kind, one.topic, one.type_hash) for one in us.graph(PATIENCE_S) if one.node.name != "fogwatch"}
    hash_of = RmwZenoh().hash_of
    assert (EntityKind.PUBLISHER, "/robot1/odom", hash_of(sdk_robot.ODOMETRY)) in kinds
    assert (EntityKind.SUBSCRIPTION, "/robot1/cmd_vel", hash_of(sdk_robot.COMMAND)) in kinds

    commands = us.publisher("cmd_vel", TwistStamped)
    assert process.stdout is not None
    end = time.monotonic() + PATIENCE_S
    while not select.select([process.stdout], [], [], 0.05)[0]:
        assert time.monotonic() < end
        commands.send(TwistStamped(time.time_ns(), "base_link", Twist(0.25, 0.0, -0.5)))
    assert json.loads(process.stdout.readline()) == {"frame": "base_link", "forward": 0.25, "turn": -0.5}
    assert us.close(PATIENCE_S)
