"""The verdict's checks of when things happen, by what docs/faults.md says: faults, and frames that they hold up."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

from patrol.journal.records import FORGED, sent_at
from patrol.scenario.faults.kinds import Delay, Duplicate, Lasting, Reorder, Wait
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.frames.airborne import active, airborne, arrived, forgers_of, on_link

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.radio.ether import Link
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Entry, Timeline

SOON = 0.2
"""A frame that takes no longer than this share of a step is heard in its own tick."""

Span = tuple[float, float]
"""The least and the most, in s or ticks; the most may be infinite."""

_ROUNDING = 1e-9
"""Times as near to a tick, or to half of one, count as it, in ticks."""


class FaultsOnTime:
    """The ticks in which each fault begins and ends are those of its `at` and `for`.

    World and verdict take these ticks from the same timeline, so nothing that happens in a run could tell.
    """

    def __init__(self, timeline: Timeline, step: float) -> None:
        """step: s."""
        self._faults = len(timeline.entries)
        wrong = [entry for entry in timeline.entries if not (_begins(entry, step) and _ends(entry, step))]
        self._problem = "; ".join(
            f"{entry.id} is taken to go on from tick {entry.begin} "
            + ("to the end of the run" if entry.end is None else f"to before tick {entry.end}")
            for entry in wrong
        )

    def tick(self, record: TickRecord) -> None:
        """Nothing of a tick has a part in it."""

    def check(self) -> Check:
        """The result."""
        return Check("fault times", not self._problem, self._problem or f"{self._faults} faults when they should be")


class OnTime:
    """Each frame arrives when the faults of its tick let it; in its own tick, and once, where none applies to it.

    What the journal says held it up must be able to: delays within their bounds, and every reorder that it names by its
    `hold`. Each copy that it names takes as long as the frame and its own delay more.
    """

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._step = float(journal.header.scenario["step"])
        self._entries = [entry for entry in timeline.entries if isinstance(entry.fault, Delay | Duplicate | Reorder)]
        self._forgers = forgers_of(timeline)
        self._due: dict[Link, list[Span]] = {}
        self._last: dict[float, list[Link]] = defaultdict(list)
        self._problem = ""
        self._arrived = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._problem:
            return
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

    def check(self) -> Check:
        """The result, once all ticks are in."""
        good = f"{self._arrived} frames arrived when they could"
        return Check("on time", not self._problem, self._problem or good)

    def _at_once(self, record: TickRecord, landed: Sequence[Link]) -> None:
        """Nothing holds up or copies what is sent now, and nothing is on its way."""
        for link, times in Counter(landed).items():
            if sent_at(link[2]) != record.k:
                self._wrong(link, f"arrived in tick {record.k}")
            elif times > 1:
                self._wrong(link, f"arrived {times} times")
        for row in (*record.copies, *record.delayed):
            self._wrong(row[:3], f"was copied or held up by {row[3]}, which is not active")

    def _expect(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        """When the frames of a tick may arrive."""
        held, copied = _by_link(record.delayed), _by_link(record.copies)
        for origin, link in airborne(record, self._forgers):
            on = {entry.id: entry for entry in entries if on_link(entry, origin, link[1])}
            holders = held.pop(link, [])
            takes = self._takes(link, on, holders)
            spans = [takes]
            copies = copied.pop(link, [])
            for fault in copies:
                entry = on.get(fault)
                if entry is None or not isinstance(entry.fault, Duplicate) or copies.count(fault) > 1:
                    self._wrong(link, f"was copied by {fault}, which does not do that")
                    continue
                more = (0.0, 0.0) if entry.fault.delay is None else bounds(entry.fault.delay)
                spans.append((takes[0] + more[0], takes[1] + more[1]))
            soonest = record.k + bool(holders)
            self._due[link] = [(max(self._tick(record.k, a), soonest), self._tick(record.k, b)) for a, b in spans]
            for _, last in self._due[link]:
                if last < math.inf:
                    self._last[last].append(link)
        for link in (*held, *copied):
            self._wrong(link, "was copied or held up, and was not on its way")

    def _takes(self, link: Link, on: dict[str, Entry], held: Sequence[str]) -> Span:
        """How long (s) a frame may take that the journal says was held up by these faults, or by none."""
        least = most = 0.0
        for fault, entry in on.items():
            if isinstance(entry.fault, Delay):
                shortest, longest = bounds(entry.fault.delay)
                least, most = least + shortest, most + longest
            elif isinstance(entry.fault, Reorder):
                hold = self._step if entry.fault.hold is None else entry.fault.hold
                # Of a frame that came at once nobody says which reorders hit it.
                least, most = least + hold * (fault in held), most + hold * (fault in held or not held)
        for fault in held:
            if fault not in on or isinstance(on[fault].fault, Duplicate):
                self._wrong(link, f"was held up by {fault}, which does not do that")
        if held and self._tick(0, most) < 1:
            self._wrong(link, "was held up by less than it takes to be late")
        if not held and self._tick(0, least) > 0:
            self._wrong(link, "was not held up and should have been")
        soon = SOON * self._step
        return (max(least, soon), most) if held else (least, min(most, soon))

    def _tick(self, k: int, seconds: float) -> float:
        """In which tick a frame is heard that was sent in tick k and takes so many seconds."""
        if math.isinf(seconds):
            return math.inf
        return k + max(0, math.ceil((seconds - SOON * self._step) / self._step - 1e-9))

    def _land(self, link: Link, k: int) -> None:
        """One copy of a frame arrives: it is that one which may still come and has to come first."""
        spans = self._due.get(link, [])
        fitting = [span for span in spans if span[0] <= k]
        if not fitting:
            first = min((first for first, _ in spans), default=None)
            late = "once too often" if first is None else f"and should not before tick {first:g}"
            self._wrong(link, f"arrived in tick {k} {late}")
            return
        spans.remove(min(fitting, key=lambda span: span[1]))
        if not spans:
            del self._due[link]

    def _wrong(self, link: Link, what: str) -> None:
        source, to, sequence = link
        name = f"frame {sequence} from {self._names.get(source, source)} to {self._names.get(to, to)}"
        self._problem = self._problem or f"{name} {what}"


def bounds(wait: Wait) -> Span:
    """The least and the most (s) that a wait can be."""
    first, *rest = wait.values
    match wait.shape:
        case "constant":
            return first, first
        case "uniform":
            return first, rest[0]
        case "normal" if rest[0] == 0.0:
            return first, first
    return 0.0, (math.inf if first > 0.0 or wait.shape == "normal" else 0.0)


def _begins(entry: Entry, step: float) -> bool:
    """Whether a fault begins in the first tick that is not before its `at`."""
    at = entry.fault.at / step - _ROUNDING
    return entry.begin >= at and (entry.begin == 0 or entry.begin - 1 < at)


def _ends(entry: Entry, step: float) -> bool:
    """Whether a fault goes on for its `for`, rounded to ticks, half a tick up, and at least one tick."""
    fault = entry.fault
    if not isinstance(fault, Lasting):
        return entry.end == entry.begin
    if entry.end is None or fault.lasts is None:
        return entry.end is None and fault.lasts is None
    ticks = entry.end - entry.begin
    more = fault.lasts / step + _ROUNDING - ticks
    return more < 0.5 and (ticks == 1 or (ticks > 1 and more >= -0.5))


def _by_link(rows: Sequence[tuple[int, int, int, str]]) -> dict[Link, list[str]]:
    """The faults of rows of (source, destination, sequence, fault), by link."""
    found: dict[Link, list[str]] = defaultdict(list)
    for source, to, sequence, fault in rows:
        found[source, to, sequence].append(fault)
    return found
