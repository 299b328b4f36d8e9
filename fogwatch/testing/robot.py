"""A check of a robot: the calls that a mind's loop makes, in its order, with ticks from a list.

    stop stop | 0 1 2 3 7 8 stop | 9 10 | none none | stop
                ^ ^     ^ ^

In each tick: sense, send and hear where the robot is its own radio, and, in the marked ticks, act.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fogwatch.testing.broken import RuleBroken
from patrol.errors import BadInput
from patrol.exchange import Sensed
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Pose, Twist, Velocity

if TYPE_CHECKING:
    from agent.own_robot import Site
    from agent.ports import Robot

TICKS = (0, 1, 2, 3, 7, 8)
"""Ticks that the clock gives; the gap is that of a decision that was too late."""

COMMANDED = (0, 1, 7, 8)
"""Ticks in which the robot is told to drive."""

SLACK_M = 0.05
"""Largest error of a robot's place, m."""

SPEED = 1.0
STEP = 0.5


def check_robot(make_robot: Callable[[Site], Robot], *, model: str = "differential") -> None:
    """Check that a robot keeps the rules of `agent.ports.Robot`, by the calls that a mind's loop makes.

    It is for robots that can be driven without anything around them: a driver with a pretended base, or a fake. Checked
    are what it senses (the clock's tick, one for each call; a finite pose; None at the end, however often it is asked),
    that it obeys a command for one step and stands when none comes, that it stops for good, may be stopped before its
    first tick and again, and, where it is a radio too, what it hears.

    Args:
        make_robot: Makes it from a `agent.own_robot.Site`, as for `agent.own_robot.drive`; for example the class.
        model: Of its body: ``holonomic``, ``differential`` or ``car``.

    Raises:
        RuleBroken: The robot breaks a rule; the message says which, at which tick and with what value.
    """
    early = _call_method("make_robot(site)", make_robot, _make_site(_Clock(), model))
    _call_stop(early, "before its first tick")
    _call_stop(early, "again")
    clock = _Clock()
    robot = _call_method("make_robot(site)", make_robot, _make_site(clock, model))
    poses: dict[int, Pose] = {}
    for k in TICKS:
        poses[k] = _call_sense(robot, clock, k).pose
        _check_moved(poses, k)
        _call_transmit(robot, k)
        if k in COMMANDED:
            command = _ahead_command(model)
            _call_method(f"act({command!r}) at tick {k}", robot.act, command)
    last = poses[TICKS[-1]]
    _call_stop(robot, "a check stops it")
    clock.more(9, 10)
    for k in (9, 10):
        sensed = _call_method(f"sense() at tick {k}, after stop", robot.sense)
        if sensed is not None and _distance_between(sensed.pose, last) > SLACK_M:
            moved = _distance_between(sensed.pose, last)
            raise RuleBroken(f"stop ends the last command too: at tick {k} the robot has moved {moved:.3f} m since")
    clock.more()
    for _ in range(2):
        clock.asked = 0
        sensed = _call_method("sense() at the end", robot.sense)
        if sensed is not None:
            raise RuleBroken(f"sense() returned {sensed!r} when the clock had ended; return None")
    _call_transmit(robot, None)
    _call_stop(robot, "the driver ends")


class _Clock:
    """A fleet clock with the ticks of a list, then None for ever."""

    def __init__(self) -> None:
        self._ticks = [*TICKS]
        self.asked = 0

    def more(self, *ticks: int) -> None:
        """Go on with other ticks."""
        self._ticks = [*ticks]

    def tick(self) -> int | None:
        """Return the next tick."""
        self.asked += 1
        return self._ticks.pop(0) if self._ticks else None

    def decide(self) -> bool:
        """Return True: it is time at once."""
        return True


def _make_site(clock: _Clock, model: str) -> Site:
    """Make a site without walls nearby, of a robot by itself."""
    from agent.own_robot import Site
    from patrol.ground.fog import Fog
    from patrol.scenario import load_scenario

    robots = [{"model": model, "speed": SPEED, "radius": 0.3, "turning_radius": 1.0}]
    free = np.ones((60, 60), dtype=np.bool_)
    terrain = Terrain("yard", free, 0.5)
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": robots, "step": STEP})

    def orders() -> Any:
        raise RuleBroken("a check has no operators; make the robot without site.orders")

    spec = scenario.roster[0]
    start = Pose(15.0, 15.0, 0.0)
    return Site(spec, start, terrain, clock, STEP, 1.0, Fog(free), {}, None, {1: spec.radius}, orders)


