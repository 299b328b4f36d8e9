"""The topics of a simulated robot: the topics of a ROS 2 robot with a localisation, and perhaps with Nav2."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from ros2.sim.nav2 import THERE_M, Navigator
from ros2.sim.robot import SimulatedRobot
from ros2.wire.frames import apart, composed, inverted
from ros2.wire.goals import GoalServer, Status
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import (
    AckermannDriveStamped,
    Clock,
    OccupancyGrid,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    TFMessage,
    Transform,
    Twist,
    TwistStamped,
)
from ros2.wire.names import LATCHED, SENSOR
from ros2.wire.ports import Ros2Link

MAP, ODOM, BASE = "map", "odom", "base_link"

THE_WORLD = Pose(0.0, 0.0, 0.0)
"""The pose of a map that is the world's."""

CLOCK_HZ = 50.0
CORRECTION_HZ = 10.0
ANOTHER_M, ANOTHER_RAD = 0.2, 0.2
"""Motion between two poses of the localisation, as AMCL has it."""

FOUND_M, FOUND_RAD = 1.0, 0.5
"""Largest errors of a pose that it is told from which its localisation finds the true one."""

_ROOM = 64
_ROUNDING_S = 1e-3
"""Rounding allowed in a time since the epoch, s: a double holds it to less than a microsecond, and steps add up."""


@dataclass(frozen=True, slots=True)
class Habits:
    """The settings of a robot's topics."""

    drive: str = "twist-stamped"  # its commands: one of `DRIVES`
    wheelbase: float = 0.3  # of a car, m
    odometry_hz: float = 20.0
    delay_s: float = 0.0  # of everything that it says
    tells_time: bool = False  # its time is its own, so that it publishes it
    has_map: bool = False  # it publishes the map, latched
    has_nav2: bool = False
    is_lost: bool = False  # its localisation waits to be told on `initialpose` where it is, as AMCL does
    transform: Pose = THE_WORLD


def _velocity_of_car(drive: AckermannDriveStamped, habits: Habits) -> Twist:
    # Near a right angle the tangent would be infinite.
    curvature = math.tan(max(-1.5, min(1.5, drive.steering_angle))) / habits.wheelbase
    return Twist(drive.speed, 0.0, drive.speed * curvature)


_COMMANDS: dict[str, tuple[str, type, Callable[[Any, Habits], Twist]]] = {
    "twist-stamped": ("cmd_vel", TwistStamped, lambda stamped, _habits: stamped.twist),
    "twist": ("cmd_vel", Twist, lambda twist, _habits: twist),
    "ackermann": ("ackermann_cmd", AckermannDriveStamped, _velocity_of_car),
}
DRIVES = tuple(_COMMANDS)
"""The commands of a robot: topic, message, and the velocity that it stands for, by the name in options."""


