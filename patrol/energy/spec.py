"""The scenario's batteries and docks."""

from __future__ import annotations

import math
from typing import Self

from pydantic import Field, model_validator

from patrol.ground.marks import Mark
from patrol.ground.terrain import Terrain
from patrol.values import Corner, NotNegative, Positive, Section, Share, Tolerance, wrong

JOULES = 3600.0
"""J in a Wh."""


class BatterySpec(Section):
    """A robot's battery, and when the robot charges it."""

    capacity: Positive = Field(description="Wh, of the full battery")
    idle: NotNegative = Field(0.0, description="W, used at all times, driving or not")
    drive: NotNegative = Field(0.0, description="J per m driven, used besides")
    charge: Positive = Field(description="W, that a dock gives a robot that stands at it")
    start: Share = Field(1.0, description="share of the capacity in it at first")
    full: Share = Field(0.95, description="share up to which a robot charges before it goes on")
    reserve: Tolerance = Field(0.1, description="share with which a robot wants to arrive at a dock")

    @property
    def capacity_j(self) -> float:
        """The capacity, J."""
        return JOULES * self.capacity

    def patrol_share(self, speed: float) -> float:
        """Return the share of the time for which a robot drives at a speed (m/s), if it charges for the rest."""
        gain_w = self.charge - self.idle
        return gain_w / (gain_w + self.idle + self.drive * speed)

    def most_on_patrol(self, robots: int, speed: float) -> int:
        """Return how many robots can patrol all the time while the others charge for them, at least 1.

        All have this battery and drive at `speed` (m/s). For example, robots that drive for 40 minutes and charge for
        18 patrol for 69 % of the time; of 6 robots 4 patrol.
        """
        return max(1, math.floor(self.patrol_share(speed) * robots))

    @model_validator(mode="after")
    def _can_be_used_and_charged(self) -> Self:
        if self.idle == 0.0 == self.drive:
            raise wrong("", "idle and drive are both 0, so nothing is ever used; give one of them, or drop battery")
        if self.charge <= self.idle:
            limit = f"no more than the {self.idle:g} W that the robot uses at rest, so it never charges; give more"
            raise wrong("charge", limit, self.charge)
        if self.reserve >= self.full:
            raise wrong("reserve", f"not below full ({self.full:g}), so a robot never leaves; give less", self.reserve)
        return self


MOST_DOCK_RADIUS_M = 5.0
"""Of a dock, m; farther away a robot stands beside something else."""


class DockSpec(Section):
    """A place where one robot at a time charges its battery."""

    EXAMPLE = "{place: [10, 10]}"

    place: Corner = Field(description="m, [x, y]")
    radius: Positive = Field(1.0, description="m, within which a robot's centre has to stand; at most 5")

    @model_validator(mode="after")
    def _is_a_place(self) -> Self:
        if self.radius > MOST_DOCK_RADIUS_M:
            raise wrong(
                "radius", f"robots charge at a place, not from afar; give at most {MOST_DOCK_RADIUS_M:g}", self.radius
            )
        return self

    def mark(self, terrain: Terrain, number: int) -> Mark:
        """Return the dock's place."""
        del terrain
        return Mark("dock", f"dock {number}", f"dock {number}", self.place, radius=self.radius)
