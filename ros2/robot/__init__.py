"""The driver of a ROS 2 robot.

Where it is (the time comes with each call, and there are no links):

    initial.py       where it stands at first, and how its localisation is told
    localisation.py  which odometry can be believed; from that and a correction of its drift to where it is now

How it is moved (all but steering.py gets the time with each call and has no links):

    fence.py         how fast a command may be obeyed so that the body can still stop on the ground, clear of others
    governor.py      what the robot is told next: limits, fence, stops; whether its pose follows
    steering.py      by velocities, or by goals for its Nav2

How it is stopped:

    stops.py         stops by operators and by a topic, the files that note them, and whether the robot stands

What connects them:

    options.py       topics, kinds of commands, limits, and these on a command line
    process.py       the process around a mind that drives a robot
    hardware.py      what the robot says of itself, its time, what stops it, and its other drivers
    driver.py        the mind's body, the thread that drives, and all its parts put together
    shown.py         the robot's own map; map, fog and path for viewers
    diagnostics.py   how patrol and robot do, for the robot's own tools
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive a ROS 2 robot until asked to leave."""
    from ros2.robot.options import options_of
    from runtime.process.context import ProcessContext, run_with

    def drive_robot(process: ProcessContext) -> int:
        from ros2.robot.process import drive  # loads much, and --help need not wait for it

        return drive(process)

    return run_with(options_of(arguments), "robot", drive_robot)


def is_for_ros2(arguments: Sequence[str]) -> bool:
    """Return True if a command line of ``fogwatch agent`` is meant for a ROS 2 robot.

    A robot of a simulated fleet may be called ros2 or rclpy; its command line names a scenario, and neither a robot's
    router nor a namespace.
    """
    words = [word for token in arguments for word in (token.split("=", 1) if token.startswith("--") else [token])]
    robot = next((second for first, second in itertools.pairwise(words) if first == "--robot"), "")
    option = {"ros2": "--connect", "rclpy": "--namespace"}.get(robot)
    return option is not None and (option in words or "--scenario" not in words)
