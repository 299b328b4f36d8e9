"""One simulated robot: its body, the velocity that it was told, and its watchdog."""

from __future__ import annotations

import math
from dataclasses import dataclass

from patrol.ground.swept_path import path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.ros2 import messages
from patrol.ros2.frames import composed, inverted
from patrol.scenario import RobotSpec
from worldsim.robots.bodies import Body, standstill
from worldsim.ros2.odometry import DriftingOdometry, Errors

STILL = messages.Twist(0.0, 0.0, 0.0)
_BARELY = 1e-9
_STANDS = 1e-3


@dataclass(frozen=True, slots=True)
class Build:
    """The dimensions and limits of a robot.

    Attributes:
        spec: Its model, top speed (m/s), radius (m) and turning radius (m).
        start: Where it is switched on.
        errors: Of its odometry.
        acceleration: Of its motors, m/s²; infinite for a body that obeys at once.
        watchdog_s: How long it obeys the last command when no other comes, s.
        seed: Of its noise.
    """

    spec: RobotSpec
    start: Pose
    errors: Errors
    acceleration: float
    watchdog_s: float
    seed: int


@dataclass(slots=True)
class Touches:
    """Counts of collisions; each counts once until the robot is free again.

    Attributes:
        walls: Walls, and the end of the terrain.
        robots: Other robots.
    """

    walls: int = 0
    robots: int = 0


class SimulatedRobot:
    """A robot in the world.

    Attributes:
        body: Its body.
        odometry: What it takes itself to have driven.
        touches: What it has run into.
        velocity: Its true velocity in its own frame.
        commands: Commands received.
        watchdog_stops: How often its watchdog has stopped it.

    Args:
        build: How it is built.
    """

    def __init__(self, build: Build) -> None:
        self.build = build
        self.body = Body(build.spec, build.start, standstill(build.spec))
        self.odometry = DriftingOdometry(build.start, build.errors, (build.seed, build.spec.number))
        self.touches = Touches()
        self.velocity = STILL
        self.commands = 0
        self.watchdog_stops = 0
        self._heading = build.start.heading
        self._told = STILL
        self._told_s = -math.inf
        self._going = STILL
        self._touching = False

    @property
    def pose(self) -> Pose:
        """The true pose. A holonomic robot turns only as it is told."""
        return Pose(self.body.pose.x, self.body.pose.y, self._heading)

    @property
    def stands(self) -> bool:
        """True if it does not move."""
        return abs(self.velocity.vx) + abs(self.velocity.vy) + abs(self.velocity.turn_rate) < _STANDS

    def obey(self, twist: messages.Twist, now_s: float) -> None:
        """A command has come.

        Args:
            twist: In the body's frame.
            now_s: The time, s.
        """
        self.commands += 1
        self._told, self._told_s = twist, now_s

    def begin(self, now_s: float, step_s: float) -> None:
        """Set the body's command for the next step of the world.

        Args:
            now_s: The time, s.
            step_s: s.
        """
        if self._told != STILL and now_s - self._told_s > self.build.watchdog_s:
            self._told = STILL
            self.watchdog_stops += 1
        self._going = eased(self._going, self._told, self.build.acceleration * step_s, self.build.spec.radius)
        self.body.command = command_of(self.build.spec, self._going, self._heading).limited(self.build.spec.limits)

    def end(self, before: Pose, terrain: Terrain, step_s: float) -> None:
        """The world has moved the body.

        Args:
            before: Where the robot was (`pose`).
            terrain: The ground.
            step_s: s.
        """
        body = self.body
        if self.build.spec.model == "holonomic":
            self._heading = before.heading + self._going.turn_rate * step_s
            body.pose = Pose(body.pose.x, body.pose.y, body.pose.heading)
        else:
            self._heading = body.pose.heading
        if body.bumped and not self._touching:
            free = path_is_free(terrain, before, body.command, step_s, self.build.spec.radius)
            self.touches.walls += not free
            self.touches.robots += free
        self._touching = body.bumped
        if body.bumped:
            self._going = STILL
        moved = composed(inverted(before), self.pose)
        self.velocity = messages.Twist(moved.x / step_s, moved.y / step_s, moved.heading / step_s)
        self.odometry.move(self.pose)


def command_of(spec: RobotSpec, twist: messages.Twist, heading: float) -> Command:
    """Return the command of a body that is told a velocity.

    Args:
        spec: Of the body.
        twist: In its own frame.
        heading: Its own, rad.
    """
    if spec.model == "holonomic":
        cos, sin = math.cos(heading), math.sin(heading)
        return Velocity(cos * twist.vx - sin * twist.vy, sin * twist.vx + cos * twist.vy)
    if spec.model == "differential":
        return Twist(twist.vx, twist.turn_rate)
    if abs(twist.vx) < _BARELY:
        return Drive(0.0, 0.0)
    return Drive(twist.vx, twist.turn_rate / twist.vx)


def eased(going: messages.Twist, told: messages.Twist, most: float, radius: float) -> messages.Twist:
    """Return the velocity nearest to what a body is told that its motors reach.

    Args:
        going: What it obeys now.
        told: What it is told.
        most: By how much a speed may change, m/s.
        radius: Of the body, m: by how much it may turn.
    """
    if math.isinf(most):
        return told
    share = min(
        1.0,
        most / max(math.hypot(told.vx - going.vx, told.vy - going.vy), _BARELY),
        most / radius / max(abs(told.turn_rate - going.turn_rate), _BARELY),
    )
    return messages.Twist(
        going.vx + (told.vx - going.vx) * share,
        going.vy + (told.vy - going.vy) * share,
        going.turn_rate + (told.turn_rate - going.turn_rate) * share,
    )
