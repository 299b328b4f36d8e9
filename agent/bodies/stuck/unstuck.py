"""The unstuck algorithm: how a car leaves a dead end (paper, "unstuck", five steps)."""

from __future__ import annotations

import math
from collections.abc import Callable

from agent.bodies.steering import CarSteering
from patrol.pose import TAU, Drive, Pose, wrap

ORIENTED = math.pi / 8
"""Largest deviation from the desired heading that counts as oriented, rad: half of one of eight sectors."""

CALM_S = 10.0
"""A dead end that begins later than this after the last one counts as a new one, s."""

LONGEST_RETREAT = 6
"""Upper bound of the number of steps that a robot backs before it tries again."""

AT_A_LOSS = 4
"""Number of dead ends in a row from which on the next direction is random."""

HOPELESS_S = 10.0
"""Time in one dead end after which the robot takes another, random direction, s."""

YIELDS = 0.5
"""Probability that a robot that bumped stands still for a step, so that of two that block each other one can go."""

EASIER = (1.0, 0.5, 0.25, 0.125)
"""Shares of the full speed, tried in turn where a full step does not fit."""


class Unstuck:
    """Backs out of a dead end, turning towards the direction in which most forces pulled when the robot got stuck.

    Where the robot can back no further it drives forward, still turning; where it can drive forward no further it backs
    again; and it stops as soon as it faces the desired direction. So far the paper. A robot whose nose is against a
    wall right in that direction would stop at once and be stuck again, for ever. So it backs at least one step, and one
    more for each time that it gets stuck again within `CALM_S`.

    A car's moves are not random, so what leads it into a dead end once does so again for ever, and two cars that block
    each other never part. So a robot that bumped sometimes stands still, and after `AT_A_LOSS` dead ends in a row, or
    `HOPELESS_S` in one, it chooses a random direction to face. From then on each bump makes the next move shorter, and
    each successful move makes the next one longer: between a wall and a wreck, which steering does not see, there may
    be room for a short step where a full one always bumps.
    """

    def __init__(self, steering: CarSteering, speed: float, step: float, chance: Callable[[int, int], float]) -> None:
        """Start outside of any dead end.

        Args:
            steering: Of this car.
            speed: Top speed, m/s.
            step: s per tick.
            chance: Called with a tick and 0 or 1 for the purpose of the draw; returns a repeatable draw from [0, 1).
        """
        self._calm = round(CALM_S / step)
        self._hopeless = max(round(HOPELESS_S / step), 1)
        self._chance = chance
        self._begun = 0
        self._steering = steering
        self._speed = speed
        self._desired: float | None = None
        self._backing = True
        self._retreat = 0
        self._in_a_row = 0
        self._wedged = False
        self._ease = 0
        self._stood = True
        self._ended = -self._calm - 1

    @property
    def active(self) -> bool:
        """Whether the robot is in a dead end."""
        return self._desired is not None

    def keeps_happening(self, tick: int) -> bool:
        """Whether the robot has lately been stuck more than once in a row."""
        return self._in_a_row > 1 and tick - self._ended <= self._calm

    def begin(self, tick: int, desired: float) -> None:
        """Start to leave a dead end.

        Args:
            tick: Now.
            desired: The heading that the robot wants to leave with, rad.
        """
        again = tick - self._ended <= self._calm
        self._in_a_row = min(self._in_a_row + 1, LONGEST_RETREAT) if again else 1
        self._retreat = self._in_a_row
        self._desired = desired if self._in_a_row < AT_A_LOSS else TAU * self._chance(tick, 0)
        self._begun = tick
        self._backing = True
        self._wedged = False
        self._ease = 0
        self._stood = True

    def end(self, tick: int) -> None:
        """Leave the dead end to somebody else.

        Args:
            tick: Now.
        """
        if self._desired is not None:
            self._desired = None
            self._ended = tick

    def step(self, tick: int, pose: Pose, bumped: bool) -> Drive | None:
        """The next command on the way out.

        Args:
            tick: Now.
            pose: The robot's own.
            bumped: Whether its last move was cancelled.

        Returns:
            None when the robot has left the dead end.
        """
        if self._desired is None:
            return None
        if self._wedged and not self._stood:
            self._ease = min(self._ease + 1, len(EASIER) - 1) if bumped else max(self._ease - 1, 0)
        self._stood = True
        if bumped:
            self._backing = not self._backing
            if self._chance(tick, 1) < YIELDS:
                return Drive(0.0, 0.0)
        if tick - self._begun >= self._hopeless:
            self._wedged = True
            self._begun = tick
            self._desired = TAU * self._chance(tick, 0)
        if self._retreat <= 0 and abs(wrap(self._desired - pose.heading)) <= ORIENTED:
            self._desired = None
            self._ended = tick
            return None
        for _ in range(2):
            for share in EASIER[self._ease :]:
                speed = share * self._speed * (-1.0 if self._backing else 1.0)
                drive = self._steering.turning(pose, self._desired, speed)
                if self._steering.is_free(pose, drive):
                    self._stood = False
                    self._retreat -= 1
                    return drive
            self._backing = not self._backing
        self._retreat -= 1
        return Drive(0.0, 0.0)
