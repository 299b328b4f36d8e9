"""The ground of a judged run as it is in each tick, with what is closed by the journal's events."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from patrol.closures.ground import ChangingFootprint
from patrol.closures.points import ClosedPoints
from patrol.prepare import sensor_footprint
from worldsim.verdict.common.check import JournalReading

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import Terrain
    from patrol.journal import Event, TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class ClosedGround(JournalReading):
    """The ground, tick by tick; without closures it never changes.

    `closure_events` are the events of closures just before this tick.
    """

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self.closed = ClosedPoints(run.prepared.scenario.closures, run.prepared.terrain)
        self.closure_events: list[Event] = []
        self._events = 0

    @property
    def changed(self) -> bool:
        """True if something closed or opened, or began to wait, before this tick."""
        return bool(self.closure_events)

    @cached_property
    def footprint(self) -> Footprint:
        """The robots' sensor on the ground as it is."""
        footprint = sensor_footprint(self._run.prepared.scenario, self._run.prepared.terrain)
        if isinstance(footprint, ChangingFootprint):
            footprint.close(self.closed.grid)
        return footprint

    @property
    def terrain(self) -> Terrain:
        """The ground as it is, for bodies."""
        return self.footprint.terrain if self.closed.points else self._run.prepared.terrain

    def tick(self, record: TickRecord) -> None:
        """Take in the events before a tick."""
        if not self.closed.points:
            return
        events = self._run.journal.events
        self.closure_events = []
        while self._events < len(events) and events[self._events].k <= record.k:
            if self.closed.take(events[self._events]):
                self.closure_events.append(events[self._events])
            self._events += 1
        if self.changed and isinstance(self.footprint, ChangingFootprint):
            self.footprint.close(self.closed.grid)
