import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.exchange import Sensed
from patrol.ground.fog import Fog
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.maps.load import load_terrain
from patrol.pose import Pose
from patrol.scenario import load_scenario
from patrol.scenario.sections import TerrainSpec
from ros2.robot import is_for_ros2, main
from ros2.robot.localisation import LocalisationSettings, Source
from ros2.robot.options import FORMATS, DriveSettings, drive_settings, options_of
from ros2.robot.shown import Shown, fog_cells, grid_of, show_map, write_map
from ros2.wire.formats import FORMATS as KNOWN
from ros2.wire.messages import OccupancyGrid
from ros2.wire.names import LATCHED, domain_given
from tests.present import present
from tests.ros2_hub import Hub
from tests.routers import PATIENCE_S

OFFICE = str(Path(__file__).parents[3] / "examples" / "maps" / "office.yaml")
NEEDED = ("--robot", "ros2", "--connect", "tcp/127.0.0.1:7447")


def options(*more: str) -> argparse.Namespace:
    return options_of([*NEEDED, *more])


@pytest.mark.parametrize(
    "line",
    [
        "--robot ros2 --connect tcp/h:1",
        "--robot=ros2 --connect=tcp/h:1 --scenario s.yaml",
        "--robot ros2 --help",
        "--robot ros2",
        "--robot rclpy --router tcp/h:1",
        "--robot=rclpy --scenario s.yaml --namespace=robot1 --credentials c",
    ],
)
def test_a_robot_of_ros_is_driven(line: str) -> None:
    assert is_for_ros2(line.split())


@pytest.mark.parametrize(
    "line",
    [
        *(f"--robot {name} --scenario s.yaml --credentials c" for name in ("ros2", "rclpy", "r1")),
        "--credentials ros2 --scenario s.yaml",
        "--help",
    ],
)
def test_a_robot_named_ros2_of_a_simulated_fleet_is_still_simulated(line: str) -> None:
    assert not is_for_ros2(line.split())


def test_what_is_not_given_is_careful() -> None:
    given = options()
    assert (given.model, given.radius, given.speed) == ("differential", 0.25, 0.25)
    settings = drive_settings(given)
    assert settings == DriveSettings()
    assert [settings.topic(name) for name in ("odom", "clock")] == ["odom", "/clock"]
    assert set(FORMATS) == set(KNOWN)


def test_everything_can_be_said() -> None:
    settings = drive_settings(
        options(
            *("--drive", "twist", "--topic", "odom=odometry/filtered", "--topic", "cmd_vel=/base/cmd", "--rate", "10"),
            *("--localisation", "odometry", "--start", "1,-2,0.5", "--delay", "0.1", "--use-sim-time"),
        )
    )
    assert (settings.drive, settings.rate_hz, settings.sim_time) == ("twist", 10.0, True)
    assert (settings.topic("odom"), settings.topic("cmd_vel")) == ("odometry/filtered", "/base/cmd")
    assert settings.localisation.source is Source.ODOMETRY
    assert settings.localisation.start == Pose(1.0, -2.0, 0.5)


def test_a_robot_brakes_as_hard_as_it_is_said_to_or_else_as_it_speeds_up() -> None:
    assert drive_settings(options("--acceleration", "4")).braking == 4.0
    assert drive_settings(options("--acceleration", "4", "--braking", "0.8")).braking == 0.8


