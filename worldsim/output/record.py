"""Writes a run's records: its header, its ticks and events, and its end with the trace hash."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from patrol.journal import End, Event, Header, RobotFacts, TerrainFacts, TickRecord, TraceHash
from patrol.scenario import RobotSpec, as_mapping, scenario_hash

if TYPE_CHECKING:
    from worldsim.run_record import Writer
    from worldsim.world import World


def lower_bound(area_m2: float, roster: Sequence[RobotSpec], range_m: float) -> float:
    """Return a lower bound of the MFoW that a fleet can keep on a patrolled area, s, at least 0.

    In a time T robot i sees at most pi r^2 + 2 r v_i T, with the sensor's range r, and the fleet must see the whole
    area A once per MFoW: (A - n pi r^2) / (2 r sum v_i), which for n equal robots is (A / n - pi r^2) / (2 r v).

    For example, 8.0 s for 100 m² and one robot at 2 m/s with a range of 2.5 m.
    """
    at_once = len(roster) * math.pi * range_m**2
    return max((area_m2 - at_once) / (2.0 * range_m * sum(spec.speed for spec in roster)), 0.0)


def header_of(world: World, started: str | None = None) -> Header:
    """Make the first record of a run; `started` is wall time as ISO 8601 text, for people, or None."""
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


class Recorder:
    """Writes a run's records in their order and keeps the trace hash."""

    def __init__(self, writer: Writer, spares: Collection[int] = ()) -> None:
        """Record a run."""
        self._writer = writer
        self._trace = TraceHash(spares)

    @property
    def trace_hash(self) -> str:
        """The trace hash of the ticks so far."""
        return self._trace.hexdigest()

    def tick(self, record: TickRecord) -> None:
        """Write the record of a tick that is over."""
        # Before it is written: a record that cannot be written is part of the hash that the end would have had.
        self._trace.tick(record)
        self._writer.write(record)

    def event(self, event: Event) -> None:
        """Write an event between ticks."""
        self._writer.write(event)

    def end(self, reason: str, notes: Mapping[str, Any] | None = None) -> End:
        """Write the end of the run, and return that record.

        The reason is `COMPLETED`, `INTERRUPTED`, or what went wrong in words; the notes are facts about the run that
        its ticks do not hold.
        """
        end = End(reason, self._trace.hexdigest(), notes or {})
        self._writer.write(end)
        return end
