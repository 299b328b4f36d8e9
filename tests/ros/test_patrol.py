"""A patrol with a robot that is a real node of ROS 2, over the relay and by rclpy; processes die, and it goes on.

The tests of one module share a robot, each leaves it on patrol, and what it has done lies in ``build/ros``.
"""

import importlib
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros import base
from tests.ros.site import OUT, RADIUS, Site, least_clearance_m, length_m, site_of

# rclpy's parser imports a module that Python calls deprecated.
pytestmark = [pytest.mark.ros, pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")]

OFTEN = 30
"""As many commands come in one and a half seconds."""


@pytest.fixture(scope="module", params=["bridge", "rclpy"])
def site(request: pytest.FixtureRequest) -> Iterator[Site]:
    folder = OUT / str(request.param)
    shutil.rmtree(folder, ignore_errors=True)
    with site_of(str(request.param), folder) as made:
        yield made
        assert length_m(made.track) > 10.0
        assert least_clearance_m(made.track) > RADIUS


def test_it_patrols(site: Site) -> None:
    site.drives(5.0)
    assert site.track[-1]["commands"] > OFTEN


def test_the_agent_knows_ros_only_where_it_is_a_node_of_it(site: Site) -> None:
    site.drives()
    loaded = Path(f"/proc/{site.running['agent'].pid}/maps").read_text(encoding="utf-8")
    assert ("librcl.so" in loaded) == (site.kind == "rclpy")


def test_it_stands_when_an_operator_says_so_until_it_is_released(site: Site) -> None:
    site.drives()
    site.control("stop")
    begin = len(site.track)
    commands = site.track[-1]["commands"]
    site.until(lambda: site.track[-1]["commands"] > commands + OFTEN)
    assert length_m(site.track[begin:]) == 0.0
    site.control("release")
    site.drives()


def test_it_stands_by_itself_when_its_agent_is_killed_and_goes_on_with_the_next(site: Site) -> None:
    site.drives()
    timeouts = site.track[-1]["timeouts"]
    site.kill("agent")
    site.stands()
    assert site.track[-1]["timeouts"] > timeouts
    commands = site.track[-1]["commands"]
    site.start_agent()
    site.drives()
    assert site.track[-1]["commands"] > commands


def test_it_stands_while_the_relay_is_dead(site: Site) -> None:
    if site.kind != "bridge":
        pytest.skip("there is no relay")
    site.drives()
    said = len(site.read_log("agent"))
    site.kill("relay")
    site.stands()
    site.says("agent", "stands: no odometry for", said)
    site.start_relay()
    site.recovers(said)


def test_it_goes_on_when_the_robot_has_been_switched_off_and_on(site: Site) -> None:
    site.drives()
    said = len(site.read_log("agent"))
    site.kill("base")
    site.says("agent", "stands: no odometry for", said)
    site.start_base()
    site.recovers(said)


def test_the_doctor_sees_the_robot_and_names_what_is_missing(site: Site) -> None:
    if site.kind != "bridge":
        pytest.skip("the doctor looks at Zenoh, and this robot is not there")
    site.drives()
    site.kill("agent")
    site.doctor(
        "zenoh-bridge-ros2dds",
        "/robot1/odom: 20",
        "the robot knows its place on the map",
        "/robot1/cmd_vel: the robot obeys geometry_msgs/msg/TwistStamped",
        "a patrol could start",
    )
    site.switch_off("base")
    site.start_base("odom")
    site.doctor("poses in the frame odom alone; have it give them in map, or give --map-frame", "a patrol cannot start")
    said = len(site.read_log("agent"))
    site.start_agent()
    site.says("agent", "poses of the localisation are in the frame 'odom', not map; correct that", said)
    site.switch_off("base")
    site.start_base()
    site.drives()


def test_the_graph_shows_what_the_documents_say(site: Site) -> None:
    """`docs/ros2.md`: what the agent publishes and hears; with a bridge, what that carries of it."""
    rclpy: Any = importlib.import_module("rclpy")
    site.drives()
    with rclpy.init():
        node = rclpy.create_node("looks")
        space = f"/{base.NAMESPACE}"

        def shows() -> bool:
            types = dict(node.get_topic_names_and_types())
            obeys = {one.node_name for one in node.get_subscriptions_info_by_topic(f"{space}/cmd_vel")}
            drives = {one.node_name for one in node.get_publishers_info_by_topic(f"{space}/cmd_vel")}
            named = [f"{there}/{name}".replace("//", "/") for name, there in node.get_node_names_and_namespaces()]
            ours = "fogwatch" if site.kind == "rclpy" else "fogwatch_relay"
            pictures = {"map": "OccupancyGrid", "fog": "OccupancyGrid", "path": "Path"} if site.kind == "rclpy" else {}
            return (
                types.get(f"{space}/cmd_vel") == ["geometry_msgs/msg/TwistStamped"]
                and types.get(f"{space}/odom") == ["nav_msgs/msg/Odometry"]
                and all(types.get(f"{space}/{name}") == [f"nav_msgs/msg/{kind}"] for name, kind in pictures.items())
                and ("/diagnostics" in types) == (site.kind == "rclpy")
                and "base" in obeys
                and drives == {ours}
                and named.count(f"{space}/base") == 1
            )

        site.until(shows)


def test_a_second_agent_does_not_start(site: Site) -> None:
    if site.kind != "rclpy":
        pytest.skip("a bridge does not show it")
    site.drives()
    place = ["--robot", "rclpy", "--router", site.endpoint, "--namespace", base.NAMESPACE, "--localisation", "pose"]
    code, said = site.fogwatch("agent", *place, "--state", str(site.folder / "other"), "--robots", "robot1")
    assert code == 2
    assert "another agent, /robot1/fogwatch: drives the robot already" in said
