"""Where a robot has been of late, and whether it has stayed within a small circle for too long."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agent.routes.ground import Spot

ROAM_S = 45.0
"""A robot that has stayed within a circle of `ROAM_REACH` for so long looks for a target outside and goes there, s."""

ROAM_REACH = 5.0
"""Radius of that circle, in radii and strides of the robot."""

TWICE = 2.001
"""Radii of a circle than which no two places in it are farther apart, with room for rounding."""


class Whereabouts:
    """The places of a robot in the last `ROAM_S`, one for each second.

    Attributes:
        reach: Radius of the circle, m.
    """

    def __init__(self, radius: float, stride: float, step: float) -> None:
        """Start without any place.

        Args:
            radius: Of the robot, m.
            stride: Longest way in one step, m.
            step: s per tick.
        """
        self.reach = ROAM_REACH * (radius + stride)
        self._often = max(1, round(1.0 / step))
        self._places: deque[Spot] = deque(maxlen=math.ceil(ROAM_S / (self._often * step)))

    def note(self, tick: int, place: Spot) -> None:
        """Take in where the robot is.

        Args:
            tick: Now.
            place: x and y in m.
        """
        if tick % self._often == 0:
            self._places.append(place)

    def home(self) -> Spot | None:
        """The centre, x and y in m, of the circle in which the robot has stayed for too long; None if it has not."""
        places = self._places
        if len(places) < (places.maxlen or 0):
            return None
        if any(math.dist(places[-1], places[index]) > TWICE * self.reach for index in (0, len(places) // 2)):
            return None
        xs, ys = zip(*places, strict=True)
        centre = 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
        return centre if all(math.dist(centre, place) <= self.reach for place in places) else None
