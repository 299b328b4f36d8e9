"""The steering of a ROS 2 robot: by velocities, or by goals for its Nav2.

The mind says once a tick by `want` where it leads; `step` moves on many times a tick, if that is safe, and returns why
the robot stands though the mind wants to go on. `halt` stops it, whatever else is going on, until `go_on`.
`unconfirmed` is the part of the last stop that is not confirmed, empty where there is nothing to confirm.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from patrol.ground.swept_path import advance
from patrol.pose import Command, Drive, Pose
from ros2.robot.fence import Others
from ros2.robot.governor import Governor, Response, velocity_of
from ros2.robot.hardware import Hardware
from ros2.robot.localisation import Fix
from ros2.robot.stops import moves
from ros2.wire.frames import travelled
from ros2.wire.goals import GoalClient, Going
from ros2.wire.messages import AckermannDriveStamped, PoseStamped, Twist, TwistStamped

Place = tuple[float, float]
"""x and y on the map, m."""

ENOUGH_M = 0.3
"""The way that a robot must have been told to go before it is judged whether it did, m: well beyond pose errors."""
STUCK_SHARE = 0.25
"""A robot that gets less far than this share of its command stands before an obstacle that is on no map."""

LASTING_ZEROS = 5
"""Number of messages of zero velocity at the end: single messages may be lost."""
ZEROS_S = 0.05
"""Time between two of them, s. A router with a limit drops commands that come too soon after the last one, zeros too
(`ros2.wire.access.COMMAND_HZ`)."""

CONFIRM_S = 1.0
"""Time for Nav2 to confirm that it has cancelled its goals when a robot is halted, s."""

ANOTHER_M = 0.5
"""Least distance of a new goal from the last one, m."""
AGAIN_S = 3.0
"""Time for which a goal that has failed is not sent again, s."""

HALTED = "it was halted"


class VelocitySteering:
    """Tells a robot its velocity."""

    def __init__(self, hardware: Hardware, governor: Governor, others: Others, response: Response) -> None:
        self._hardware = hardware
        self._response = response
        self._governor = governor
        self._others = others
        self._send = _command_sender(hardware)
        self._progress = MotionCheck()
        self._steps = 0
        self._held = 0
        self._halted = False

    def want(self, command: Command, goal: Place | None, now_s: float) -> None:
        """The command counts; the goal does not."""
        del goal
        self._governor.want(command, now_s)
        self._others.look(now_s)

    def step(self, fix: Fix | None, now_s: float, since_s: float, stopped: str) -> str:
        """Send the velocity that is safe; `stopped` is the reason why the robot has to stand, empty if it has not."""
        if self._halted:
            return HALTED
        current = self._governor.command
        pose = None if fix is None else fix.pose
        command = self._governor.step(pose, now_s, since_s, stopped, self._others.around(now_s))
        self._send(command, 0.0 if fix is None else fix.pose.heading)
        self._progress.told(current, since_s)
        self._response.told(current, pose, since_s)
        self._steps += 1
        self._held += self._governor.fenced and command.speed_mps == 0.0
        return self._governor.why if command.speed_mps == 0.0 else ""

    def ahead(self, fix: Fix, lead_s: float) -> Pose:
        """Predict the robot's place if it goes on as commanded last."""
        return travelled(fix.pose, velocity_of(self._governor.command, fix.pose.heading), lead_s)

    def blocked(self, pose: Pose) -> bool:
        """Return True if the robot did not get on as commanded, or the fence held it mostly, since the last call."""
        is_held = self._held > 0.5 * self._steps
        self._steps = self._held = 0
        return self._progress.ended(pose) or is_held

    def halt(self) -> None:
        """Send zero velocity several times, and nothing else until `go_on`."""
        self._halted = True
        for number in range(LASTING_ZEROS):
            if number:
                time.sleep(ZEROS_S)
            self._send(Drive(0.0, 0.0), 0.0)

    def go_on(self) -> None:
        """Send velocities again; from zero, whatever was wanted before."""
        self._governor.step(None, 0.0, 0.0, HALTED)
        self._halted = False

    @property
    def unconfirmed(self) -> str:
        """Nothing: robots do not answer velocities, so only odometry tells."""
        return ""


class MotionCheck:
    """The check that a robot goes where it was told to go."""

    def __init__(self) -> None:
        self._begin: Pose | None = None
        self._meant: Pose | None = None

    def told(self, command: Command, time_s: float) -> None:
        """The robot was told something for some time, s."""
        if self._meant is not None:
            self._meant = advance(self._meant, command, time_s)

    def ended(self, pose: Pose) -> bool:
        """Return True if the robot has not got on; it is judged anew each time it was told to go far enough."""
        if self._begin is None or self._meant is None:
            self._begin = self._meant = pose
            return False
        across, up = self._meant.x - self._begin.x, self._meant.y - self._begin.y
        way = math.hypot(across, up)
        if way < ENOUGH_M:
            return False
        # Only the part along the commanded way counts: sliding aside is no progress.
        along = ((pose.x - self._begin.x) * across + (pose.y - self._begin.y) * up) / way
        self._begin = self._meant = pose
        return along < STUCK_SHARE * way


