"""The bodies in the world: what each is, where it is, and what has happened to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.journal import Status
from patrol.net.phases import FIRST_INCARNATION
from patrol.pose import Command, Pose, halted

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec


def standstill(spec: RobotSpec) -> Command:
    """The command that stops a robot of this kind."""
    return halted(spec.model)


def overlap(pose: Pose, radius: float, other: Pose, other_radius: float) -> bool:
    """Whether two round bodies (m) overlap; touching is no overlap."""
    return math.hypot(pose.x - other.x, pose.y - other.y) < radius + other_radius


@dataclass(slots=True)
class Body:
    """One robot's body.

    command: what it obeys, within its limits. bumped: whether its last move was cancelled. distance_m: driven so far,
    m, along the path. collisions: moves cancelled so far. refused: whether its last command made no sense and
    stopped it. silent_s: time since the last command, s. away: it is not there yet or any more, or it was killed and
    its wreck taken away. incarnation: how many minds it has had so far.
    """

    spec: RobotSpec
    pose: Pose
    command: Command
    status: Status = Status.ALIVE
    bumped: bool = False
    distance_m: float = 0.0
    collisions: int = 0
    refused: bool = False
    silent_s: float = 0.0
    away: bool = False
    incarnation: int = FIRST_INCARNATION

    @property
    def alive(self) -> bool:
        """Whether somebody is at its wheel."""
        return self.status is Status.ALIVE

    @property
    def present(self) -> bool:
        """Whether it is in the world and in others' way, alive or not."""
        return not self.away and self.status not in (Status.ABSENT, Status.LEFT)

    def halt(self, status: Status) -> None:
        """Nobody drives it from now on."""
        self.status = status
        self.command = standstill(self.spec)
        self.bumped = self.refused = False
        self.silent_s = 0.0
