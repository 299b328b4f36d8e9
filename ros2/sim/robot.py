"""One simulated robot: its body, the velocity that it was told, and its watchdog."""

from __future__ import annotations

import math
from dataclasses import dataclass

from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.scenario import RobotSpec
from ros2.sim.bodies import Moved
from ros2.sim.odometry import DriftingOdometry, Errors
from ros2.wire import messages
from ros2.wire.frames import composed, inverted
from worldsim.robots.bodies import Body, standstill

__all__ = ["Build", "SimulatedRobot"]

STILL = messages.Twist(0.0, 0.0, 0.0)
_BARELY = 1e-9
_STANDS = 1e-3


@dataclass(frozen=True, slots=True)
class Build:
    """The dimensions and limits of a robot."""

    spec: RobotSpec  # model, top speed (m/s), radius (m) and turning radius (m)
    start: Pose
    errors: Errors
    acceleration: float  # of its motors, m/s²; infinite for a body that obeys at once
    watchdog_s: float  # for which it obeys the last command when no other comes
    seed: int


@dataclass(slots=True)
class Touches:
    """Counts of collisions; each counts once until the robot is free again."""

    walls: int = 0  # and the end of the terrain
    robots: int = 0


@dataclass(slots=True)
class Strayed:
    """Distances between where a body is after each tick, and where exact obedience would have led it.

    Each is measured for obedience during that tick alone, from where the body was before it.
    """

    ticks: int = 0
    total_m: float = 0.0
    greatest_m: float = 0.0


class SimulatedRobot:
    """A robot in the world.

    `going` is the velocity that its motors reach of what it was told, `velocity` that of the body in its own frame, as
    its wheels count it.
    """

    def __init__(self, build: Build) -> None:
        self.build = build
        self.body = Body(build.spec, build.start, standstill(build.spec))
        self.odometry = DriftingOdometry(build.start, build.errors, (build.seed, build.spec.number))
        self.going = STILL
        self.touches = Touches()
        self.velocity = STILL
        self.strayed = Strayed()
        self.commands = 0
        self.watchdog_stops = 0
        self._pose = self._ideal = build.start
        self._told = STILL
        self._told_s = -math.inf
        self._touching = False

    @property
    def pose(self) -> Pose:
        """The true pose. A holonomic robot turns only as it is told."""
        return self._pose

    @property
    def stands(self) -> bool:
        """True if it does not move."""
        return abs(self.velocity.vx) + abs(self.velocity.vy) + abs(self.velocity.turn_rate) < _STANDS

    def obey(self, twist: messages.Twist, now_s: float) -> None:
        """Take in a command, in the body's frame."""
        self.commands += 1
        self._told, self._told_s = twist, now_s

    def begin(self, now_s: float, step_s: float) -> None:
        """Set the body's command for the next step of the world."""
        if self._told != STILL and now_s - self._told_s > self.build.watchdog_s:
            self._told = STILL
            self.watchdog_stops += 1
        spec = self.build.spec
        self.going = eased(self.going, self._told, self.build.acceleration * step_s, spec.radius)
        self.body.command = command_of(spec, self.going, self._pose.heading).limited(spec.limits)
        self._ideal = advance(self._ideal, self.body.command, step_s)

    def end(self, moved: Moved, step_s: float) -> None:
        """Take in what became of the body in the world's step."""
        body, before = self.body, self._pose
        body.distance_m += math.dist((body.pose.x, body.pose.y), (moved.pose.x, moved.pose.y))  # 0: it did it itself
        body.pose = self._pose = moved.pose
        touching = moved.at_wall or moved.at_robot
        if touching and not self._touching:
            self.touches.walls += moved.at_wall
            self.touches.robots += not moved.at_wall
        self._touching = touching
        if body.bumped:
            self.going = STILL
        driven = composed(inverted(before), moved.pose) if moved.counted is None else moved.counted
        self.velocity = messages.Twist(driven.x / step_s, driven.y / step_s, driven.heading / step_s)
        self.odometry.move(moved.pose, moved.counted)

    def end_tick(self) -> None:
        """Add to `strayed` how far the body has come from exact obedience; the next tick begins from where it is."""
        strayed_m = math.dist((self._ideal.x, self._ideal.y), (self._pose.x, self._pose.y))
        self.strayed.ticks += 1
        self.strayed.total_m += strayed_m
        self.strayed.greatest_m = max(self.strayed.greatest_m, strayed_m)
        self.begin_tick()

    def begin_tick(self) -> None:
        """Let exact obedience begin from where the body is."""
        self._ideal = self._pose


def command_of(spec: RobotSpec, twist: messages.Twist, heading: float) -> Command:
    """Return the command of a body that is told a velocity in its own frame."""
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

    `most` is by how much a speed may change, m/s; a turn rate may change by `most` / `radius`.
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
