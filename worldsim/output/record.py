"""What a run leaves behind: its records, their trace hash, and where they go."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Protocol

from patrol.journal import End, Event, Header, Record, RobotFacts, TerrainFacts, TickRecord, TraceHash
from patrol.scenario import RobotSpec, as_mapping, scenario_hash

if TYPE_CHECKING:
    from worldsim.world import World

COMPLETED = "completed"
INTERRUPTED = "interrupted"
DESERTED = "nobody is living any more"
"""Why a run ended: all its ticks are done, somebody asked it to stop, or no robot is left."""


def lower_bound(area_m2: float, roster: Sequence[RobotSpec], range_m: float) -> float:
    """The MFoW (s) below which this fleet cannot stay on a patrolled area, whatever it does.

    In a time T robot i sees at most pi r^2 + 2 r v_i T, and the fleet must see the whole area once per MFoW:
    (A - n pi r^2) / (2 r sum v_i), which for robots alike is (A / n - pi r^2) / (2 r v).
    """
    at_once = len(roster) * math.pi * range_m**2
    return max((area_m2 - at_once) / (2.0 * range_m * sum(spec.speed for spec in roster)), 0.0)


def header_of(world: World, started: str | None = None) -> Header:
    """The first record of a run. started: wall time as ISO 8601 text, for people."""
    scenario, terrain = world.scenario, world.terrain
    area = world.truth.fog.points * terrain.point**2
    return Header(
        software=f"fogwatch {version('fogwatch')}",
        scenario=as_mapping(scenario),
        scenario_hash=scenario_hash(scenario),
        robots=tuple(RobotFacts(spec.number, spec.name, spec.model, spec.radius) for spec in scenario.roster),
        terrain=TerrainFacts(terrain.name, terrain.width, terrain.height, terrain.point, terrain.origin),
        patrolled_area_m2=area,
        bound_s=lower_bound(area, [spec for spec in scenario.roster if not spec.spare], scenario.sensor.range),
        started=started,
    )


class Writer(Protocol):
    """Where records go: `patrol.journal.file.JournalWriter`, or a list in memory."""

    def write(self, record: Record) -> None:
        """Take the next record."""
        ...


class RunRecord(Protocol):
    """A run's records, read back: `patrol.journal.file.Journal`, or a list in memory."""

    @property
    def header(self) -> Header:
        """The first record."""
        ...

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order; a new iterator on each access."""
        ...

    @property
    def events(self) -> tuple[Event, ...]:
        """The events in order."""
        ...

    @property
    def end(self) -> End | None:
        """The last record, or None for a run that was cut off."""
        ...

    @property
    def truncated(self) -> bool:
        """Whether something damaged follows the last whole record."""
        ...


class MemoryJournal:
    """A run's records in memory: written like a journal, read like one. Without `keep` its ticks are let go."""

    truncated = False

    def __init__(self, header: Header, keep: bool = True) -> None:
        self.header = header
        self._keep = keep
        self.records: list[TickRecord] = []
        self.events: tuple[Event, ...] = ()
        self.end: End | None = None

    @property
    def ticks(self) -> Iterator[TickRecord]:
        """The ticks in order; a new iterator on each access."""
        return iter(self.records)

    def write(self, record: Record) -> None:
        """Append one record."""
        match record:
            case TickRecord():
                if self._keep:
                    self.records.append(record)
            case Event():
                self.events += (record,)
            case End():
                self.end = record
            case Header():
                self.header = record


class Recorder:
    """Writes a run's records in their order and keeps the trace hash."""

    def __init__(self, writer: Writer, spares: Collection[int] = ()) -> None:
        """spares: numbers of the scenario's spare robots."""
        self._writer = writer
        self._trace = TraceHash(spares)

    def tick(self, record: TickRecord) -> None:
        """A tick is over."""
        self._trace.tick(record)
        self._writer.write(record)

    def event(self, event: Event) -> None:
        """Something has happened between ticks."""
        self._writer.write(event)

    def end(self, reason: str, notes: Mapping[str, Any] | None = None) -> End:
        """The run is over: COMPLETED, INTERRUPTED, or what went wrong in words."""
        end = End(reason, self._trace.hexdigest(), notes or {})
        self._writer.write(end)
        return end
