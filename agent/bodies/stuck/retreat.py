"""Retreat: how a car makes room for another where they cannot pass, back along the way that it came.

Two cars that meet in a corridor or a door block each other until one of them leaves it. A car cannot turn there, but
the way that it came is always open to it in reverse. The one with the higher number goes back first. If the two meet
again, it goes back farther: how long the corridor is, neither knows.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from agent.bodies.giveway import nearest
from patrol.pose import Drive

if TYPE_CHECKING:
    from agent.bodies.steering import CarSteering
    from patrol.pose import Pose
    from patrol.radio.peers import Peer

PATIENCE = 3
"""Number of bumps after which a car goes back for one with a lower number."""

STUBBORN = 8
"""Number of bumps after which it goes back for one with a higher number, which may have nowhere to go."""

CALM_S = 3.0
"""Bumps further apart than this do not add up, s."""

SHORTEST_S = 2.0
"""How long a car goes back for the first time, s, on average."""

LONGEST_S = 16.0
"""It never goes back for longer than this, s."""

AGAIN_S = 15.0
"""A car that has to go back again within this time goes back twice as far, s."""

LONGEST_TRAIL = 256
"""Steps of the way that it came that a car remembers."""


class Retreat:
    """Drives back along the car's own way when it and another car block each other."""

    def __init__(
        self,
        steering: CarSteering,
        number: int,
        radii: Mapping[int, float],
        step: float,
        chance: Callable[[int], float],
    ) -> None:
        """Start with no way that the car came by.

        Args:
            steering: Of this car.
            number: The robot's number.
            radii: Radius in m of each robot of the fleet, by number.
            step: s per tick.
            chance: Called with a tick; returns a repeatable draw from [0, 1).
        """
        self._steering = steering
        self._number = number
        self._radii = radii
        self._step = step
        self._chance = chance
        self._trail: deque[Drive] = deque(maxlen=LONGEST_TRAIL)
        self._last: Drive | None = None
        self._until: int | None = None
        self._ended = -math.inf
        self._again = 0
        self._bumps = 0
        self._bumped_at = -math.inf

    @property
    def active(self) -> bool:
        """Whether the car is going back."""
        return self._until is not None

    def told(self, drive: Drive) -> None:
        """Remember the command of this tick; call it last."""
        self._last = drive if drive.speed != 0.0 else None

    def update(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> bool:
        """Take in what has become of the last command; call it first.

        Args:
            tick: Now.
            pose: The car's own.
            bumped: Whether its last move was cancelled.
            peers: The robots heard lately, by number.

        Returns:
            Whether the car begins to go back.
        """
        last, self._last = self._last, None
        if not bumped:
            if last is not None and self.active:
                self._trail.pop()
            elif last is not None:
                self._trail.append(last)
            return False
        if self.active:
            self._end(tick)
            return False
        self._bumps = self._bumps + 1 if tick - self._bumped_at <= CALM_S / self._step else 1
        self._bumped_at = tick
        other = self._neighbour(pose, peers)
        if other is None or not self._trail or self._bumps < (PATIENCE if other < self._number else STUBBORN):
            return False
        self._again = self._again + 1 if tick - self._ended <= AGAIN_S / self._step else 0
        spell_s = min(LONGEST_S, SHORTEST_S * 2.0**self._again * (0.5 + self._chance(tick)))
        self._until = tick + max(1, round(spell_s / self._step))
        self._bumps = 0
        return True

    def next(self, tick: int, pose: Pose) -> Drive | None:
        """The next command on the way back.

        Args:
            tick: Now.
            pose: The car's own.

        Returns:
            None when the car has gone back far enough, or cannot go on.
        """
        if self._until is None:
            return None
        if tick < self._until and self._trail:
            drive = Drive(-self._trail[-1].speed, self._trail[-1].curvature)
            if self._steering.is_free(pose, drive):
                return drive
        self._end(tick)
        return None

    def _end(self, tick: int) -> None:
        self._until = None
        self._ended = tick

    def _neighbour(self, pose: Pose, peers: Mapping[int, Peer]) -> int | None:
        """The nearest robot's number; None where nobody is within two steps."""
        gap, number = nearest(pose, peers, self._radii)
        return number if gap <= self._radii[self._number] + 2.0 * self._steering.stride else None
