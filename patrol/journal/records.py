"""What a run leaves behind, tick by tick: the records of the journal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

MAX_TICKS = 2**29 - 1
"""Ticks of the longest run: a frame's sequence keeps the three bits above for its place among its sender's frames."""


FORGED = 0
"""The source of forged frames in a journal, whoever they claim to be from."""

DEAD_END = "dead-end"
"""The state of a mind that is getting out of a dead end."""


def frame_sequence(k: int, place: int) -> int:
    """The number that tells a frame of tick k from all others of its sender; 32 bits for those that robots send.

    place: 0 for the position, 1 and up for the contacts. So a robot that reports no contacts has its ticks as sequence.
    Forged frames are counted through a tick, however many there are.
    """
    return k + (MAX_TICKS + 1) * place


def sent_at(sequence: int) -> int:
    """The tick in which a frame was sent, from its sequence."""
    return sequence % (MAX_TICKS + 1)


class Status(IntEnum):
    """A robot's standing in a run. Only ALIVE robots take part in a tick; a body stays where it is in all others."""

    ABSENT = 0
    ALIVE = 1
    PAUSED = 2
    DEAD = 3
    LOST = 4
    LEFT = 5


def standing_after(kind: str) -> Status | None:
    """The standing in which an event of this kind leaves its robot; None where it changes none."""
    return Status.__members__.get(kind.upper())


@dataclass(frozen=True, slots=True)
class RobotTick:
    """One robot in one tick.

    x, y, heading: the true pose when the tick began (m, rad). c0, c1: the command that it obeyed, speed (m/s) and
    curvature (1/m) of a car, velocity along x and y (m/s) of a holonomic robot. bumped: that move was cancelled.
    state, goal (m), decision_ms, rejected (frames so far): what its mind reported, empty or None without a report.
    refused: its mind's command made no sense and stopped it.
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

    robots: in roster order. frames: (source, bytes) of what was sent, each source's position before its contacts; the
    source of forged ones is `FORGED`. deliveries: (source, destination, sequence) of the frames that arrived, with the
    sequence of `frame_sequence`, once for each copy. dropped: the same and the cause, which for a fault is
    ``kind:id``. copies: those that a fault added in this tick, and its id. delayed: frames of this tick that arrive in
    a later one, once for each fault that holds them up, and its id. forged: for each forged frame, in their order, the
    id of its fault. mfow, fog_mean: of the true fog after this tick's observations, in ticks. seen: patrolled points
    seen so far.
    """

    k: int
    robots: tuple[RobotTick, ...]
    frames: tuple[tuple[int, bytes], ...]
    deliveries: tuple[tuple[int, int, int], ...]
    dropped: tuple[tuple[int, int, int, str], ...]
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
    """What a reader of the journal needs to know of a robot. radius: m."""

    number: int
    name: str
    model: str
    radius: float


@dataclass(frozen=True, slots=True)
class TerrainFacts:
    """The grid that the run's fog lies on. width, height: points. point: m. origin: m, the grid's lower left corner."""

    name: str
    width: int
    height: int
    point: float
    origin: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Header:
    """A journal's first record.

    software: version that wrote it. scenario: resolved, as a mapping. bound_s: the lower bound of MFoW, s. started:
    wall time as ISO 8601 text, or None where nobody looked at a clock.
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
    """A journal's last record: why the run ended, its trace hash, and what the front door should know besides."""

    reason: str
    trace_hash: str
    notes: Mapping[str, Any] = field(default_factory=dict)


Record = Header | TickRecord | Event | End
