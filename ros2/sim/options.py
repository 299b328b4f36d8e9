"""The command line of simulated ROS 2 robots."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from patrol.errors import BadInput
from patrol.pose import MODELS
from ros2.robot.options import check_ranges
from ros2.sim.node import DRIVES
from runtime.process.options import ProcessParser

FORMAT = "rmw_zenoh"
MOST_ROBOTS = 64

HELP = """
Robots that talk like real ones, with a localisation, on a Zenoh router that you start; ROS is not needed:

  fogwatch router                                                                 # as rmw_zenohd on a robot
  fogwatch robot-sim --map plan.yaml --connect tcp/127.0.0.1:7447 --robots robot1
  fogwatch agent --robot ros2 --namespace robot1 --map plan.yaml --connect tcp/127.0.0.1:7447

Other bodies than our own, such as those of a physics engine (docs/ros2/mujoco.md):

  fogwatch robot-sim --map plan.yaml --robots robot1 ... --bodies examples/mujoco/bodies.py:MujocoBodies

Each robot may have a format of its own; --scenario says body and place of each, as it does for the agents:

  fogwatch robot-sim --scenario fleet.yaml --robots r1,r2:bridge,r3:rmw_zenoh-humble --delay 0.1 --noise 0.05

What is measured counts from when all robots have been driven once. It is written to --out when the time is over, or at
Ctrl-C. Exit codes: 0 the time is over, 2 bad input, 130 interrupted.
"""


def parser() -> ProcessParser:
    """Return the parser of the command line of simulated ROS 2 robots."""
    sim_parser = ProcessParser("fogwatch robot-sim", "Simulate ROS 2 robots, to try an agent without a robot.", HELP)
    add = sim_parser.add_argument
    add("--connect", required=True, metavar="LOCATOR", help="the Zenoh router of the robots, tcp/HOST:7447")
    add("--robots", required=True, metavar="NAME[:FORMAT],...", help="formats: rmw_zenoh, rmw_zenoh-humble, bridge")
    add("--domain", type=int, default=0, metavar="N", help="ROS_DOMAIN_ID (default: %(default)s)")
    add("--map", type=Path, metavar="FILE", help="map_server's YAML")
    add("--scenario", type=Path, metavar="FILE", help="a fleet's scenario, instead of map and body")
    add("--margin", type=float, default=0.0, metavar="M", help="by which the scenario's radii exceed the bodies (0)")
    add("--model", choices=MODELS, default="differential", help="how they move (default: %(default)s)")
    add("--radius", type=float, default=0.25, metavar="M", help="of the round bodies (default: %(default)s m)")
    add("--speed", type=float, default=0.25, metavar="M/S", help="top speed (default: %(default)s m/s)")
    add("--turning-radius", type=float, default=3.5, metavar="M", help="a car's tightest turn (%(default)s m)")
    add("--start", action="append", default=[], metavar="X,Y,HEADING", help="of the next robot; repeatable")
    add("--acceleration", type=float, default=math.inf, metavar="M/S2", help="of their motors (default: unlimited)")
    add("--watchdog", type=float, default=0.5, metavar="S", help="they stop when no command comes (%(default)s s)")
    add("--drive", choices=DRIVES, default=DRIVES[0], help="what they are told (default: %(default)s)")
    add("--wheelbase", type=float, default=0.3, metavar="M", help="a car's (default: %(default)s m)")
    add("--bodies", metavar="FILE.py:CLASS", help="moves them, instead of our own bodies (ros2/sim/bodies.py)")
    add("--odometry-rate", type=float, default=20.0, metavar="HZ", help="of odometry (default: %(default)s)")
    add("--delay", type=float, default=0.0, metavar="S", help="of all that they say (default: %(default)s s)")
    add("--noise", type=float, default=0.0, metavar="M", help="of x and y in odometry (default: %(default)s m)")
    add("--noise-heading", type=float, default=0.0, metavar="RAD", help="of its heading (default: %(default)s rad)")
    add("--drift", type=float, default=0.01, metavar="SHARE", help="of the way, in odometry (default: %(default)s)")
    add("--drift-heading", type=float, default=0.002, metavar="RAD/M", help="of its heading (default: %(default)s)")
    add("--pose-noise", type=float, default=0.0, metavar="M", help="of x and y that localisation finds (%(default)s m)")
    add("--pose-noise-heading", type=float, default=0.0, metavar="RAD", help="of its heading (%(default)s rad)")
    add("--show-map", action="store_true", help="publish the map, latched")
    add("--lost", action="store_true", help="their localisation waits to be told on initialpose where they are")
    add("--transform", default="0,0,0", metavar="X,Y,HEADING", help="where their map lies on ours (%(default)s)")
    add("--nav2", action="store_true", help="offer navigate_to_pose")
    add("--unplug", action="append", default=[], metavar="NAME@S", help="that robot's odometry ends after so long")
    add("--seed", type=int, default=7, metavar="K", help="of the noise (default: %(default)s)")
    add("--pace", type=float, metavar="X", help="times real time (default: the scenario's, or 1); else on /clock")
    add("--duration", type=float, default=math.inf, metavar="S", help="of what is measured (default: until Ctrl-C)")
    add("--out", type=Path, metavar="FILE", help="write what was measured, as JSON (default: print it)")
    add("--poses", type=Path, metavar="FILE", help="write the true poses in each tick of the patrol, as CSV")
    add("--wait", type=float, default=60.0, metavar="S", help="for the router (default: %(default)g s)")
    return sim_parser


def robots_of(options: argparse.Namespace) -> dict[str, str]:
    """Return the format of each robot by its name, which is its namespace too.

    For example, ``r1,r2:bridge`` gives ``{"r1": "rmw_zenoh", "r2": "bridge"}``.
    """
    texts = [text.strip().partition(":") for text in options.robots.split(",")]
    formats = {name: form or FORMAT for name, _, form in texts}
    # Fewer formats than texts: a name was given twice.
    if len(texts) > MOST_ROBOTS or len(formats) < len(texts):
        raise BadInput(f"--robots {options.robots}: give up to {MOST_ROBOTS} different names")
    return formats


def unplugged(options: argparse.Namespace, names: Sequence[str]) -> dict[str, float]:
    """Return when robots' odometry ends, s, by name; that of the others never ends.

    For example, ``{"r1": 30.0}`` for ``--unplug r1@30``.
    """
    times = {}
    for text in options.unplug:
        name, _, when = text.partition("@")
        if name not in names or not when.replace(".", "", 1).isdecimal():
            raise BadInput(f"--unplug {text}: expected NAME@S with one of {', '.join(names)}, such as {names[0]}@30")
        times[name] = float(when)
    return times


def check(options: argparse.Namespace) -> None:
    """Refuse values out of range, and a map together with a scenario."""
    check_ranges(
        options,
        {
            "margin": (0.0, 10.0),
            "acceleration": (0.01, math.inf),
            "watchdog": (0.05, 3600.0),
            "wheelbase": (0.01, 100.0),
            "odometry-rate": (1.0, 50.0),
            "delay": (0.0, 10.0),
            "noise": (0.0, 10.0),
            "noise-heading": (0.0, 3.0),
            "pose-noise": (0.0, 10.0),
            "pose-noise-heading": (0.0, 3.0),
            "drift": (0.0, 1.0),
            "drift-heading": (0.0, 1.0),
            "pace": (0.01, 100.0),
            "duration": (0.5, math.inf),
        },
    )
    if (options.map is None) == (options.scenario is None):
        raise BadInput("--map, --scenario: give one of the two")