def test_the_domain_is_the_environments_unless_it_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert domain_given(options().domain) == 7
    assert domain_given(options("--domain", "3").domain) == 3


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--radius", "nan"], "--radius nan: out of range; give 0.01 to 100"),
        (["--speed", "0"], "--speed 0: out of range"),
        (["--braking", "0"], "--braking 0: out of range; give 0.01 to 100"),
        (["--rate", "0"], "--rate 0: out of range; give 2 to 50"),
        (["--fresh", "2"], "--fresh 2: out of range; give 0.05 to 0.4"),
        (["--start", "1,2"], "--start 1,2: not a pose; give X,Y,HEADING"),
        (["--start", "1,2,inf"], "--start 1,2,inf: not finite"),
        (["--start", "no.yaml"], "no.yaml: not a pose; give X,Y,HEADING in m and rad, such as 1.5,2,0, or a file"),
        (["--start", "scenario"], "--start scenario: there is none; give --scenario, or a pose"),
        (["--transform", "1,2,0"], "--transform: places the robot's own map on ours; give ours with --map or"),
        (["--transform", "1,2", "--map", "nowhere.yaml"], "--transform 1,2: not a pose; give X,Y,HEADING"),
        (["--topic", "odom"], "--topic odom: expected NAME=TOPIC"),
        (["--topic", "odm=x"], "no topic of ours; did you mean odom?"),
        (["--topic", "odom=a b"], "--topic odom 'a b': not a name in ROS"),
        (["--drive", "ackermann"], "--drive ackermann: steers a car, and --model is differential"),
        (["--scenario", "nowhere.yaml"], "nowhere.yaml"),
        (["--map", "nowhere.yaml", "--wait", "3600"], "nowhere.yaml"),
        (["--map", "nowhere.yaml", "--robots", "a,b", "--name", "c", "--wait", "3600"], "does not hold c"),
        (["--connect", "10.0.0.1"], "--connect '10.0.0.1': not a router's address"),
        (["--namespace", "1st"], "--namespace '1st': not a name in ROS"),
        (["--domain", "300"], "--domain 300: not a domain of ROS 2"),
        (["--robots", "a,b", "--name", "c", "--wait", "3600"], "does not hold c"),
        (["--map", OFFICE, "--radius", "5", "--wait", "3600"], "--radius with --margin = 5.1: a body this wide fits"),
        (["--set", "sensor.range=-1", "--wait", "3600"], "sensor.range = -1: expected a number above 0"),
        (["--radio", "x", "--wait", "3600"], "--radio 'x': not an address for direct radio"),
        (["--router", "x", "--wait", "3600"], "--router 'x': not a router's address"),
        (["--epoch", "nan", "--wait", "3600"], "epoch_s = nan: tick 0 lies at most"),
    ],
)
def test_what_cannot_be_used_is_one_line(more: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--robot", "ros2", "--connect", "tcp/127.0.0.1:9", *more]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert words in said


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--robot ros2", "--connect: the robot's Zenoh router is missing"),
        ("--robot rclpy --connect tcp/h:1", "--connect: --robot rclpy needs no Zenoh router of the robot"),
        ("--robot rclpy --format bridge", "--format: --robot rclpy needs no Zenoh router of the robot"),
        ("--robot rclpy --ros-credentials c", "--ros-credentials: --robot rclpy needs no Zenoh router of the robot"),
        ("--robot rclpy --drive nav2", "--drive nav2: --robot rclpy sends no goals"),
        ("--robot rclpy", "--router: missing; --robot rclpy needs one for operators and the fleet"),
        ("--robot rclpy --router tcp/127.0.0.1:9", "source ROS's setup.bash with the Python that it is for"),
    ],
)
def test_how_the_robot_is_reached(
    line: str, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert main([*line.split(), "--map", OFFICE]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert words in said


def test_the_robots_map_is_read_like_a_file(tmp_path: Path) -> None:
    cells = np.zeros((20, 30), dtype=np.int8)
    cells[:, 29] = 100
    cells[0] = -1
    written = write_map(OccupancyGrid(0, "map", 0.1, Pose(-1.0, 2.0, 0.0), cells), tmp_path)
    terrain = load_terrain(TerrainSpec(map=str(written)), 0.1, tmp_path)
    assert terrain.shape == (20, 30)
    assert terrain.origin == pytest.approx((-1.0, 2.0))
    np.testing.assert_array_equal(terrain.passable, cells == 0)
    turned = write_map(OccupancyGrid(0, "map", 0.1, Pose(0.0, 0.0, 0.1), cells), tmp_path)
    with pytest.raises(BadInput, match="yaw"):
        load_terrain(TerrainSpec(map=str(turned)), 0.1, tmp_path)


def test_the_fog_is_shown_from_fresh_to_stale() -> None:
    terrain = Terrain("t", np.ones((4, 6), dtype=np.bool_), 0.5, (1.0, 2.0))
    patrolled = np.ones((4, 6), dtype=np.bool_)
    patrolled[0] = False
    fog = Fog(patrolled)
    fog.observe(footprint_of(terrain, 0.6, 360.0, True, 1.0).visible(Pose(2.25, 3.25, 0.0)), 10)
    cells = fog_cells(fog, 10, 1)
    assert set(cells[0]) == {-1}
    assert cells[2, 2] == 0
    assert cells[3, 5] == 100
    assert fog_cells(fog, 10, 2).shape == (2, 3)
    grid = grid_of(terrain, cells, 1, "map", 5)
    assert (grid.resolution, grid.origin, grid.frame, grid.stamp_ns) == (0.5, Pose(1.0, 2.0, 0.0), "map", 5)


def test_map_fog_and_path_are_latched_and_another_map_is_left_alone() -> None:
    hub = Hub()
    terrain = Terrain("t", np.ones((4, 6), dtype=np.bool_), 0.5)
    us, settings = hub.link("fogwatch", "robot1"), DriveSettings()
    assert show_map(us, settings, terrain, 1)
    assert set(hub.latched) == {"/robot1/map"}
    Shown(us, settings, terrain, Fog(np.ones((4, 6), dtype=np.bool_)), lambda: 0)
    shown = {one.topic for one in hub.entities}
    assert shown == {"/robot1/map", "/robot1/fog", "/robot1/path"}
    other = Hub()
    other.link("map_server", "robot1").publisher("map", OccupancyGrid, LATCHED)
    assert not show_map(other.link("fogwatch", "robot1"), settings, terrain, 1)


def test_fog_and_path_are_shown_on_the_robots_own_map() -> None:
    """Its map lies at (10, 5) on ours, turned to the left."""
    hub = Hub()
    terrain = Terrain("t", np.ones((4, 6), dtype=np.bool_), 0.5)
    settings = DriveSettings(localisation=LocalisationSettings(transform=Pose(10.0, 5.0, math.pi / 2)))
    shown = Shown(hub.link("fogwatch", "robot1"), settings, terrain, Fog(np.ones((4, 6), dtype=np.bool_)), lambda: 1)
    decision: Any = None
    shown.report(Sensed(0, Pose(10.0, 6.0, 2.0), False, clock_s=0.0), decision, 0.0)
    end = time.monotonic() + PATIENCE_S
    while not hub.sent["/robot1/path"]:
        assert time.monotonic() < end
        time.sleep(0.001)
    corner, (way,) = hub.sent["/robot1/fog"][0].origin, hub.sent["/robot1/path"][0].poses
    assert (corner.x, corner.y, corner.heading) == pytest.approx((-5.0, 10.0, -math.pi / 2))
    assert (way.x, way.y, way.heading) == pytest.approx((1.0, 0.0, 2.0 - math.pi / 2))


def test_a_car_turns_as_a_scenarios_car_does_unless_its_turning_radius_is_given() -> None:
    usual = load_scenario({"terrain": {"builtin": "open"}, "robots": {"model": "car"}}).roster[0].turning_radius
    for more, radius in (((), usual), (("--turning-radius", "2"), 2.0)):
        given = drive_settings(options("--model", "car", "--speed", "1", *more))
        assert given.localisation.turn_rate == 1.0 / radius


def test_a_start_from_a_file_of_ros_is_on_the_robots_map_and_any_other_on_ours(tmp_path: Path) -> None:
    own = tmp_path / "nav2.yaml"
    own.write_text("amcl: {ros__parameters: {initial_pose: {x: 1.0, y: 0.0, z: 0.0, yaw: 0.5}}}", encoding="utf-8")
    turned = ("--map", "m.yaml", "--transform", f"10,5,{math.pi / 2}")
    there = present(drive_settings(options(*turned, "--start", str(own))).localisation.start)
    assert (there.x, there.y, there.heading) == pytest.approx((10.0, 6.0, math.pi / 2 + 0.5))
    settings = drive_settings(options(*turned, "--start", "10,6,2"))
    assert settings.localisation.start == Pose(10.0, 6.0, 2.0)
    back = settings.on_robots_map(there)
    assert (back.x, back.y, back.heading) == pytest.approx((1.0, 0.0, 0.5))
