"""Backing off: how a body that turns on the spot gets away from a robot in its way, or from a place without a way on.

Its moves are hardly random, so two such robots that block each other in a corridor would do so for ever. A robot that
keeps bumping therefore drives away from the nearest robot for a moment, forward or in reverse, whichever needs the
smaller turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from agent.bodies.setup import BLOCKED_SHARE, CLEAR_SHARE
from agent.bodies.wheel_steering import ALIGNED, WheelSteering, smaller_turn
from agent.routes.ground import Spot
from patrol.pose import TAU, Pose, Twist

PATIENCE = 3
"""Number of bumps after which a robot backs off."""

CALM_S = 3.0
"""Bumps further apart than this do not add up, s."""

SHORTEST_S = 1.0
LONGEST_S = 3.0
"""Bounds of how long a robot backs off, s; the time is random, so that a pair does not get stuck in step."""

TRIES = 8
"""Number of directions drawn, of which the first with room for half a step is taken."""


class BackOff:
    """Drives in a random direction for a moment, away from whoever is near.

    Attributes:
        stuck: Whether the robot backs off because no way led on, not because it bumped.
    """

    def __init__(self, steering: WheelSteering, step: float, chance: Callable[[int, int], float]) -> None:
        """Start without backing off.

        Args:
            steering: Of this robot.
            step: s per tick.
            chance: Called with a tick and 0, 1, ... for the purpose of the draw; returns a repeatable draw from [0, 1).
        """
        self.stuck = False
        self._steering = steering
        self._step = step
        self._chance = chance
        self._bumps = 0
        self._bumped_at = 0
        self._direction: float | None = None
        self._until = 0

    @property
    def active(self) -> bool:
        """Whether the robot is backing off."""
        return self._direction is not None

    def count(self, tick: int, bumped: bool) -> bool:
        """Take in whether the last move was cancelled.

        Args:
            tick: Now.
            bumped: Whether the robot's last move was cancelled.

        Returns:
            Whether the robot has bumped often enough to back off.
        """
        if bumped:
            self._bumps = self._bumps + 1 if tick - self._bumped_at <= CALM_S / self._step else 1
            self._bumped_at = tick
        return bumped and self._bumps >= PATIENCE

    def begin(self, tick: int, pose: Pose, near: Spot | None, *, stuck: bool) -> None:
        """Choose a direction and a time; a robot with room nowhere stays where it is.

        Args:
            tick: Now.
            pose: The robot's own.
            near: x and y in m of a robot to get away from, or None.
            stuck: Whether no way leads on.
        """
        best = -1.0
        for index in range(TRIES):
            share = self._chance(tick, index)
            if near is None:
                direction = TAU * share
            else:
                away = math.atan2(pose.y - near[1], pose.x - near[0])
                direction = away + (share - 0.5) * math.pi
            room = self._room(pose, direction)
            if room > best:
                best, self._direction = room, direction
            if room >= CLEAR_SHARE * self._steering.stride:
                break
        if best < BLOCKED_SHARE * self._steering.stride:
            self._direction = None
        spell_s = SHORTEST_S + (LONGEST_S - SHORTEST_S) * self._chance(tick, TRIES)
        self._until = tick + max(1, round(spell_s / self._step))
        self._bumps = 0
        self.stuck = stuck

    def end(self) -> None:
        """Stop backing off."""
        self._direction = None

    def next(self, tick: int, pose: Pose, bumped: bool) -> Twist | None:
        """The next command on the way back.

        Args:
            tick: Now.
            pose: The robot's own.
            bumped: Whether the robot's last move was cancelled.

        Returns:
            None when the robot has backed off far enough, or cannot go on.
        """
        if self._direction is None:
            return None
        room = self._room(pose, self._direction)
        if tick >= self._until or bumped or room <= 0.0:
            self._direction = None
            return None
        askew, sense = smaller_turn(pose.heading, self._direction)
        if abs(askew) > ALIGNED:
            return self._steering.on_the_spot(askew)
        return self._steering.straight(pose, sense * room)

    def _room(self, pose: Pose, direction: float) -> float:
        stride = self._steering.stride
        return self._steering.reach(
            pose, (pose.x + stride * math.cos(direction), pose.y + stride * math.sin(direction))
        )
