"""The frames on the links, for the summary: per directed link, and per fault of the radio."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from patrol.journal.records import FORGED
from patrol.scenario import load_scenario
from patrol.scenario.controls import OPERATOR, operated
from patrol.scenario.faults.kinds import PROCESS_KINDS, SENSE_KINDS, Spoof
from patrol.summary.totals import dropped_by_source, is_present
from worldsim.faults.timeline import Entry, Timeline
from worldsim.radio.rules import receivers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.journal.records import Event, Header, TickRecord

MOST_ROBOTS = 64
"""Fleets above this size have no table of links in their summary: it grows with the square."""

FORGER = "forger"
"""The sender of forged frames."""


@dataclass(slots=True)
class _Link:
    sent: int = 0
    delivered: int = 0
    dropped: Counter[str] = field(default_factory=Counter)

    def facts(self) -> dict[str, Any]:
        return {
            "sent": self.sent,
            "delivered": self.delivered,
            "dropped": dict(sorted(self.dropped.items())),
            "in_flight": self.sent - self.delivered - self.dropped.total(),
        }


@dataclass(slots=True)
class _Fault:
    entry: Entry
    frames: int = 0
    dropped: int = 0
    delayed: int = 0
    duplicated: int = 0

    def facts(self) -> dict[str, Any]:
        facts = {"kind": self.entry.fault.kind}
        if self.entry.fault.kind not in (*PROCESS_KINDS, *SENSE_KINDS):
            counts = ("frames", "dropped", "delayed", "duplicated")
            facts |= {name: getattr(self, name) for name in counts}
        return facts


class Traffic:
    """Counts a run's frames tick by tick; a frame counts once per receiver, and so does each copy.

    The `frames` of a fault are those sent over its links while it was active; of a spoof, those that it forged.
    """

    def __init__(self, header: Header, events: Sequence[Event] = ()) -> None:
        """Count from zero.

        Args:
            header: The run's first record.
            events: Those of the whole run, among which operators may have added faults.
        """
        self._names = {FORGED: FORGER, **{robot.number: robot.name for robot in header.robots}}
        self._links: dict[tuple[int, int], _Link] | None = None
        if len(header.robots) <= MOST_ROBOTS:
            self._links = defaultdict(_Link)
        self._timeline: Timeline | None = None
        self._faults: dict[str, _Fault] = {}
        self._here: frozenset[int] = frozenset()
        self._reach: dict[tuple[str, int], int] = {}
        if header.scenario.get("faults") or any(event.kind == OPERATOR for event in events):
            self._timeline = Timeline(operated(load_scenario(header.scenario), events))
            self._faults = {entry.id: _Fault(entry) for entry in self._timeline.entries}

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        here = frozenset(row.number for row in record.robots if is_present(row.status))
        sent = Counter(source for source, _ in record.frames)
        if self._links is not None:
            self._count_links(self._links, record, here, sent)
        if self._timeline is not None:
            self._count_faults(self._timeline, record, here, sent)

    def links(self) -> dict[str, Any]:
        """The counts by the names of sender and receiver; empty for a fleet above `MOST_ROBOTS`."""
        found: dict[str, dict[str, Any]] = {}
        for (source, to), link in sorted((self._links or {}).items()):
            found.setdefault(self._names[source], {})[self._names[to]] = link.facts()
        return found

    def faults(self) -> dict[str, Any]:
        """The counts by the ids of faults."""
        return {name: fault.facts() for name, fault in self._faults.items()}

    def _count_links(
        self, links: dict[tuple[int, int], _Link], record: TickRecord, here: frozenset[int], sent: Counter[int]
    ) -> None:
        for source, frames in sent.items():
            for to in here:
                if to != source:
                    links[source, to].sent += frames
        for source, to, _, _ in record.copies:
            links[source, to].sent += 1
        for source, to, _ in record.deliveries:
            links[source, to].delivered += 1
        for source, to, _, cause in record.dropped:
            links[source, to].dropped[cause.partition(":")[0]] += 1

    def _reached(self, entry: Entry, origin: int, here: frozenset[int]) -> int:
        """How many others a sender's frames reach over the links that a fault acts on."""
        if here is not self._here and here != self._here:
            self._here = here
            self._reach.clear()
        key = entry.id, origin
        if key not in self._reach:
            self._reach[key] = len(receivers(entry, origin, here) - {origin})
        return self._reach[key]

    def _count_faults(self, timeline: Timeline, record: TickRecord, here: frozenset[int], sent: Counter[int]) -> None:
        senders = Counter({source: frames for source, frames in sent.items() if source != FORGED})
        for fault in record.forged:
            spoof = self._faults[fault]
            spoof.frames += len(here)
            senders[spoof.entry.sources[0]] += 1
        for entry in timeline.at(record.k):
            if not isinstance(entry.fault, Spoof):
                self._faults[entry.id].frames += sum(
                    frames * self._reached(entry, origin, here) for origin, frames in senders.items()
                )
        for _, cause, count in dropped_by_source(record):
            if (fault := cause.partition(":")[2]) in self._faults:
                self._faults[fault].dropped += count
        for *_, fault in record.delayed:
            self._faults[fault].delayed += 1
        for *_, fault in record.copies:
            self._faults[fault].duplicated += 1
