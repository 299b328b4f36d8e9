import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata

import numpy as np
import pytest

from patrol.pose import Pose
from ros2.wire.formats import Bridge, Format, RmwZenoh
from ros2.wire.link import open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import OccupancyGrid, Odometry, TFMessage, Transform, Twist, TwistStamped
from ros2.wire.names import LATCHED, NodeName
from runtime.net.link import Link, open_link, open_session
from runtime.net.settings import router_settings
from tests.fogwatch.conftest import Refused, Shell
from tests.routers import PATIENCE_S, free_endpoint, routed


@contextmanager
def robot(where: str, form: Format) -> Iterator[None]:
    """A robot that lacks nothing."""
    link = open_ros2(where, form, NodeName("base", "robot1"), PATIENCE_S)
    cells = np.zeros((3, 4), np.int8)
    link.publisher("/map", OccupancyGrid, LATCHED).send(OccupancyGrid(1, "map", 0.05, Pose(0.0, 0.0, 0.0), cells))
    link.subscribe("cmd_vel", TwistStamped, RosMailbox())
    bridge = open_link(where, PATIENCE_S)
    if isinstance(form, Bridge):
        bridge.live("@/abc/@ros2_lv/MS/robot1§cmd_vel/geometry_msgs§msg§TwistStamped/:::")
    odometry, places = link.publisher("odom", Odometry), link.publisher("/tf", TFMessage)
    ended = threading.Event()

    def drive() -> None:
        here, still = Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0, 0.0)
        while not ended.wait(0.02):
            now = time.time_ns()
            odometry.send(Odometry(now, "odom", "base_link", here, still))
            places.send(TFMessage((Transform(now, "map", "odom", here),)))

    driving = threading.Thread(target=drive)
    driving.start()
    try:
        yield
    finally:
        ended.set()
        driving.join()
        assert link.close(PATIENCE_S)
        assert bridge.close(PATIENCE_S)


@pytest.mark.parametrize("form", [RmwZenoh(), RmwZenoh(5, hashed=False), Bridge()], ids=str)
def test_a_robot_on_a_router(form: Format, shell: Shell) -> None:
    with routed() as where, robot(where, form):
        options = ["--connect", where, "--namespace", "robot1", "--domain", str(form.domain), "--seconds", "2"]
        needed = ("a patrol could start", "/robot1/odom", "odom -> base_link", "/map: a latched map of")
        end = time.monotonic() + PATIENCE_S
        shown, code = "", -1
        while not all(words in shown for words in needed):  # on a slow machine two seconds may be too short
            assert time.monotonic() < end, shown
            code, shown, _ = shell("doctor", *options)
        assert code == 0
        assert "missing" not in shown
        assert "/robot1/cmd_vel: the robot obeys geometry_msgs/msg/TwistStamped" in shown
        told = shell("doctor", *options, "--topic", "odom=nothing", "--json")
        said = json.loads(told.out)
        assert (told.code, said["fit"]) == (1, False)
        assert any("no odometry comes on /robot1/nothing" in one["says"] for one in said["findings"])


def test_an_empty_router(shell: Shell) -> None:
    with routed() as where:
        said = shell("doctor", "--connect", where, "--seconds", "0.1")
    assert said.code == 1
    assert "missing  nothing of ROS 2 is on this router" in said.out
    assert "ok       the router does not answer about itself" in said.out


def test_a_router_that_says_who_it_is(shell: Shell) -> None:
    """As rmw_zenohd does."""
    where = free_endpoint()
    settings = {**router_settings(where), "adminspace/enabled": True}
    router = Link(open_session(settings, where, PATIENCE_S, lambda _waited: None, lambda: False))
    options = ["doctor", "--connect", where, "--namespace", "robot1", "--seconds", "0.1"]
    said = shell(*options)
    version = f"the router has Zenoh v{metadata.version('eclipse-zenoh')}"
    assert said.code == 1
    assert f"warning  {version}, and no other process is connected to it" in said.out
    with robot(where, RmwZenoh()):
        assert f"ok       {version}; connected: 2 more" in shell(*options).out
    assert router.close(PATIENCE_S)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--connect", "192.168.1.1"], "--connect '192.168.1.1': not a router's address"),
        (["--connect", "tcp/a:1", "--namespace", "*"], "--namespace '*': not a name in ROS"),
        (["--connect", "tcp/a:1", "--domain", "999"], "--domain 999: not a domain of ROS 2"),
        (["--connect", "tcp/a:1", "--localisation", "gps"], "--localisation gps: unknown; give tf, pose, odometry"),
        (["--connect", "tcp/a:1", "--topic", "odo=x"], "--topic odo=x: 'odo' is no topic of ours"),
        (["--connect", "tcp/a:1", "--topic", "odom=a b"], "--topic odom 'a b': not a name in ROS"),
        (["--connect", "tcp/a:1", "--seconds", "nan"], "--seconds nan: expected 0.1 to 600"),
        (["--connect", "tcp/a:1", "--credentials", "none"], "--credentials"),
    ],
)
def test_bad_options_are_said_in_one_line(options: list[str], words: str, refused: Refused) -> None:
    assert words in refused("doctor", *options)


def test_a_router_that_is_not_there(shell: Shell) -> None:
    said = shell("doctor", "--connect", free_endpoint(), "--wait", "0.3")
    assert said.code == 2
    assert "no router answers at" in said.err
