"""The verdict's check of when frames arrive, by what docs/faults.md says of the faults that delay or copy them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from patrol.faults.kinds import FRAME_KINDS, Delay, Duplicate, Reorder, Wait
from patrol.journal.links import places_of
from patrol.journal.records import sent_at
from worldsim.verdict.common.faults import FrameFaultCheck, active, on_link
from worldsim.verdict.frames.airborne import airborne, arrived

if TYPE_CHECKING:
    from patrol.journal.links import Links
    from patrol.journal.records import TickRecord
    from worldsim.faults import Entry
    from worldsim.radio.ether import Link
    from worldsim.verdict.common.check import JudgedRun, Readings

SOON = 0.2
"""A frame that takes at most this share of a step is heard in its own tick."""

Span = tuple[float, float]
"""The least and the most, in s or ticks; the most may be infinite."""


class OnTime(FrameFaultCheck):
    """Each frame arrives when the faults of its tick let it; in its own tick, and once, where none acts on it.

    A fault that delayed it by the journal must be able to: a delay within its bounds, a reorder by its `hold`. A copy
    takes as long as the frame, and its own delay more.
    """

    name = "on time"
    kinds = (Delay, Duplicate, Reorder)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._step = run.step
        self._due: dict[Link, list[Span]] = {}
        self._last: dict[float, list[Link]] = defaultdict(list)
        self._arrived = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the world carried the frames and there is any fault of the radio."""
        return run.by_ether and any(entry.fault.kind in FRAME_KINDS for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        entries = [entry for entry in self._entries if active(entry, record.k)]
        landed = arrived(record)
        self._arrived += len(landed)
        if not entries and not self._due:
            self._at_once(record, landed)
            return
        self._expect(record, entries)
        for link in landed:
            self._land(link, record.k)
        for link in self._last.pop(record.k, ()):
            if any(last <= record.k for _, last in self._due.get(link, ())):
                self._wrong(link, f"should have arrived by tick {record.k}")

    def _good(self) -> str:
        return f"{self._arrived} frames arrived in time"

    def _at_once(self, record: TickRecord, landed: Links) -> None:
        """Judge a tick in which nothing is delayed, copied or in flight."""
        places = places_of(landed)
        if places is None or (landed.sequence != record.k).any() or (np.diff(np.sort(places)) == 0).any():
            self._look_at_each(record, landed)
        for row in (*record.copies, *record.delayed):
            self._wrong(row[:3], f"was copied or delayed by {row[3]}, which is not active")

    def _look_at_each(self, record: TickRecord, landed: Sequence[Link]) -> None:
        for link, times in Counter(landed).items():
            if sent_at(link[2]) != record.k:
                self._wrong(link, f"arrived in tick {record.k}")
            elif times > 1:
                self._wrong(link, f"arrived {times} times")

    def _expect(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        """Note the ticks in which the frames of a tick may arrive."""
        delayed, copied = _by_link(record.delayed), _by_link(record.copies)
        for origin, link in airborne(record, self._forgers):
            on = {entry.id: entry for entry in entries if on_link(entry, origin, link[1])}
            holders = delayed.pop(link, [])
            takes = self._takes(link, on, holders)
            spans = [takes]
            copies = copied.pop(link, [])
            for fault in copies:
                entry = on.get(fault)
                if entry is None or not isinstance(entry.fault, Duplicate) or copies.count(fault) > 1:
                    self._wrong(link, f"was copied by {fault}, which does not copy it")
                    continue
                extra = (0.0, 0.0) if entry.fault.delay is None else bounds(entry.fault.delay)
                spans.append((takes[0] + extra[0], takes[1] + extra[1]))
            soonest = record.k + bool(holders)
            ticks = [(self._heard_in(record.k, least), self._heard_in(record.k, most)) for least, most in spans]
            self._due[link] = [(max(first, soonest), last) for first, last in ticks]
            for _, last in self._due[link]:
                if last < math.inf:
                    self._last[last].append(link)
        for link in (*delayed, *copied):
            self._wrong(link, "was copied or delayed, but was not in flight")

    def _takes(self, link: Link, on: dict[str, Entry], delayers: Sequence[str]) -> Span:
        """Return the least and the longest time (s) of a frame that, by the journal, these faults delayed, or none."""
        least = greatest = 0.0
        for fault, entry in on.items():
            if isinstance(entry.fault, Delay):
                shortest, longest = bounds(entry.fault.delay)
                least, greatest = least + shortest, greatest + longest
            elif isinstance(entry.fault, Reorder):
                hold = self._step if entry.fault.hold is None else entry.fault.hold
                # The journal does not name the reorders of a frame that arrived in its own tick.
                least += hold * (fault in delayers)
                greatest += hold * (fault in delayers or not delayers)
        for fault in delayers:
            if fault not in on or isinstance(on[fault].fault, Duplicate):
                self._wrong(link, f"was delayed by {fault}, which does not delay it")
        if delayers and self._heard_in(0, greatest) < 1:
            self._wrong(link, "was recorded as delayed, but by too little to arrive in a later tick")
        if not delayers and self._heard_in(0, least) > 0:
            self._wrong(link, "was not delayed and should have been")
        at_once_s = SOON * self._step
        return (max(least, at_once_s), greatest) if delayers else (least, min(greatest, at_once_s))

    def _heard_in(self, k: int, seconds: float) -> float:
        """Return the tick in which a frame is heard that was sent in tick k and takes a time in seconds."""
        if math.isinf(seconds):
            return math.inf
        return k + max(0, math.ceil((seconds - SOON * self._step) / self._step - 1e-9))

    def _land(self, link: Link, k: int) -> None:
        """Match an arriving copy of a frame to the span that is open now and closes first."""
        spans = self._due.get(link, [])
        fitting = [span for span in spans if span[0] <= k]
        if not fitting:
            first = min((first for first, _ in spans), default=None)
            late = "once too often" if first is None else f"and should not have before tick {first:g}"
            self._wrong(link, f"arrived in tick {k} {late}")
            return
        spans.remove(min(fitting, key=lambda span: span[1]))
        if not spans:
            del self._due[link]

    def _wrong(self, link: Link, problem: str) -> None:
        source, to, sequence = link
        name = f"frame {sequence} from {self._names.get(source, source)} to {self._names.get(to, to)}"
        self._fail(f"{name} {problem}")


def bounds(wait: Wait) -> Span:
    """Return the least and the greatest length of a wait, s."""
    first, *rest = wait.values
    match wait.shape:
        case "constant":
            return first, first
        case "uniform":
            return first, rest[0]
        case "normal" if rest[0] == 0.0:
            return first, first
    return 0.0, (math.inf if first > 0.0 or wait.shape == "normal" else 0.0)


def _by_link(rows: Sequence[tuple[int, int, int, str]]) -> dict[Link, list[str]]:
    """Return the faults of rows of (source, destination, sequence, fault), by link."""
    faults: dict[Link, list[str]] = defaultdict(list)
    for source, to, sequence, fault in rows:
        faults[source, to, sequence].append(fault)
    return faults
