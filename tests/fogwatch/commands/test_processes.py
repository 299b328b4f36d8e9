from pathlib import Path

import pytest

from tests.fogwatch.conftest import Refused, Shell
from tests.ros2_bench import write_plan

CONNECT = ["--connect", "tcp/127.0.0.1:9", "--wait", "0.2"]


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["agent", "--robot", "ros2", "--help"], "--namespace robot1 --map map.yaml --connect tcp/192.168.1.20:7447"),
        (["agent", "--help"], "fogwatch agent --robot ros2 --namespace robot1 --map map.yaml"),
        (["agent", "--help"], "--localisation {tf,pose,odometry}"),
        (["agent", "--help"], "--incarnation N"),
        (["agent", "--robot", "r1", "--help"], "fogwatch agent     --credentials yards-1/r1 --scenario yards.yaml"),
        (["robot-sim", "--help"], "--drift-heading RAD/M"),
    ],
)
def test_the_help_of_a_process_is_its_own(words: list[str], shown: str, shell: Shell) -> None:
    code, out, _ = shell(*words)
    assert code == 0
    assert shown in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["agent", "--robot", "ros2", "--connect", "10.0.0.1"], "robot: --connect '10.0.0.1': not a router's address"),
        (["agent", "--robot", "ros2", *CONNECT], "is the robot's Zenoh router running?"),
        (["agent", "--robot", "ros2"], "--connect: the robot's Zenoh router is missing; give it as tcp/HOST:7447"),
        (["agent", "--fleet", "f"], "the same for all processes; for a ROS 2 robot give --robot ros2 instead; all"),
        (["robot-sim"], "--connect LOCATOR is missing: the Zenoh router of the robots, tcp/HOST:7447; --robots NAME"),
        (["robot-sim", "--robots", "a", *CONNECT], "robot-sim: --map, --scenario: give one of the two"),
        (["robot-sim", "--robots", "a,a", "--map", "PLAN", *CONNECT], "--robots a,a: give up to 64 different names"),
        (["robot-sim", "--robots", "a:dds", "--map", "PLAN", *CONNECT], "--robots a 'dds': no such format; known are"),
        (["robot-sim", "--robots", "a", "--map", "PLAN", *CONNECT], "start one: fogwatch router"),
        (["robot-sim", "--robots", "a", "--map", "PLAN", "--start", "1,2", *CONNECT], "--start 1,2: not a pose"),
        (["robot-sim", "--robots", "a", "--map", "PLAN", "--unplug", "b@3", *CONNECT], "expected NAME@S with one of a"),
        (
            ["robot-sim", "--robots", "a", "--map", "PLAN", "--transform", "1,2", *CONNECT],
            "--transform 1,2: not a pose",
        ),
        (
            ["agent", "--robot", "ros2", *CONNECT, "--start", "-1,2,0"],
            "begins with a minus needs a =, as in --start=-1",
        ),
        (["robot-sim", "--robots", "a", "--map", "PLAN", *CONNECT, "--nonsense"], "unrecognized arguments: --nonsense"),
        (["agent", "--robot", "ros2", *CONNECT, "--nonsense"], "unrecognized arguments: --nonsense"),
        (["robot-sim", "--robots", "a", "--map", "PLAN", "--noise", "-1", *CONNECT], "--noise -1: out of range"),
        (["robot-sim", "--robots", "a", "--map", "nowhere.yaml", *CONNECT], "nowhere.yaml"),
    ],
)
def test_what_cannot_be_used_is_one_line(words: list[str], said: str, refused: Refused, tmp_path: Path) -> None:
    plan = str(write_plan(tmp_path))
    assert said in refused(*(plan if word == "PLAN" else word for word in words))


def ward(where: str, rule: str) -> str:
    return f"zones: [{{name: ward, polygon: {where}, {rule}}}]"


INSIDE, OUTSIDE = "[[1, 1], [3, 1], [3, 3]]", "[[91, 1], [93, 1], [93, 3]]"
OFF = ward(OUTSIDE, "weight: 2")
STARTS = "is the robot's Zenoh router running?"
BY_NAV2 = ("--drive", "nav2", "--name", "robot")


@pytest.mark.parametrize(
    ("more", "words", "says"),
    [
        (
            ward(INSIDE, "speed: 0.3"),
            BY_NAV2,
            "zones.0.speed = 0.3: Nav2 drives to goals at its own speed; give it the mask for its speed",
        ),
        (ward(INSIDE, "weight: 3"), BY_NAV2, STARTS),
        (OFF, (), "{site}: zones.0: ward lies outside of plan, which spans x 0 to 8 m and y 0 to 6 m; move or drop it"),
        (OFF, ("--set", "zones=[]"), STARTS),
        ("", ("--set", OFF.replace(": ", "=", 1)), "robot: zones.0: ward lies outside of plan"),
        (
            f"closures: [{{name: door, polygon: {INSIDE}, closed: [[9, 20]]}}]",
            (),
            "{site}: closures: a ROS 2 robot reports nothing blocked here; drop them",
        ),
    ],
)
def test_what_a_ros2_robot_cannot_patrol_is_said_of_the_scenarios_file(
    more: str, words: tuple[str, ...], says: str, shell: Shell, tmp_path: Path
) -> None:
    site = tmp_path / "site.yaml"
    site.write_text(f"terrain: {{map: {write_plan(tmp_path)}}}\nrobots: [{{name: robot}}]\n{more}\n")
    said = shell("agent", "--robot", "ros2", "--scenario", site, *words, *CONNECT)
    assert said.code == 2
    assert says.format(site=site) in said.err
