"""Topics, kinds of commands and limits of a ROS 2 robot, and the command line of its agent."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from patrol.errors import BadInput, did_you_mean
from patrol.pose import MODELS, Limits, Pose
from ros2.robot.localisation import RADIUS, SAME_MAP, SPEED, VARIANCES, LocalisationSettings, Source
from ros2.wire.frames import composed, inverted, pose_given
from ros2.wire.names import check_name
from runtime.process.options import ProcessParser

TOPICS: Mapping[str, str] = {
    "odom": "its odometry",
    "tf": "transforms; /tf as well while there are none here",
    "tf_static": "transforms that hold for ever, latched; /tf_static as well while there are none here",
    "amcl_pose": "poses of its localisation",
    "initialpose": "where it is at first, told to its localisation with --start",
    "cmd_vel": "our velocities",
    "ackermann_cmd": "our speeds and steering angles",
    "navigate_to_pose": "the action of its Nav2",
    "stop": "std_msgs/Bool, latched: true stops the robot, false releases it",
    "map": "the map, latched: read without --map, otherwise published",
    "fog": "what the robot believes of the fog, published",
    "path": "the way that the robot has come, published",
    "clock": "the robot's time, read with --use-sim-time",
    "diagnostics": "how the patrol and the robot do, published for rqt_robot_monitor and the like",
}
"""The topics by their usual names, with their contents. All but `OF_ALL_ROBOTS` are relative to the namespace."""

OF_ALL_ROBOTS = ("clock", "diagnostics")
"""Topics that ROS has outside of every namespace."""

DRIVES = ("twist-stamped", "twist", "ackermann", "nav2")
"""The commands of a robot: velocities, with or without a stamp; speeds and steering angles; or where to go."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """The interface by which a robot is driven."""

    drive: str = "twist-stamped"  # one of `DRIVES`
    base_frame: str = "base_link"  # in which velocities are meant
    wheelbase: float = 0.3  # of a car, m
    acceleration: float = 1.0  # the most by which the speed that the robot is told may change, m/s²
    braking: float = 1.0  # how hard the robot surely brakes, m/s²; the fence relies on it
    margin: float = 0.1  # kept clear around the body, m: the errors of localisation and of driving
    rate_hz: float = 20.0  # of commands, in the robot's time
    localisation: LocalisationSettings = field(default_factory=LocalisationSettings)
    is_shared: bool = False  # others may send it commands too
    sim_time: bool = False  # the robot's time comes from its clock topic
    topics: Mapping[str, str] = field(default_factory=dict)  # names other than the usual, by the usual ones

    def of_body(self, model: str, limits: Limits) -> DriveSettings:
        """Return the same for a body of a scenario, whose radius holds the margin."""
        turn_rate = turn_rate_of(model, replace(limits, radius=limits.radius - self.margin))
        return replace(self, localisation=replace(self.localisation, speed=limits.speed, turn_rate=turn_rate))

    def on_robots_map(self, pose: Pose) -> Pose:
        """Return a pose on the robot's map from one on ours."""
        return composed(inverted(self.localisation.transform), pose)

    @property
    def commands(self) -> str | None:
        """The usual name of the topic by which it is moved; None where it gets goals."""
        return {"nav2": None, "ackermann": "ackermann_cmd"}.get(self.drive, "cmd_vel")

    def topic(self, usual: str) -> str:
        """Return the name of a topic, by its usual name."""
        return self.topics.get(usual, f"/{usual}" if usual in OF_ALL_ROBOTS else usual)


def turn_rate_of(model: str, limits: Limits) -> float:
    """Return a body's largest turn rate, rad/s: a car's along its tightest turn, others' by their rim's top speed.

    For example, 0.5 rad/s for a differential drive at 0.1 m/s with a radius of 0.2 m, and for a car at 2 m/s that turns
    by 4 m.
    """
    # A car turns only while it drives; others turn on the spot, by wheels at their rim.
    round_m = limits.turning_radius if model == "car" else limits.radius
    return limits.speed / round_m if round_m > 0.0 else math.inf


