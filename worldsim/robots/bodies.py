"""The bodies in the world: their model, their pose and their history."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.exchange import FIRST_INCARNATION
from patrol.journal import Status
from patrol.pose import Command, Pose, halted

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec


def standstill(spec: RobotSpec) -> Command:
    """Return the command that stops a robot of this model."""
    return halted(spec.model)


def overlap(pose: Pose, radius: float, other: Pose, other_radius: float) -> bool:
    """Return True if two round bodies overlap; touching is no overlap."""
    return math.hypot(pose.x - other.x, pose.y - other.y) < radius + other_radius


@dataclass(slots=True)
class Body:
    """One robot's body."""

    spec: RobotSpec
    pose: Pose  # m and rad
    command: Command
    status: Status = Status.ALIVE
    bumped: bool = False  # its last move was cancelled
    distance_m: float = 0.0
    collisions: int = 0
    refused: bool = False  # its last command was invalid and stopped it
    silent_s: float = 0.0
    away: bool = False  # not in the world: not yet, no longer, or its wreck was removed
    incarnation: int = FIRST_INCARNATION  # number of minds it has had so far

    @property
    def alive(self) -> bool:
        """True if a mind drives it."""
        return self.status is Status.ALIVE

    @property
    def present(self) -> bool:
        """True if it is in the world and in the way of others, alive or not."""
        return not self.away and self.status.is_present

    def halt(self, status: Status) -> None:
        """Stop the body and set its status."""
        self.status = status
        self.command = standstill(self.spec)
        self.bumped = self.refused = False
        self.silent_s = 0.0
