"""The bodies in the world: what each is, where it is, and what has happened to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.journal import Status
from patrol.pose import Command, Drive, Pose, Velocity

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec


def standstill(spec: RobotSpec) -> Command:
    """The command that stops a robot of this kind."""
    return Drive(0.0, 0.0) if spec.model == "car" else Velocity(0.0, 0.0)


@dataclass(slots=True)
class Body:
    """One robot's body.

    command: what it obeys, within its limits. bumped: whether its last move was cancelled. distance_m: driven so far,
    m, along the path. collisions: moves cancelled so far. refused: whether its last command made no sense and
    stopped it. silent_s: time since the last command, s.
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

    @property
    def alive(self) -> bool:
        """Whether somebody is at its wheel."""
        return self.status is Status.ALIVE

    @property
    def present(self) -> bool:
        """Whether it is in the world and in others' way, alive or not."""
        return self.status not in (Status.ABSENT, Status.LEFT)