class GoalSteering:
    """Tells a robot where to go, and leaves the way there to its Nav2.

    A robot that must stand has its goals cancelled until Nav2 confirms it, and again whenever it moves: a message may
    be lost, and a goal that was on its way may be accepted late.
    """

    def __init__(self, hardware: Hardware) -> None:
        self._hardware = hardware
        self._goals = GoalClient(hardware.link, hardware.settings.topic("navigate_to_pose"))
        self._wanted: Place | None = None
        self._sent: Place | None = None
        self._failed_s = -math.inf
        self._failures = 0
        self._halted = False

    def want(self, command: Command, goal: Place | None, now_s: float) -> None:
        """The goal counts; a robot without one stays."""
        del command, now_s
        self._wanted = goal

    def step(self, fix: Fix | None, now_s: float, since_s: float, stopped: str) -> str:
        """Send a goal where it has changed; cancel it where the robot must stand."""
        del since_s
        why = HALTED if self._halted else stopped
        why = why or ("nobody knows where it is" if fix is None else "")
        if why or fix is None or self._wanted is None:
            self._withdraw_goal(fix, self._halted or bool(stopped))
            return why
        moment_s = time.monotonic()
        going = self._goals.step(moment_s)
        # No new goal before Nav2 has confirmed that the old one is gone.
        if going is Going.STOPPING:
            return ""
        if going is Going.FAILED and self._sent is not None:
            self._sent, self._failed_s = None, now_s
            self._failures += 1
        if self._sent is None:
            # A place that cannot be reached would otherwise be asked for in each step.
            new = now_s - self._failed_s >= AGAIN_S
        else:
            # Nav2 plans anew for each goal, so small changes are left out.
            new = math.dist(self._sent, self._wanted) > ANOTHER_M
        if new:
            x, y = self._wanted
            heading = math.atan2(y - fix.pose.y, x - fix.pose.x)
            settings = self._hardware.settings
            pose = settings.on_robots_map(Pose(x, y, heading))
            target = PoseStamped(self._hardware.stamp_ns(), settings.localisation.map_frame, pose)
            self._goals.go(target, moment_s)
            self._sent = self._wanted
        return ""

    def ahead(self, fix: Fix, lead_s: float) -> Pose:
        """Predict the robot's place if it goes on as its odometry says."""
        return travelled(fix.pose, fix.twist, lead_s)

    def blocked(self, pose: Pose) -> bool:
        """Return True if a goal has failed since the last call."""
        del pose
        failures, self._failures = self._failures, 0
        return failures > 0

    def halt(self) -> None:
        """Cancel every goal of the robot until Nav2 confirms it, for `CONFIRM_S` at most, and send none any more."""
        self._halted = True
        self._sent = None
        self._goals.stop(time.monotonic())
        end_s = time.monotonic() + CONFIRM_S
        while self._goals.step(time.monotonic()) is Going.STOPPING and time.monotonic() < end_s:
            time.sleep(ZEROS_S)

    def go_on(self) -> None:
        """Send goals again."""
        self._halted = False

    @property
    def unconfirmed(self) -> str:
        """The stop, while Nav2 has not confirmed that it has cancelled its goals."""
        return "Nav2 has not confirmed that it has cancelled its goals" if self._goals.going is Going.STOPPING else ""

    def _withdraw_goal(self, fix: Fix | None, must: bool) -> None:
        """Have no goal of ours; with `must`, no goal of another client may move the robot either."""
        moment_s = time.monotonic()
        going = self._goals.step(moment_s)
        self._sent = None
        ours = going in {Going.ASKED, Going.UNDER_WAY, Going.FAILED}
        unknown = going in {Going.NOWHERE, Going.THERE} or (going is Going.STOPPED and fix is not None and moves(fix))
        if ours or (must and unknown):
            self._goals.stop(moment_s)


def steering_of(command: Drive, wheelbase: float) -> tuple[float, float]:
    """Return the speed (m/s) and the steering angle (rad) of a car whose axles are `wheelbase` (m) apart.

    For example, an angle of 0.245 rad for a curvature of 0.5 /m and axles 0.5 m apart.
    """
    return command.speed, math.atan(wheelbase * command.curvature)


def _command_sender(hardware: Hardware) -> Callable[[Command, float], None]:
    """Return the function that sends a command; it takes the heading of the body, rad."""
    settings, link = hardware.settings, hardware.link
    frame = settings.base_frame
    if settings.drive == "ackermann":
        cars = link.publisher(settings.topic("ackermann_cmd"), AckermannDriveStamped)

        def steer(command: Command, _heading: float) -> None:
            speed, angle = steering_of(command, settings.wheelbase) if isinstance(command, Drive) else (0.0, 0.0)
            cars.send(AckermannDriveStamped(hardware.stamp_ns(), frame, speed, angle, settings.acceleration))

        return steer
    if settings.drive == "twist":
        plain = link.publisher(settings.topic("cmd_vel"), Twist)
        return lambda command, heading: plain.send(velocity_of(command, heading))
    stamped = link.publisher(settings.topic("cmd_vel"), TwistStamped)
    return lambda command, heading: stamped.send(
        TwistStamped(hardware.stamp_ns(), frame, velocity_of(command, heading))
    )


Steering = VelocitySteering | GoalSteering