TURNING_RADIUS = 3.5
"""A car's tightest turn unless options say otherwise, m, as in scenarios."""

SCENARIO_START = "scenario"
"""The value of --start that stands for the robot's start in the fleet's scenario."""

FORMATS = ("rmw_zenoh", "rmw_zenoh-humble", "bridge")

ROBOTS = ("ros2", "rclpy")
"""The values of --robot: over Zenoh without ROS, or as a node of the ROS that is installed here."""

DESCRIPTION = """Drive a ROS 2 robot on patrol, over its Zenoh router; ROS is not needed on this machine."""

HELP = """
First run. The robot runs a Zenoh router (rmw_zenohd, or zenoh-bridge-ros2dds) and a localisation, such as AMCL:

  fogwatch doctor --connect tcp/192.168.1.20:7447 --namespace robot1        # what is there, and what is missing
  fogwatch agent --robot ros2 --namespace robot1 --map map.yaml --connect tcp/192.168.1.20:7447 \\
      --model differential --radius 0.2 --speed 0.3

It drives as soon as it knows where it is. Ctrl-C stops the robot, and so does anybody who publishes true on its topic
stop while this program runs:

  ros2 topic pub --once --qos-durability transient_local /robot1/stop std_msgs/msg/Bool '{data: true}'

The robot then stands until false is published there, also if this program ends and starts again meanwhile: it notes
stops in the folder --state.

Several robots patrol together when each agent is given all their names and its own credentials. They meet directly:

  fogwatch fleet init yards-1 --robots robot1=192.168.1.21,robot2=192.168.1.22     # then copy each folder to its robot
  ... --namespace robot1 --robots robot1,robot2 --credentials yards-1/robot1

--start tells where it stands at first (docs/ros2/nav2.md). With --robot rclpy the agent is a node of the ROS that is
installed here (docs/ros2.md).

Speeds are in m/s, lengths in m, angles in rad. --drive says what the robot is told:

  twist-stamped   geometry_msgs/TwistStamped on cmd_vel   Nav2 and TurtleBot 3 since Jazzy (the default)
  twist           geometry_msgs/Twist on cmd_vel          robots before Jazzy
  ackermann       ackermann_msgs/AckermannDriveStamped on ackermann_cmd, with --wheelbase; for --model car
  nav2            goals of the action navigate_to_pose; Nav2 finds the way, and keeps off what no map shows

The robot stands, with zero velocity, whenever its pose is not fresh, somebody has stopped it, or the way that it needs
to stop leads off the map's ground; and when this process ends, or Ctrl-Z pauses it. The way that it needs to stop
follows from --braking: measure that, since a robot that brakes less hard than it is said to runs into walls. If this
process is killed, only the robot's own watchdog stops the robot: test that first. This program sees no people and no
obstacles that are not on the map; see docs/ros2.md.

Exit codes: 1 the robot or its policy failed, 2 bad input, 130 interrupted.
"""


