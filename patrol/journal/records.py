"""The records of the journal, tick by tick.

The annotations are what a record may hold when it is read (`patrol.journal.decode`), so that readers of
a journal need not check types, ranges and finiteness.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from math import isfinite
from typing import Annotated, Any

from pydantic import ConfigDict, Field, GetPydanticSchema, PlainValidator, with_config
from pydantic_core import core_schema as schemas

from patrol.pose import Model
from patrol.wire import FAIL_FAST, FAIL_FAST_MAP, Bytes, Flag, Row, Text

MAX_TICKS = 2**29 - 1
"""Ticks of the longest run: a frame's sequence keeps the three bits above for its place among its sender's frames."""


FARTHEST = 21_474_836.0
"""The largest coordinate of a robot, m: a position message holds no larger one."""

MOST_POINTS = 50_000_000
"""Points of the largest terrain (`patrol.ground.terrain.MAX_POINTS`)."""

_NO_OTHERS, _OTHERS = ConfigDict(extra="forbid"), ConfigDict(extra="ignore")
_LARGEST = 1e12
_MAX_ROBOT = 0xFFFF
_MAX_COUNT = 2**63 - 1
_NAME = 64
_SHORTEST_S = 1e-6
"""No run takes less wall time, s."""

FORGED = 0
"""The source of forged frames in a journal, whatever sender they name."""

PATROLLING, FREE = "patrolling", "free"
"""The states of a mind that patrols, and of one that does so by choices of its own where its policy has a common plan.

A policy without a common plan patrols, and is never free."""

DEAD_END = "dead-end"
"""The state of a mind that is getting out of a dead end."""

SURROUNDING = "surrounding"
"""The state of a mind whose robot stands around an intruder, or is on its way there."""

DOCKING, CHARGING = "docking", "charging"
"""The states of a mind whose robot is on its way to a dock or waits for one, and stands at one."""

CLOSED, OPENED, STAYS_OPEN = "closed", "opened", "stays open"
"""The kinds of the events of ground that closes and opens; their detail is the part's name. A part that waits until
robots have left it (`patrol.changing.ground.WAITS`) stays open where it is to be open again before it could close."""

IN_FORCE, OUT_OF_FORCE = "in force", "out of force"
"""The kinds of the events of zones that begin and end after tick 0; their detail is the zone's name."""


def frame_sequence(k: int, place: int) -> int:
    """Return the number that distinguishes a frame from all others of its sender; 32 bits for frames that robots send.

    A robot that reports no contacts has its ticks as sequence. Forged frames are counted through a tick, however many
    there are. For example, in tick 7 a robot's position has the sequence 7, and its first contact 536870919.

    Args:
        k: The tick in which the frame was sent.
        place: 0 for the position, 1 and up for the contacts.
    """
    return k + (MAX_TICKS + 1) * place


def sent_at(sequence: int) -> int:
    """Return the tick in which a frame was sent.

    For example, that of the sequences 7 and 536870919 is 7.

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

    @property
    def is_present(self) -> bool:
        """True where the robot has a body in the world, so that frames are sent to it."""
        return self is not Status.ABSENT and self is not Status.LEFT


def standing_after(kind: str) -> Status | None:
    """Return the status in which an event leaves its robot.

    For example, after "dead" it is `Status.DEAD`, and after "fault" None.

    Args:
        kind: Of the event.

    Returns:
        The status, or None for an event that changes none.
    """
    return Status.__members__.get(kind.upper())


def _ungroup_links(groups: Any) -> tuple[tuple[int, int, int, str], ...]:
    """Return the links that the writer had grouped by destination, one by one."""
    _check_groups(groups)
    return tuple([(source, to, sequence, why) for source, sequence, why, tos in groups for to in tos])


def _ungroup_deliveries(groups: Any) -> tuple[tuple[int, int, int], ...]:
    _check_groups(groups)
    return tuple([(source, to, sequence) for source, sequence, _, tos in groups for to in tos])


def _check_groups(groups: Any) -> None:
    """Check (source, sequence, cause, destinations); a tick of a large fleet has many thousands of links."""
    try:
        for source, sequence, cause, destinations in groups:
            if not (
                type(source) is type(sequence) is int
                and type(cause) is str
                and 0 <= source <= _MAX_ROBOT
                and 0 <= sequence <= _MAX_COUNT
            ):
                raise ValueError("expected robot numbers, sequences and causes")
            array("H", destinations)  # raises for anything but numbers from 0 to 65535
    except (TypeError, OverflowError):
        raise ValueError("expected groups of links") from None


def _check_scenario(value: Any) -> Any:
    if type(value) is not dict:
        raise ValueError("expected a mapping")
    _check_json(value)
    return value


def _is_amount(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value > 0


_READ: Mapping[str, Callable[[Mapping[str, Any]], bool]] = {
    "name": lambda scenario: isinstance(scenario.get("name"), str),
    "step": lambda scenario: _is_amount(scenario.get("step")),
    "radio": lambda scenario: isinstance(scenario.get("radio"), Mapping),
    "sensor.range": lambda scenario: (
        isinstance(sensor := scenario.get("sensor"), Mapping) and _is_amount(sensor.get("range"))
    ),
}
"""What readers take from a header's scenario without loading it, and whether it can be used."""


