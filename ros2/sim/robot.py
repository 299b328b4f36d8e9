"""One simulated robot: its body, the velocity that it was told, and its watchdog."""

from __future__ import annotations

import math
from dataclasses import dataclass

from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.scenario import RobotSpec
from ros2.sim.odometry import DriftingOdometry, Errors
from ros2.wire import messages
from ros2.wire.frames import apart, composed, inverted
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


@dataclass(frozen=True, slots=True)
class Moved:
    """The result of one step for a body."""

    pose: Pose  # the true one after the step
    counted: Pose | None = None  # by its wheels, in the body's frame before the step; None for the true motion
    at_wall: bool = False  # it touches a wall, or the end of the terrain
    at_robot: bool = False


class SimulatedRobot:
    """A robot in the world.

    `pose` is the true one. `going` is the velocity that its motors reach of the last command, `velocity` that of the
    body in its own frame, as its wheels count it. A touch counts once until the robot is free again. `strayed_m` has
    for each tick the distance between the body and where exact obedience during that tick would have led it.
    """

    def __init__(self, build: Build) -> None:
        self.build = build
        self.body = Body(build.spec, build.start, standstill(build.spec))
        self.odometry = DriftingOdometry(build.start, build.errors, (build.seed, build.spec.number))
        self.going = STILL
        self.velocity = STILL
        self.walls_touched = 0  # and the end of the terrain
        self.robots_touched = 0
        self.strayed_m: list[float] = []
        self.commands = 0
        self.watchdog_stops = 0
        self.pose = self._ideal = build.start
        self._told = STILL
        self._told_s = -math.inf
        self._touching = False

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
        self.body.command = command_of(spec, self.going, self.pose.heading).limited(spec.limits)
        self._ideal = advance(self._ideal, self.body.command, step_s)

    def end(self, moved: Moved, step_s: float) -> None:
        """Take in the body's motion in the world's step."""
        body, before = self.body, self.pose
        body.distance_m += apart(body.pose, moved.pose)[0]  # 0: it did it itself
        body.pose = self.pose = moved.pose
        touching = moved.at_wall or moved.at_robot
        if touching and not self._touching:
            self.walls_touched += moved.at_wall
            # One that touches both at once counts as a wall's.
            self.robots_touched += not moved.at_wall
        self._touching = touching
        if body.bumped:
            self.going = STILL
        driven = composed(inverted(before), moved.pose) if moved.counted is None else moved.counted
        self.velocity = messages.Twist(driven.x / step_s, driven.y / step_s, driven.heading / step_s)
        self.odometry.move(moved.pose, moved.counted)

    def end_tick(self) -> None:
        """Note how far the body has come from exact obedience; the next tick begins from where it is."""
        self.strayed_m.append(apart(self._ideal, self.pose)[0])
        self.begin_tick()

    def begin_tick(self) -> None:
        """Let exact obedience begin from where the body is."""
        self._ideal = self.pose


def command_of(spec: RobotSpec, twist: messages.Twist, heading: float) -> Command:
    """Return the command of a body that is told a velocity in its own frame."""
    if spec.model == "holonomic":
        cos, sin = math.cos(heading), math.sin(heading)
        return Velocity(cos * twist.vx - sin * twist.vy, sin * twist.vx + cos * twist.vy)
    if spec.model == "differential":
        return Twist(twist.vx, twist.turn_rate)
    # A car cannot turn on the spot, and a curvature of turn rate over 0 would be infinite.
    if abs(twist.vx) < _BARELY:
        return Drive(0.0, 0.0)
    return Drive(twist.vx, twist.turn_rate / twist.vx)


def eased(going: messages.Twist, told: messages.Twist, most: float, radius: float) -> messages.Twist:
    """Return the velocity nearest to the commanded one that the motors reach.

    `most` is by how much a speed may change, m/s; a turn rate may change by `most` / `radius`.

    For example, with `most` = 0.1 and a radius of 0.3 m, a robot at rest that is told 1 m/s and 0.2 rad/s gets 0.1 m/s
    and 0.02 rad/s.
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