def options_of(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read a command line."""
    return ros2_parser().parse_args(arguments)


def ros2_parser() -> ProcessParser:
    """Return the parser of a ROS 2 robot's command line."""
    parser = ProcessParser("fogwatch agent --robot ros2", DESCRIPTION, HELP)
    robots = "a ROS 2 robot, over Zenoh, or by the rclpy that is installed here"
    parser.add_argument("--robot", choices=ROBOTS, required=True, help=robots)
    add = parser.add_argument_group("the robot").add_argument
    add("--connect", metavar="LOCATOR", help="the robot's Zenoh router, tcp/HOST:7447; not with rclpy")
    add("--namespace", default="", metavar="NS", help="the robot's namespace, such as robot1 (default: none)")
    add("--format", choices=FORMATS, help=f"what is spoken there (default: {FORMATS[0]})")
    add("--domain", type=int, metavar="N", help="ROS_DOMAIN_ID (default: of the environment, or 0)")
    add("--ros-credentials", type=Path, metavar="FOLDER", help="for its router (default: --credentials, over TLS)")
    add("--drive", choices=DRIVES, default="twist-stamped", help="what the robot is told (default: %(default)s)")
    add("--shared-commands", action="store_true", help="drive although others send it commands too, such as a joystick")
    add("--topic", action="append", default=[], metavar="NAME=TOPIC", help=f"another name; of {', '.join(TOPICS)}")
    add("--base-frame", default="base_link", metavar="NAME", help="frame of velocities (default: %(default)s)")
    add("--use-sim-time", action="store_true", help="go by the time on /clock, of a simulated robot")

    add = parser.add_argument_group("its body").add_argument
    add("--model", choices=MODELS, default="differential", help="how it moves (default: %(default)s)")
    add("--radius", type=float, default=RADIUS, metavar="M", help="of the round body (default: %(default)s m)")
    add("--speed", type=float, default=SPEED, metavar="M/S", help="top speed (default: %(default)s m/s)")
    add("--turning-radius", type=float, metavar="M", help=f"a car's tightest turn ({TURNING_RADIUS:g} m)")
    add("--wheelbase", type=float, default=0.3, metavar="M", help="a car's, for ackermann (default: %(default)s m)")
    add("--acceleration", type=float, default=1.0, metavar="M/S2", help="told at most (default: %(default)s m/s²)")
    add("--braking", type=float, metavar="M/S2", help="it surely brakes as hard as that (default: --acceleration)")
    add("--margin", type=float, default=0.1, metavar="M", help="kept clear around it (default: %(default)s m)")
    add("--rate", type=float, default=20.0, metavar="HZ", help="commands a second (default: %(default)s)")

    add = parser.add_argument_group("where it is").add_argument
    add("--map", type=Path, metavar="FILE", help="map_server's YAML (default: the robot's latched topic map)")
    add("--map-frame", default="map", metavar="NAME", help="the map's frame (default: %(default)s)")
    add(
        "--localisation",
        choices=[source.value for source in Source],
        default=Source.TF.value,
        help="what corrects the odometry: transforms on tf, poses on amcl_pose, or nothing (default: %(default)s)",
    )
    add("--start", metavar="X,Y,HEADING|FILE|scenario", help="where it stands now; its localisation is told")
    add("--transform", metavar="X,Y,HEADING", help="where its own map lies on --map (default: they are the same)")
    add("--fresh", type=float, default=0.3, metavar="S", help="it stops without odometry for so long (%(default)s s)")
    add("--delay", type=float, metavar="S", help="age of odometry on arrival, if its stamps are wrong")

    add = parser.add_argument_group("its fleet").add_argument
    add("--name", metavar="NAME", help="of the robot in its fleet (default: its credentials', its namespace, or robot)")
    add("--robots", metavar="NAME,NAME", help="all robots of the fleet, with equal bodies (default: this one)")
    add("--scenario", type=Path, metavar="FILE", help="the fleet's scenario, instead of map, body and --robots")
    add("--set", action="append", default=[], metavar="FIELD=VALUE", help="set a field of the scenario; repeatable")
    add("--write-scenario", type=Path, metavar="FILE", help="write the scenario that the options make, for a monitor")
    add("--router", metavar="LOCATOR", help="where the fleet meets (default: the credentials', or --connect)")
    add("--fleet", metavar="NAME", help="the fleet's name (default: the credentials', or patrol)")
    add("--credentials", type=Path, metavar="FOLDER", help="this robot's, made by: fogwatch fleet init")
    radio = "for positions: group, line, router, or its folder in a mesh (default: the fleet's)"
    add("--radio", metavar="LOCATOR|FOLDER", help=radio)
    add("--epoch", type=float, metavar="S", help="Unix time of tick 0 (default: as a robot that is heard counts)")
    add("--wait", type=float, default=60.0, metavar="S", help="for routers, map and pose (default: %(default)g s)")
    add("--state", type=Path, metavar="FOLDER", help="where stops are noted (default: $STATE_DIRECTORY, or the user's)")
    return parser


def drive_settings(options: argparse.Namespace) -> DriveSettings:
    """Return how the robot is driven."""
    check_ranges(
        options,
        {
            "radius": (0.01, 100.0),
            "speed": (0.001, 100.0),
            "acceleration": (0.01, 100.0),
            "braking": (0.01, 100.0),
            "margin": (0.0, 10.0),
            "wheelbase": (0.01, 100.0),
            "rate": (2.0, 50.0),
            "fresh": (0.05, 0.4),
            "delay": (0.0, 0.4),
            "wait": (0.1, 86_400.0),
        },
    )
    _check_robot(options)
    if options.write_scenario is not None and (options.scenario is not None or options.map is None):
        raise BadInput("--write-scenario: needs --map, and no --scenario; leave it out")
    if options.drive == "ackermann" and options.scenario is None and options.model != "car":
        raise BadInput(f"--drive ackermann: steers a car, and --model is {options.model}; give --model car")
    transform = SAME_MAP if options.transform is None else pose_given("--transform", options.transform)
    if options.transform is not None and options.map is None and options.scenario is None:
        raise BadInput("--transform: places the robot's own map on ours; give ours with --map or --scenario")
    start, variances = None, VARIANCES
    if options.start == SCENARIO_START:
        if options.scenario is None:
            raise BadInput("--start scenario: there is none; give --scenario, or a pose")
    elif options.start is not None and os.path.isfile(options.start):  # noqa: PTH113 - Path raises for a long name
        from ros2.robot.initial import read_initial_pose

        map_pose, variances = read_initial_pose(Path(options.start), "--start", options.map_frame)
        start = composed(transform, map_pose)
    elif options.start is not None:
        start = pose_given("--start", options.start, ", or a file that exists")
    turning_radius = TURNING_RADIUS if options.turning_radius is None else options.turning_radius
    limits = Limits(options.speed, options.radius, turning_radius)
    return DriveSettings(
        drive=options.drive,
        base_frame=options.base_frame,
        wheelbase=options.wheelbase,
        acceleration=options.acceleration,
        braking=options.acceleration if options.braking is None else options.braking,
        margin=options.margin,
        rate_hz=options.rate,
        localisation=LocalisationSettings(
            Source(options.localisation),
            options.map_frame,
            start,
            variances,
            transform,
            options.fresh,
            options.delay,
            options.speed,
            turn_rate_of(options.model, limits),
        ),
        is_shared=options.shared_commands,
        sim_time=options.use_sim_time,
        topics=topics_given(options.topic),
    )


def _check_robot(options: argparse.Namespace) -> None:
    """Refuse options that mean nothing for how the robot is reached."""
    if options.robot == "ros2":
        if options.connect is None:
            raise BadInput("--connect: the robot's Zenoh router is missing; give it as tcp/HOST:7447")
        return
    for name in ("connect", "format", "ros_credentials"):
        if getattr(options, name) is not None:
            raise BadInput(
                f"--{name.replace('_', '-')}: --robot rclpy needs no Zenoh router of the robot; leave it out"
            )
    if options.drive == "nav2":
        raise BadInput("--drive nav2: --robot rclpy sends no goals; give --robot ros2, or --drive twist-stamped")


def check_ranges(options: argparse.Namespace, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse options that are given and out of their ranges."""
    for name, (lower, upper) in ranges.items():
        number = getattr(options, name.replace("-", "_"))
        if number is not None and not lower <= number <= upper:
            raise BadInput(f"--{name} {number:g}: out of range; give {lower:g} to {upper:g}")


def topics_given(given: Sequence[str]) -> dict[str, str]:
    """Return names of topics, by their usual names, from texts ``NAME=TOPIC``."""
    topics: dict[str, str] = {}
    for text in given:
        usual, equals, name = text.partition("=")
        if not equals or not name:
            raise BadInput(f"--topic {text}: expected NAME=TOPIC, for example odom=odometry/filtered")
        if usual not in TOPICS:
            raise BadInput(f"--topic {text}: {usual!r} is no topic of ours; {did_you_mean(usual, tuple(TOPICS))}")
        topics[usual] = check_name(name, f"--topic {usual}")
    return topics
