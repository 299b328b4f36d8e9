"""The bodies in the world: their model, their pose, their history, and their motion in one step.

No body enters a wall or another body, at any speed and with any command.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.exchange import FIRST_INCARNATION
from patrol.ground.swept_path import advance, chords, lay_path, path_is_free
from patrol.journal import Status
from patrol.pose import COMMANDS, Command, Pose, facing_of, halted, is_halt
from worldsim.kernels.collide import cancel_meeting, near_others

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.scenario import RobotSpec


def standstill(spec: RobotSpec) -> Command:
    """Return the command that stops a robot of this model."""
    return halted(spec.model)


def overlap(pose: Pose, radius: float, other: Pose, other_radius: float) -> bool:
    """Return True if two round bodies overlap; touching is no overlap.

    For example, two of 0.5 m overlap at a distance of 0.99 m, and do not at 1 m.
    """
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


def within_limits(spec: RobotSpec, command: Command) -> Command | None:
    """Return the nearest command that a robot can obey; None for an invalid one.

    A command is invalid if it is for another model, or has numbers that are not finite.
    """
    if type(command) is not COMMANDS[spec.model] or not all(
        map(math.isfinite, (*command.numbers, facing_of(command) or 0.0))
    ):
        return None
    return command.limited(spec.limits)


def length(command: Command, step: float) -> float:
    """Length in m of the path of a body that obeys `command` for `step` seconds."""
    return command.speed_mps * step


def move(bodies: Sequence[Body], terrain: Terrain, step: float, driven: Mapping[int, Command] | None = None) -> None:
    """Move all bodies that are present by their commands for one step, all at once.

    A move is cancelled when the swept body would enter a wall, or come nearer to another body than the sum of their
    radii at any time of the step. Every robot involved then stays exactly where it is, which may cancel further moves
    (paper, "Simulation": collided robots cancel their moves). Bodies that are not driven are obstacles. So are those
    that turn on the spot, and nothing cancels such a turn.

    Sets each body's pose, bumped, collisions and distance_m. `driven` is what bodies do instead of what they are
    commanded, by robot number (`worldsim.robots.noise`).
    """
    present = [body for body in bodies if body.present]
    commands = [(driven or {}).get(body.spec.number, body.command) for body in present]
    far = [length(command, step) if body.alive else 0.0 for body, command in zip(present, commands, strict=True)]
    moving = [ahead > 0.0 for ahead in far]
    stands = np.array(
        [
            not moves or not path_is_free(terrain, body.pose, command, step, body.spec.radius)
            for body, command, moves in zip(present, commands, moving, strict=True)
        ],
        dtype=np.uint8,
    )
    _cancel_meeting(present, commands, far, moving, stands, step)
    for body, command, ahead, moves, stood in zip(present, commands, far, moving, stands.tolist(), strict=True):
        body.bumped = moves and bool(stood)
        if body.bumped:
            body.collisions += 1
        elif body.alive and not is_halt(command):
            body.pose = advance(body.pose, command, step)
            body.distance_m += ahead


def _cancel_meeting(
    bodies: Sequence[Body],
    commands: Sequence[Command],
    far: Sequence[float],
    moving: Sequence[bool],
    stands: NDArray[np.uint8],
    step: float,
) -> None:
    """Stop every body that would meet another; far: the lengths of their paths, m.

    A body goes no farther from where it is than its path is long. So paths are laid only for those whose discs, their
    radii and the lengths of their paths together, overlap another's.
    """
    reaches = [(body.pose.x, body.pose.y, body.spec.radius + ahead) for body, ahead in zip(bodies, far, strict=True)]
    discs = np.array(reaches, dtype=np.float64).reshape(-1, 3)
    # The kernels stop looking at the first disc that is too far along x.
    order = np.argsort(discs[:, 0])
    near = order[near_others(discs[order])].tolist()
    if not near:
        return
    pieces = max((chords(command, step) for command, moves in zip(commands, moving, strict=True) if moves), default=1)
    paths = np.empty((len(near), pieces + 1, 2), dtype=np.float64)
    for path, index in zip(paths, near, strict=True):
        pose = bodies[index].pose
        if moving[index]:
            lay_path(path, pose, commands[index], step)
        else:
            path[:] = (pose.x, pose.y)
    # A copy of those near others; the rest cannot meet any body.
    stopped = stands[near]
    cancel_meeting(paths, np.array([bodies[index].spec.radius for index in near], dtype=np.float64), stopped)
    stands[near] = stopped
