"""The verdict's check of the journal's events of zones."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

from patrol.journal.records import IN_FORCE, OUT_OF_FORCE
from worldsim.verdict.common.check import Check

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class ZoneTimesTold(Check):
    """The journal has an event in each tick before which a zone begins or ends, and no other.

    Whether a zone is in force is recomputed from the scenario's times, with what operators have switched.
    """

    name = "zone times"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        timed = [zone for zone in run.prepared.scenario.zones if zone.times is not None]
        self._turns_s = {zone.name: [time_s for span in zone.times or () for time_s in span] for zone in timed}
        self._held: set[str] = set()
        self._events = self._changes = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if some zone has times, of the scenario or by a switch."""
        return any(zone.times is not None for zone in run.prepared.scenario.zones)

    def _tick(self, record: TickRecord) -> None:
        k, events = record.k, self._run.journal.events
        in_journal = []
        while self._events < len(events) and events[self._events].k <= k:
            event = events[self._events]
            in_journal += [(event.detail, event.kind)] if event.kind in (IN_FORCE, OUT_OF_FORCE) else []
            self._events += 1
        time_s = k * self._run.step
        held = {name for name, turns_s in self._turns_s.items() if bisect_right(turns_s, time_s) % 2}
        turned = held ^ self._held if k else set()
        wanted = [(name, IN_FORCE if name in held else OUT_OF_FORCE) for name in self._turns_s if name in turned]
        for name, kind in wanted:
            if (name, kind) not in in_journal:
                self._fail(f"{name} is {kind} from tick {k} on, and the journal has no event of it")
        for name, kind in in_journal:
            if in_journal.count((name, kind)) > 1 or (name, kind) not in wanted:
                self._fail(f"the journal has {name} {kind} from tick {k} on, when nothing changes")
        self._held, self._changes = held, self._changes + len(in_journal)

    def _good(self) -> str:
        return f"{len(self._turns_s)} zones with times, which began or ended {self._changes} times, as asked"
