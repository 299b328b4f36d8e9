"""What a run leaves behind, tick by tick: the records of the journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

MAX_TICKS = 2**29 - 1
"""Ticks of the longest run: a frame's sequence keeps the three bits above for its place among its sender's frames."""


FORGED = 0
"""The source of forged frames in a journal, whoever they claim to be from."""

DEAD_END = "dead-end"
"""The state of a mind that is getting out of a dead end."""

SURROUNDING = "surrounding"
"""The state of a mind whose robot stands around an intruder, or is on its way there."""


def frame_sequence(k: int, place: int) -> int:
    """The number that distinguishes a frame from all others of its sender; 32 bits for frames that robots send.

    A robot that reports no contacts has its ticks as sequence. Forged frames are counted through a tick, however many
    there are.

    Args:
        k: The tick in which the frame was sent.
        place: 0 for the position, 1 and up for the contacts.
    """
    return k + (MAX_TICKS + 1) * place


def sent_at(sequence: int) -> int:
    """The tick in which a frame was sent.

    Args:
        sequence: From `frame_sequence`.
    """
    return sequence % (MAX_TICKS + 1)


class Status(IntEnum):
    """A robot's status in a run. Only ALIVE robots take part in a tick; a body stays where it is in all others."""

    ABSENT = 0
    ALIVE = 1
    PAUSED = 2
    DEAD = 3
    LOST = 4
    LEFT = 5


def standing_after(kind: str) -> Status | None:
    """The status in which an event leaves its robot.

    Args:
        kind: Of the event.

    Returns:
        The status, or None for an event that changes none.
    """
    return Status.__members__.get(kind.upper())


@dataclass(frozen=True, slots=True)
class RobotTick:
    """One robot in one tick.

    Attributes:
        number: Of the robot.
        status: In this tick.
        x: m, of the true pose when the tick began.
        y: m, of the same.
        heading: rad, of the same.
        c0: Of the command that it obeyed: a car's or differential drive's speed (m/s), a holonomic robot's velocity
            along x (m/s).
        c1: Of the command that it obeyed: a car's curvature (1/m), a differential drive's turn rate (rad/s), a
            holonomic robot's velocity along y (m/s).
        bumped: Whether that move was cancelled.
        state: What its mind reported that it is doing, empty without a report.
        goal: m, or None without a report.
        decision_ms: Wall time of the decision, or None without a report.
        rejected: Frames that it has rejected so far, or None without a report.
        refused: Whether the world refused its command as not finite, and stopped it.
    """

    number: int
    status: Status
    x: float
    y: float
    heading: float
    c0: float
    c1: float
    bumped: bool
    state: str
    goal: tuple[float, float] | None
    decision_ms: float | None
    rejected: int | None
    refused: bool = False


@dataclass(frozen=True, slots=True)
class TickRecord:
    """One tick of the world.

    Attributes:
        k: The tick.
        robots: In roster order.
        frames: (source, bytes) of what was sent, each source's position before its contacts; the source of forged ones
            is `FORGED`.
        deliveries: (source, destination, sequence) of the frames that arrived, with the sequence of `frame_sequence`,
            once for each copy; columns (`patrol.journal.links`) or tuples, which read alike.
        dropped: The same and the cause, which for a fault is ``kind:id``.
        mfow: Of the true fog after this tick's observations, ticks.
        fog_mean: Of the same fog, ticks.
        seen: Patrolled points seen so far.
        copies: Links of the frames that a fault added in this tick, and its id.
        delayed: Frames of this tick that arrive in a later one, once for each fault that delays them, and its id.
        forged: For each forged frame, in their order, the id of its fault.
    """

    k: int
    robots: tuple[RobotTick, ...]
    frames: tuple[tuple[int, bytes], ...]
    deliveries: Sequence[tuple[int, int, int]]
    dropped: Sequence[tuple[int, int, int, str]]
    mfow: int
    fog_mean: float
    seen: int
    copies: tuple[tuple[int, int, int, str], ...] = ()
    delayed: tuple[tuple[int, int, int, str], ...] = ()
    forged: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened between ticks: before tick k, to one robot or (None) to the run."""

    k: int
    kind: str
    robot: int | None = None
    detail: str = ""


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """What a reader of the journal needs to know of a robot.

    Attributes:
        number: Of the robot.
        name: Of the robot.
        model: Car, differential or holonomic.
        radius: m.
    """

    number: int
    name: str
    model: str
    radius: float


@dataclass(frozen=True, slots=True)
class TerrainFacts:
    """The grid of the run's fog.

    Attributes:
        name: Of the terrain.
        width: Points.
        height: Points.
        point: Side of one point, m.
        origin: m, the grid's lower left corner.
    """

    name: str
    width: int
    height: int
    point: float
    origin: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Header:
    """A journal's first record.

    Attributes:
        software: Version that wrote it.
        scenario: Resolved, as a mapping.
        scenario_hash: Of what the scenario means.
        robots: In roster order.
        terrain: The grid.
        patrolled_area_m2: Area that counts for the fog.
        bound_s: The lower bound of MFoW, s.
        started: Wall time as ISO 8601 text, or None where nobody read a clock.
    """

    software: str
    scenario: Mapping[str, Any]
    scenario_hash: str
    robots: tuple[RobotFacts, ...]
    terrain: TerrainFacts
    patrolled_area_m2: float
    bound_s: float
    started: str | None = None


@dataclass(frozen=True, slots=True)
class End:
    """A journal's last record.

    Attributes:
        reason: Why the run ended.
        trace_hash: Of all ticks.
        notes: What the launcher should know as well.
    """

    reason: str
    trace_hash: str
    notes: Mapping[str, Any] = field(default_factory=dict)


Record = Header | TickRecord | Event | End