def _call_sense(robot: Robot, clock: _Clock, k: int) -> Sensed:
    clock.asked = 0
    sensed = _call_method(f"sense() at tick {k}", robot.sense)
    if not isinstance(sensed, Sensed):
        raise RuleBroken(f"sense() returned {sensed!r} at tick {k}; return patrol.exchange.Sensed")
    if clock.asked != 1:
        raise RuleBroken(f"sense() waits for one tick; at tick {k} it called site.clock.tick() {clock.asked} times")
    if sensed.k != k or type(sensed.k) is not int:
        raise RuleBroken(f"sense() returned k = {sensed.k!r} at tick {k}; return the tick that the clock gave")
    pose = sensed.pose
    numbers = (pose.x, pose.y, pose.heading, sensed.clock_s) if isinstance(pose, Pose) else ()
    if not numbers or not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        raise RuleBroken(f"sense() returned pose = {pose!r}, clock_s = {sensed.clock_s!r} at tick {k}; give numbers")
    if type(sensed.bumped) is not bool:
        raise RuleBroken(f"sense() returned bumped = {sensed.bumped!r} at tick {k}; give True or False")
    if not isinstance(sensed.contacts, tuple):
        raise RuleBroken(f"sense() returned contacts = {sensed.contacts!r} at tick {k}; give a tuple of (x, y)")
    return sensed


def _check_moved(poses: dict[int, Pose], k: int) -> None:
    """Compare a robot's place with its command of the tick before."""
    if k - 1 not in poses:
        return
    moved = _distance_between(poses[k], poses[k - 1])
    if k - 1 in COMMANDED:
        if abs(moved - SPEED * STEP) > SLACK_M:
            drive = f"told to drive {SPEED * STEP:g} m, at tick {k} it has moved {moved:.3f} m"
            raise RuleBroken(f"a command holds for one step: {drive}")
    elif moved > SLACK_M:
        raise RuleBroken(f"without a command it must stand: at tick {k} it has moved {moved:.3f} m by itself")


def _call_transmit(robot: Robot, k: int | None) -> None:
    """Call a robot that is its own radio, as a loop does between sensing and acting; at the end k is None."""
    when = "at the end" if k is None else f"at tick {k}"
    if callable(getattr(robot, "send", None)):
        _call_method(f"send(()) {when}", robot.send, ())  # type: ignore[attr-defined]
    if callable(getattr(robot, "hear", None)):
        frames = _call_method(f"hear() {when}", robot.hear)  # type: ignore[attr-defined]
        if frames is not None and not (isinstance(frames, list) and all(isinstance(frame, bytes) for frame in frames)):
            raise RuleBroken(f"hear() returned {frames!r} {when}; return a list of bytes, or None")
        if frames and k is None:
            raise RuleBroken(f"hear() returned {len(frames)} frames at the end; return None")


def _call_stop(robot: Robot, reason: str) -> None:
    _call_method(f"stop({reason!r})", robot.stop, reason)


def _call_method(call: str, method: Callable[..., Any], *arguments: Any) -> Any:
    """Call a method; any error breaks a rule."""
    try:
        return method(*arguments)
    except RuleBroken:
        raise
    except (Exception, SystemExit) as error:
        raise RuleBroken(f"{call} raised {type(error).__name__}: {error}; a robot raises nothing") from error


def _ahead_command(model: str) -> Command:
    """Return the command to drive ahead at full speed, from a heading of 0."""
    commands: dict[str, type[Command]] = {"holonomic": Velocity, "differential": Twist, "car": Drive}
    if model not in commands:
        raise BadInput(f"model = {model}: no such body; give holonomic, differential or car")
    return commands[model](SPEED, 0.0)


def _distance_between(a: Pose, b: Pose) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)
