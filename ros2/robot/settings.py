"""The interface of a ROS 2 robot: its topics, the kind of its commands, its limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from patrol.pose import Limits, Pose
from ros2.robot.localisation import LocalisationSettings
from ros2.wire.frames import composed, inverted

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
"""The topics by their usual names, and what they hold. All but `OF_ALL_ROBOTS` are relative to the namespace."""

OF_ALL_ROBOTS = ("clock", "diagnostics")
"""Topics that ROS has outside of every namespace."""

DRIVES = ("twist-stamped", "twist", "ackermann", "nav2")
"""The commands of a robot: velocities, with or without a stamp; speeds and steering angles; or where to go."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """The interface by which a robot is driven."""

    drive: str = "twist-stamped"  # one of `DRIVES`
    base_frame: str = "base_link"  # in which velocities are meant
    map_frame: str = "map"
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
    """Return a body's largest turn rate, rad/s: a car's along its tightest turn, others' by their rim's top speed."""
    round_m = limits.turning_radius if model == "car" else limits.radius
    return limits.speed / round_m if round_m > 0.0 else math.inf
