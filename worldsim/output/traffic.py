"""The frames on the links, for the summary: per directed link, and per fault of the radio."""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.faults.kinds import FRAME_KINDS, Spoof
from patrol.journal.records import FORGED
from patrol.scenario import load_scenario
from patrol.scenario.controls import OPERATOR, operated
from patrol.summary.totals import count_frames, dropped_by_source
from worldsim.faults import Entry, Timeline
from worldsim.radio.rules import receivers
from worldsim.run_record import links_of, reported, totals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.journal.records import Event, Header, TickRecord
    from worldsim.run_record import RunRecord


def as_measured(summary: Mapping[str, Any], journal: RunRecord) -> dict[str, Any]:
    """Replace what a summary says of frames by what the robots of a direct radio reported.

    `delivered` is what was heard; `dropped` and `in_flight` are None, for they are unknown; `frames` and
    `bytes_per_robot_s` are of the frames that the world heard itself. `direct` has, for each directed link of robots
    that have both reported, the frames sent and heard; `heard_share` over all of these; `missed`, the frames that
    reached the world too late; and `unsaid`, the robots whose counts are missing or end before their process did.
    """
    reports = reported(journal)
    links = links_of(reports)
    names = [robot.name for robot in journal.header.robots]
    robots = {name: dict(facts) for name, facts in summary["robots"].items()}
    for name, facts in robots.items():
        facts.update(
            totals(counts for (sender, _), counts in links.items() if sender == name), dropped=None, in_flight=None
        )
    sums = totals(links.values())
    share = sums["delivered"] / sums["sent"] if sums["sent"] else None
    unknown: dict[str, Any] = {"dropped": None, "dropped_by_cause": {}, "in_flight": None}
    messages = {**summary["messages"], **sums, **unknown}
    direct = {
        "links": {f"{source} to {destination}": counts for (source, destination), counts in links.items()},
        "heard_share": share,
        "missed": journal.end.notes["direct"].get("missed", {}) if reports and journal.end else {},
        "unsaid": [name for name in names if name not in reports or not reports[name]["final"]],
    }
    return {**summary, "messages": messages, "robots": robots, "links": {}, "direct": direct}


MOST_ROBOTS = 64
"""Fleets above this size have no table of links in their summary: it grows with the square."""

FORGER = "forger"
"""The sender of forged frames."""


class Traffic:
    """Counts a run's frames tick by tick; a frame counts once per receiver, and so does each copy.

    The `frames` of a fault are those sent over its links while it was active; of a spoof, those that it forged.
    """

    def __init__(self, header: Header, events: Sequence[Event] = ()) -> None:
        """Count from zero; the events are all of the run, as operators may have added faults."""
        self._names = {FORGED: FORGER, **{robot.number: robot.name for robot in header.robots}}
        self._counted = len(header.robots) <= MOST_ROBOTS
        self._place = {number: index for index, number in enumerate(self._names)} if self._counted else {}
        side = len(self._place)
        self._sent, self._delivered = np.zeros((2, side, side), dtype=np.int64)
        self._dropped: dict[tuple[int, int], Counter[str]] = defaultdict(Counter)
        self._timeline: Timeline | None = None
        self._faults: dict[str, Counter[str]] = {}
        self._here: frozenset[int] = frozenset()
        self._reach: dict[tuple[str, int], int] = {}
        if header.scenario.get("faults") or any(event.kind == OPERATOR for event in events):
            self._timeline = Timeline(operated(load_scenario(header.scenario), events))
            self._faults = {entry.id: Counter() for entry in self._timeline.entries}

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        here = frozenset(row.number for row in record.robots if row.status.is_present)
        sent = Counter(source for source, _ in record.frames)
        if self._counted:
            count_frames(record, self._place, self._sent, self._delivered)
            for source, to, _, cause in record.dropped:
                self._dropped[source, to][cause.partition(":")[0]] += 1
        if self._timeline is not None:
            self._count_faults(self._timeline, record, here, sent)

    def links(self) -> dict[str, Any]:
        """Return the counts by the names of sender and receiver; empty for a fleet above `MOST_ROBOTS`."""
        links: dict[str, dict[str, Any]] = {}
        for source, to in itertools.product(self._place, repeat=2):
            link = self._place[source], self._place[to]
            sent, delivered = int(self._sent[link]), int(self._delivered[link])
            dropped = dict(sorted(self._dropped[source, to].items()))
            if sent or delivered or dropped:
                facts = {"sent": sent, "delivered": delivered, "dropped": dropped}
                # What has neither arrived nor been dropped: delayed frames at the run's end.
                facts["in_flight"] = sent - delivered - sum(dropped.values())
                links.setdefault(self._names[source], {})[self._names[to]] = facts
        return links

    def faults(self) -> dict[str, Any]:
        """Return the counts by the ids of faults."""
        kinds = {} if self._timeline is None else {entry.id: entry.fault.kind for entry in self._timeline.entries}
        counted = ("frames", "dropped", "delayed", "duplicated")
        return {
            name: {"kind": kind} | ({key: self._faults[name][key] for key in counted} if kind in FRAME_KINDS else {})
            for name, kind in kinds.items()
        }

    def _count_reached(self, entry: Entry, origin: int, here: frozenset[int]) -> int:
        """Count the others that a sender's frames reach over the links that a fault acts on."""
        # The same robots in most ticks, so what each fault reaches is counted once.
        if here is not self._here and here != self._here:
            self._here = here
            self._reach.clear()
        key = entry.id, origin
        if key not in self._reach:
            self._reach[key] = len(receivers(entry, origin, here) - {origin})
        return self._reach[key]

    def _count_faults(self, timeline: Timeline, record: TickRecord, here: frozenset[int], sent: Counter[int]) -> None:
        senders = Counter({source: frames for source, frames in sent.items() if source != FORGED})
        origins = {entry.id: entry.sources[0] for entry in timeline.entries if isinstance(entry.fault, Spoof)}
        for fault in record.forged:
            # A forged frame goes to all who are there; its own sender is no receiver of its links.
            self._faults[fault]["frames"] += len(here)
            senders[origins[fault]] += 1
        for entry in timeline.at(record.k):
            if not isinstance(entry.fault, Spoof):
                self._faults[entry.id]["frames"] += sum(
                    frames * self._count_reached(entry, origin, here) for origin, frames in senders.items()
                )
        for _, cause, count in dropped_by_source(record):
            if (fault := cause.partition(":")[2]) in self._faults:
                self._faults[fault]["dropped"] += count
        for *_, fault in record.delayed:
            self._faults[fault]["delayed"] += 1
        for *_, fault in record.copies:
            self._faults[fault]["duplicated"] += 1