class Every:
    """A clock for events at equal intervals."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._due_s = -math.inf

    def is_so(self, now_s: float) -> bool:
        """Return True if it is due, once in each interval."""
        if now_s < self._due_s - _ROUNDING_S:
            return False
        # Not in a burst after a pause.
        self._due_s = max(self._due_s + self._period_s, now_s)
        return True


class RobotNode:
    """A simulated robot's node.

    `plugged` is False once its odometry has stopped; `said` counts the messages sent.
    """

    def __init__(self, link: Ros2Link, robot: SimulatedRobot, habits: Habits, terrain: Terrain) -> None:
        self.robot = robot
        self.plugged = True
        self.said = 0
        self._habits = habits
        self._due: deque[tuple[float, Callable[[], None]]] = deque()
        self._odometry = link.publisher("odom", Odometry, SENSOR)
        self._tf = link.publisher("tf", TFMessage)
        self._poses = link.publisher("amcl_pose", PoseWithCovarianceStamped, LATCHED)
        self._clock = link.publisher("/clock", Clock, SENSOR) if habits.tells_time else None
        self._odometry_due = Every(1.0 / habits.odometry_hz)
        self._correction_due = Every(1.0 / CORRECTION_HZ)
        self._clock_due = Every(1.0 / CLOCK_HZ)
        self._localised: Pose | None = None
        self._believed: Pose | None = None if habits.is_lost else habits.transform  # pose of its map
        self._told: RosMailbox[PoseWithCovarianceStamped] = RosMailbox(_ROOM)
        link.subscribe("initialpose", PoseWithCovarianceStamped, self._told)
        self._goals = GoalServer(link) if habits.has_nav2 else None
        self._navigator = Navigator(terrain, robot.build.spec) if habits.has_nav2 else None
        self._going_since_s: float | None = None
        topic, kind, self._velocity_of = _COMMANDS[habits.drive]
        self._commands: RosMailbox[Any] = RosMailbox(_ROOM)
        link.subscribe(topic, kind, self._commands)
        if habits.has_map:
            cells = np.where(terrain.free, 0, 100).astype(np.int8)
            corner = composed(inverted(habits.transform), Pose(*terrain.origin, 0.0))
            grid = OccupancyGrid(0, MAP, terrain.point, corner, cells)
            link.publisher("map", OccupancyGrid, LATCHED).send(grid)

    def hear(self, now_s: float) -> None:
        """Take in the robot's commands; the time is s since the epoch."""
        while (received := self._told.take()) is not None:
            if received.message.frame == MAP:
                self._localise_at(received.message.pose)
        while (command := self._commands.take()) is not None:
            self.robot.obey(self._velocity_of(command.message, self._habits), now_s)
        if self._goals is not None and self._navigator is not None:
            self._navigate_to_goal(self._goals, self._navigator, now_s)

    def say(self, now_s: float) -> None:
        """Send the messages that are due; the time is s since the epoch."""
        stamp_ns = round(now_s * 1e9)
        if self._clock is not None and self._clock_due.is_so(now_s):
            self._clock.send(Clock(stamp_ns))
        odometry = self.robot.odometry
        if self._odometry_due.is_so(now_s):
            message = Odometry(stamp_ns, ODOM, BASE, odometry.say(), self.robot.velocity)
            if self.plugged:
                self._send_later(now_s, lambda: self._odometry.send(message))
        if self._believed is not None:
            if self._correction_due.is_so(now_s):
                correction = composed(inverted(self._believed), odometry.correction)
                tf_message = TFMessage((Transform(stamp_ns, MAP, ODOM, correction),))
                self._send_later(now_s, lambda: self._tf.send(tf_message))
            self._say_pose(self._believed, now_s, stamp_ns)
        while self._due and self._due[0][0] <= now_s:
            self._due.popleft()[1]()
            self.said += 1

    def _localise_at(self, told: Pose) -> None:
        """Believe a pose on its map; from one that is nearly right its localisation finds the true one."""
        true = composed(inverted(self._habits.transform), self.robot.pose)
        away_m, turned = apart(true, told)
        if away_m <= FOUND_M and turned <= FOUND_RAD:
            self._believed = self._habits.transform
        else:
            self._believed = composed(self.robot.pose, inverted(told))
        self._localised = None

    def _say_pose(self, own_map: Pose, now_s: float, stamp_ns: int) -> None:
        pose, last = self.robot.pose, self._localised
        if last is not None:
            away_m, turned = apart(pose, last)
            if away_m < ANOTHER_M and turned < ANOTHER_RAD:
                return
        self._localised = pose
        self.robot.odometry.localise()
        message = PoseWithCovarianceStamped(stamp_ns, MAP, composed(inverted(own_map), self.robot.odometry.found))
        self._send_later(now_s, lambda: self._poses.send(message))

    def _send_later(self, now_s: float, send: Callable[[], None]) -> None:
        self._due.append((now_s + self._habits.delay_s, send))

    def _navigate_to_goal(self, goals: GoalServer, navigator: Navigator, now_s: float) -> None:
        """Drive to the goal that the robot has, if it has one."""
        stamp_ns = round(now_s * 1e9)
        target = goals.step(stamp_ns)
        own_map = self._believed
        if target is None or own_map is None:
            if self._going_since_s is not None:
                self._going_since_s = None
                self.robot.obey(Twist(0.0, 0.0, 0.0), now_s)
            return
        self._going_since_s = now_s if self._going_since_s is None else self._going_since_s
        pose = self.robot.pose
        goal = composed(own_map, target.pose)
        distance_m, _ = apart(pose, goal)
        here = PoseStamped(stamp_ns, MAP, composed(inverted(own_map), pose))
        goals.feedback(here, now_s - self._going_since_s, distance_m)
        velocity = navigator.velocity(pose, goal)
        if distance_m < THERE_M:
            goals.finish(Status.SUCCEEDED)
        elif velocity is None:
            goals.finish(Status.ABORTED)
        else:
            self.robot.obey(velocity, now_s)