def _check_json(value: Any) -> None:
    """Check that a value has a JSON form; msgpack itself limits how deep it is."""
    if isinstance(value, dict | list):
        for key in value:
            if isinstance(value, dict) and type(key) is not str and type(key) is not int:
                raise ValueError(f"holds a key of type {type(key).__name__}")
            # A list yields its items and a mapping its keys.
            _check_json(value[key] if isinstance(value, dict) else key)
    elif isinstance(value, float) and not isfinite(value):
        raise ValueError("holds a number that is not finite")
    elif value is not None and not isinstance(value, str | int | float):
        raise ValueError(f"holds a value of type {type(value).__name__}")


_Count = Annotated[int, Field(strict=True, ge=0, le=_MAX_COUNT)]
_Tick = Annotated[int, Field(strict=True, ge=0, le=2**31)]
_PointTicks = Annotated[int, Field(strict=True, ge=0, le=2**53)]
_Number = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST)]
_Amount = Annotated[float, Field(strict=True, ge=0.0, le=_LARGEST)]
_Positive = Annotated[float, Field(strict=True, gt=0.0, le=_LARGEST)]
_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Coordinate = Annotated[float, Field(strict=True, ge=-FARTHEST, le=FARTHEST)]
_Source = Annotated[int, Field(strict=True, ge=0, le=_MAX_ROBOT)]
_RobotNumber = Annotated[int, Field(strict=True, ge=1, le=_MAX_ROBOT)]
_Name = Annotated[Text, Field(max_length=_NAME)]
_Short = Annotated[Text, Field(max_length=4 * _NAME)]
_Points = Annotated[int, Field(strict=True, ge=1, le=MOST_POINTS)]
_Counts = Annotated[dict[_Name, _Count], FAIL_FAST_MAP]
_CountsByRobot = Annotated[dict[_RobotNumber, _Count], FAIL_FAST_MAP]
_WHOLE = GetPydanticSchema(lambda kind, of: schemas.chain_schema([schemas.int_schema(strict=True), of(kind)]))


@dataclass(frozen=True, slots=True)
class RobotTick(Row):
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
        state: The state that its mind reported, empty without a report.
        goal: m, or None without a report.
        decision_ms: Wall time of the decision, or None without a report.
        rejected: Frames that it has rejected so far, or None without a report.
        refused: Whether the world refused its command as not finite, and stopped it.
    """

    number: _RobotNumber
    status: Annotated[Status, _WHOLE]
    x: _Coordinate
    y: _Coordinate
    heading: _Number
    c0: _Number
    c1: _Number
    bumped: Flag
    state: Text
    goal: tuple[_Finite, _Finite] | None
    decision_ms: _Number | None
    rejected: _Count | None
    refused: Flag = False


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
        dropped: The same and the cause, which for a fault is ``kind:id``; for example (2, 3, 3, "loss:f1").
        mfow: Of the true fog after this tick's observations, ticks.
        fog_mean: Of the same fog, ticks.
        seen: Patrolled points seen so far.
        copies: Links of the frames that a fault added in this tick, and its id.
        delayed: Frames of this tick that arrive in a later one, once for each fault that delays them, and its id.
        forged: For each forged frame, in their order, the id of its fault.
        localised: (number, x, y, heading) of the robots whose localisation was wrong: what it said (m, rad).
    """

    k: _Tick
    robots: Annotated[tuple[RobotTick, ...], FAIL_FAST]
    frames: Annotated[tuple[tuple[_Source, Bytes], ...], FAIL_FAST]
    deliveries: Annotated[
        Sequence[tuple[int, int, int]], Field(validation_alias="delivered"), PlainValidator(_ungroup_deliveries)
    ]
    dropped: Annotated[Sequence[tuple[int, int, int, str]], PlainValidator(_ungroup_links)]
    mfow: _PointTicks
    fog_mean: _Amount
    seen: _PointTicks
    copies: Annotated[tuple[tuple[int, int, int, str], ...], PlainValidator(_ungroup_links)] = ()
    delayed: Annotated[tuple[tuple[int, int, int, str], ...], PlainValidator(_ungroup_links)] = ()
    forged: Annotated[tuple[Text, ...], FAIL_FAST] = ()
    localised: Annotated[tuple[tuple[_RobotNumber, _Coordinate, _Coordinate, _Number], ...], FAIL_FAST] = ()


