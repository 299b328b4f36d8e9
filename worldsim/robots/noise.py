"""The motion of bodies under motion faults, which is not quite what they are commanded.

A body drives a share of its commanded speed, and turns a share of what it is commanded to turn, both 1 on average; it
also veers by an angle for each metre. Or it slips, and stays where it is. This is the usual noise of odometry (Thrun,
Burgard and Fox, "Probabilistic Robotics", 2005, chapter 5) put into the motion itself. For example, a body that is
commanded 2 m/s under `{kind: motion, jitter: {size: 0.2, every: 10}}` drives at 1.6 to 2.4 m/s, each speed for 10 s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, assert_never

from patrol.faults.kinds import Motion
from patrol.pose import Command, Drive, Twist, Velocity, halted, is_halt
from patrol.random import Purpose, draw, gauss

if TYPE_CHECKING:
    from patrol.scenario import Scenario
    from worldsim.faults import Entry, Timeline

SLOWEST, FASTEST = 0.05, 1.95
"""The least and the largest share of a command that one fault lets a body do, unless it slips.

They lie evenly round 1, so that cutting does not change the mean; and noise alone never stops a body.
"""

_SPEED, _TURNING, _VEER, _JITTER, _SLIP = range(5)


class MotionNoise:
    """The motion of bodies under motion faults: functions of the timeline, the tick and the command alone.

    Several motion faults of one robot act one after the other, each on what the one before it left.
    """

    def __init__(self, scenario: Scenario, timeline: Timeline) -> None:
        self.timeline = timeline
        self._seed = scenario.seed
        self._step = scenario.step
        self._models = {spec.number: spec.model for spec in scenario.roster}

    def driven(self, k: int, commands: Mapping[int, Command]) -> Mapping[int, Command]:
        """Return, for each body and its command in a tick, a command that brings it where it gets to."""
        driven = dict(commands)
        for entry in self.timeline.at(k):
            if isinstance(entry.fault, Motion):
                for number in entry.who:
                    if number in driven and not is_halt(driven[number]):
                        driven[number] = self._disturb_command(driven[number], entry, entry.fault, number, k)
        return driven

    def _disturb_command(self, command: Command, entry: Entry, fault: Motion, number: int, k: int) -> Command:
        draw_key = (self._seed, Purpose.MOTION, entry.index, number)
        slip, jitter = fault.slip, fault.jitter
        # A slip comes first: a body that does not move needs no other draw.
        if slip is not None and draw(*draw_key, stretch_of(entry, slip.every, self._step, k), _SLIP) < slip.rate:
            return halted(self._models[number])
        speed = turning = 1.0
        veer = 0.0
        if jitter is not None:
            stretch = stretch_of(entry, jitter.every, self._step, k)
            speed += jitter.size * (2.0 * draw(*draw_key, stretch, _JITTER) - 1.0)
        if fault.speed > 0.0:
            speed += fault.speed * gauss(*draw_key, k, _SPEED)
        if fault.turning > 0.0:
            turning += fault.turning * gauss(*draw_key, k, _TURNING)
        if fault.veer > 0.0:
            veer = fault.veer * gauss(*draw_key, k, _VEER)
        return _change_command(command, _clip_share(speed), _clip_share(turning), veer, self._step)


def stretch_of(entry: Entry, every: float | None, step: float, k: int) -> int:
    """Return the number of the stretch of time, all with a draw of their own, in which a tick lies.

    The first begins with the fault; each lasts `every` seconds, or one step where that is None.

    For example, with steps of 0.5 s, tick 30 of a fault since tick 4 that draws every 10 s lies in stretch 1.
    """
    elapsed = k - entry.begin
    return elapsed if every is None else math.floor(elapsed * step / every + 1e-9)


def _clip_share(share: float) -> float:
    return min(max(share, SLOWEST), FASTEST)


def _change_command(command: Command, speed: float, turning: float, veer: float, step: float) -> Command:
    """Multiply a command's speed and turning by shares, and turn its path by `veer` rad per m driven."""
    match command:
        case Velocity(vx, vy, facing):
            turn = veer * command.speed_mps * speed * step
            cosine, sine = speed * math.cos(turn), speed * math.sin(turn)
            return Velocity(vx * cosine - vy * sine, vx * sine + vy * cosine, facing)
        case Drive():
            return Drive(command.speed * speed, command.curvature * turning + veer)
        case Twist():
            return Twist(command.speed * speed, command.turn_rate * turning + veer * command.speed * speed)
        case _:
            assert_never(command)