@with_config(_NO_OTHERS)
@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened between ticks: before tick k, to one robot or (None) to the run.

    For example, ``Event(5, "dead", 2, "f1 kill")``: before tick 5 the fault f1 killed robot 2.
    """

    k: _Tick
    kind: _Name
    robot: _Source | None = None
    detail: Text = ""


@with_config(_NO_OTHERS)
@dataclass(frozen=True, slots=True)
class RobotFacts:
    """A robot's settings that a reader of the journal needs.

    Attributes:
        number: Of the robot.
        name: Of the robot.
        model: Car, differential or holonomic.
        radius: m.
    """

    number: _RobotNumber
    name: Annotated[_Name, Field(min_length=1)]
    model: Model
    radius: _Positive


@with_config(_NO_OTHERS)
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

    name: Annotated[Text, Field(max_length=4096)]
    width: _Points
    height: _Points
    point: _Positive
    origin: tuple[_Number, _Number]

    def __post_init__(self) -> None:
        if self.width * self.height > MOST_POINTS:
            raise ValueError(f"more than {MOST_POINTS} points")


@with_config(_NO_OTHERS)
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
        started: Wall time as ISO 8601 text, or None where no clock was read.
    """

    software: _Short
    scenario: Annotated[Mapping[str, Any], PlainValidator(_check_scenario)]
    scenario_hash: _Short
    robots: Annotated[tuple[RobotFacts, ...], FAIL_FAST]
    terrain: TerrainFacts
    patrolled_area_m2: _Amount
    bound_s: _Amount
    started: _Name | None = None

    @property
    def problem(self) -> str:
        """Describe what keeps this from being the header of a run, beyond its types; empty for nothing."""
        # Readers use a robot's number less one as its row.
        if [robot.number for robot in self.robots] != list(range(1, len(self.robots) + 1)):
            return "robots are not numbered 1, 2, ... in order"
        if round(self.patrolled_area_m2 / self.terrain.point**2) < 1:
            return f"patrolled_area_m2 = {self.patrolled_area_m2:g}: less than a point"
        missing = [name for name, is_usable in _READ.items() if not is_usable(self.scenario)]
        return f"scenario.{missing[0]} is missing or unusable" if missing else ""

    def unknown(self, record: Record) -> str:
        """Return what a record says of robots that the run does not have; empty for nothing.

        For example, in a run of 3 robots an event of robot 4 gives "an event of robot 4".

        Links are checked when a tick is decoded (`patrol.journal.decode`).

        Args:
            record: Of the same journal.
        """
        robot_count = len(self.robots)
        if isinstance(record, Event):
            return (
                f"an event of robot {record.robot}" if record.robot is not None and record.robot > robot_count else ""
            )
        if not isinstance(record, TickRecord):
            return ""
        if [row.number for row in record.robots] != [robot.number for robot in self.robots]:
            return "rows of other robots than the header's"
        if any(source > robot_count for source, _ in record.frames):
            return "a frame of a robot that the header does not have"
        return ""


@with_config(_OTHERS)
@dataclass(frozen=True, slots=True)
class _Said:
    """The traffic that a robot with a direct radio reports."""

    heard: _Counts
    sent: _Count
    refused: _Count
    final: Flag


@with_config(_OTHERS)
@dataclass(frozen=True, slots=True)
class _Direct:
    """The note of a direct radio (`worldsim.radio.listener.Listener.notes`)."""

    missed: _Counts = field(default_factory=dict)
    said: Annotated[dict[Any, _Said], FAIL_FAST_MAP] = field(default_factory=dict)


@with_config(_OTHERS)
@dataclass(frozen=True, slots=True)
class _Notes:
    """The notes of an `End` that must be of a type: s of wall time, counts by robot number and by name."""

    wall_s: Annotated[_Number, Field(ge=_SHORTEST_S)] = 0.0
    slipped_s: _Amount = 0.0
    held_up_s: _Amount = 0.0
    longest_held_up_s: _Amount = 0.0
    router_silent_s: _Amount = 0.0
    late_frames: _CountsByRobot = field(default_factory=dict)
    too_late: _CountsByRobot = field(default_factory=dict)
    late_commands: _CountsByRobot = field(default_factory=dict)
    refused: _Counts = field(default_factory=dict)
    direct: _Direct = field(default_factory=_Direct)


def _keep_notes(value: Any, validate: Callable[[Any], object]) -> Any:
    """Check notes, and keep those that have no type as well."""
    validate(value)
    return value


_NOTES = GetPydanticSchema(lambda _kind, of: schemas.no_info_wrap_validator_function(_keep_notes, of(_Notes)))


@with_config(_NO_OTHERS)
@dataclass(frozen=True, slots=True)
class End:
    """A journal's last record. What else the notes may hold, their reader checks.

    Attributes:
        reason: Why the run ended.
        trace_hash: Of all ticks.
        notes: What the launcher should know as well.
    """

    reason: Text
    trace_hash: Text
    notes: Annotated[Mapping[str, Any], _NOTES] = field(default_factory=dict)


Record = Header | TickRecord | Event | End
