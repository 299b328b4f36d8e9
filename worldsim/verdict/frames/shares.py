"""The verdict's statistical checks of the radio: whether chance explains the losses, copies and delays."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import Delay, Duplicate, Loss, Reorder, Wait
from patrol.journal.links import drops_of
from patrol.journal.records import FORGED, MAX_TICKS, frame_sequence
from worldsim.verdict.common.chance import FAMILY, enough, unexplained
from worldsim.verdict.common.check import CheckResult
from worldsim.verdict.common.faults import FrameFaultCheck, active, on_link
from worldsim.verdict.frames.airborne import BEFORE_THE_AIR, airborne, arrived, fault_of, kind_of, sent_links
from worldsim.verdict.frames.timing import SOON

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.faults import Entry, Timeline
    from worldsim.radio.ether import Link
    from worldsim.verdict.common.check import JudgedRun, Readings


_NEVER = 2**31 - 1
"""Above the index of every fault."""


@dataclass(slots=True)
class _Count:
    """Draws of one probability `p`, named `what`, and how many of them hit."""

    what: str
    p: float
    draws: int = 0
    hits: int = 0


@dataclass(slots=True)
class _Losses:
    """The effects of one loss fault. bad: for bursts, the last tick and state of each link."""

    entry: Entry
    counts: list[_Count]
    frames: int = 0
    lost: int = 0
    bad: dict[tuple[int, int], tuple[int, bool]] = field(default_factory=dict)


class LossesAsAsked(FrameFaultCheck):
    """Frames are lost as often as the faults say, and in bursts as long, as far as chance allows (`chance.py`).

    A fault without bursts is one series of draws, one for each frame that got as far as it. A fault with bursts is
    three: which links are bad when it begins; and from one tick to the next on the same link, from good to bad, and
    from bad to good.
    """

    name = "losses"
    kinds = (Loss,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._faults: dict[int, _Losses] = {}
        for entry in self._entries:
            if isinstance(entry.fault, Loss):
                self._faults[entry.index] = _Losses(entry, _counts(entry.fault))
        self._index = {entry.id: entry.index for entry in run.timeline.entries}
        self._alarm = alarm_of(run.timeline)

    def _active_tick(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        faults = [self._faults[entry.index] for entry in entries]
        if all(len(losses.counts) == 1 for losses in faults):
            self._count_all(faults, record)
            return
        why = {(source, to, sequence): cause for source, to, sequence, cause in record.dropped}
        here = [row.number for row in record.robots if row.status.is_present]
        places: Counter[int] = Counter()
        for source, _ in record.frames:
            sequence = frame_sequence(record.k, places[source])
            places[source] += 1
            if source == FORGED:
                continue
            for to in here:
                if to != source:
                    cause = why.get((source, to, sequence), "")
                    self._sort_out(faults, record.k, (source, to), cause, first=places[source] == 1)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        details = []
        for losses in self._faults.values():
            share = (
                f"{100.0 * losses.lost / losses.frames:.1f} % of {losses.frames} frames lost" if losses.frames else ""
            )
            details.append(f"{losses.entry.id}: {share or 'no frames'}")
        counts = [(losses.entry.id, count) for losses in self._faults.values() for count in losses.counts]
        return _judged(self.name, details, counts, self._alarm)

    def _good(self) -> str:
        return ""

    def _count_all(self, faults: Sequence[_Losses], record: TickRecord) -> None:
        """Count every frame on every link, as `_sort_out` does, where no fault comes in bursts."""
        sent, dropped = sent_links(record), drops_of(record.dropped)
        own = sent.source != FORGED
        sources, targets = sent.source[own], sent.destination[own]
        # The index of the loss that stopped a frame; below all of them where it never got as far as a loss.
        stops = [
            -1
            if kind_of(why) in BEFORE_THE_AIR
            else self._index.get(fault_of(why), _NEVER)
            if kind_of(why) == "loss"
            else _NEVER
            for why in dropped.causes
        ]
        now = (dropped.sequence % (MAX_TICKS + 1) == record.k) & (dropped.source != FORGED)
        stop = np.array(stops, dtype=np.int64)[dropped.cause[now]]
        ends = dropped.source[now], dropped.destination[now]
        for losses in faults:
            entry = losses.entry
            reached = np.count_nonzero(_between(entry, sources, targets))
            on = _between(entry, *ends)
            stopped_before = np.count_nonzero(on & (stop < entry.index))
            lost = int(np.count_nonzero(on & (stop == entry.index)))
            frames = int(reached - stopped_before)
            losses.frames += frames
            losses.lost += lost
            losses.counts[0].draws += frames
            losses.counts[0].hits += lost

    def _sort_out(self, faults: Sequence[_Losses], k: int, link: tuple[int, int], cause: str, *, first: bool) -> None:
        """Count a frame on a link: faults before the one that lost it let it through, later ones never saw it."""
        kind = kind_of(cause)
        if kind in BEFORE_THE_AIR:
            return
        last = self._index.get(fault_of(cause), math.inf) if kind == "loss" else math.inf
        for losses in faults:
            index = losses.entry.index
            if index > last or not on_link(losses.entry, *link):
                continue
            lost = index == last
            losses.frames += 1
            losses.lost += lost
            if len(losses.counts) == 1:
                losses.counts[0].draws += 1
                losses.counts[0].hits += lost
            elif first:
                self._step(losses, k, link, lost)

    def _step(self, losses: _Losses, k: int, link: tuple[int, int], bad: bool) -> None:
        before = losses.bad.get(link)
        losses.bad[link] = k, bad
        if k == losses.entry.begin:
            losses.counts[2].draws += 1
            losses.counts[2].hits += bad
        if before is not None and before[0] == k - 1:
            count = losses.counts[1 if before[1] else 0]
            count.draws += 1
            count.hits += bad != before[1]


class DelaysAsAsked(FrameFaultCheck):
    """Frames are copied, held back and delayed as often as the faults say, as far as chance allows (`chance.py`).

    Counted are reorders whose `hold` alone makes a frame late, and for random delays, of frames that nothing else
    delays or copies, how many are still in flight after about the median. Such a frame counts when that time is over,
    also if it arrived sooner: else the last ticks would add early frames, and no late ones.
    """

    name = "delays and copies"
    kinds = (Delay, Duplicate, Reorder)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        step = run.step
        self._counts: dict[int, _Count] = {}
        self._patience: dict[int, int] = {}
        for entry in self._entries:
            fault = entry.fault
            if isinstance(fault, Duplicate):
                self._counts[entry.index] = _Count("frames were copied", fault.rate)
            elif isinstance(fault, Reorder) and (step if fault.hold is None else fault.hold) > (SOON + 1e-6) * step:
                self._counts[entry.index] = _Count("frames were held back", fault.rate)
            elif isinstance(fault, Delay) and _is_random(fault.delay):
                ticks = math.floor(_median(fault.delay) / step)
                chance = longer(fault.delay, (ticks + SOON) * step)
                self._patience[entry.index] = ticks
                self._counts[entry.index] = _Count(f"frames took longer than {ticks} ticks", chance)
        self._alarm = alarm_of(run.timeline)
        self._awaited: set[Link] = set()
        self._until: dict[int, list[tuple[Link, _Count]]] = defaultdict(list)

    def _tick(self, record: TickRecord) -> None:
        entries = [entry for entry in self._entries if active(entry, record.k) and entry.index in self._counts]
        if entries:
            holding = [entry for entry in self._entries if active(entry, record.k)]
            befell = {*record.copies, *record.delayed}
            copied = {row[:3] for row in record.copies}
            for origin, link in airborne(record, self._forgers):
                on = [entry for entry in holding if on_link(entry, origin, link[1])]
                self._count(on, link, befell)
                self._await(on, link, record.k, alone=link not in copied)
        self._awaited.difference_update(arrived(record))
        for link, count in self._until.pop(record.k, ()):
            count.draws += 1
            count.hits += link in self._awaited
            self._awaited.discard(link)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        counts = [(entry.id, self._counts[entry.index]) for entry in self._entries if entry.index in self._counts]
        details = [f"{fault}: {count.hits} of {count.draws} {count.what}" for fault, count in counts]
        return _judged(self.name, details, counts, self._alarm)

    def _good(self) -> str:
        return ""

    def _count(self, on: Iterable[Entry], link: Link, befell: set[tuple[int, int, int, str]]) -> None:
        """Count which faults of its link hit a frame."""
        for entry in on:
            if entry.index in self._counts and not isinstance(entry.fault, Delay):
                self._counts[entry.index].draws += 1
                self._counts[entry.index].hits += (*link, entry.id) in befell

    def _await(self, on: Iterable[Entry], link: Link, k: int, *, alone: bool) -> None:
        """Look for a frame when the median delay is over, if a random delay is the only fault that acts on it."""
        holding = [entry for entry in on if not isinstance(entry.fault, Duplicate)]
        if alone and len(holding) == 1 and holding[0].index in self._patience:
            index = holding[0].index
            self._awaited.add(link)
            self._until[k + self._patience[index]].append((link, self._counts[index]))


def _between(entry: Entry, sources: NDArray[np.int64], targets: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark the links that a fault acts on."""
    on: NDArray[np.bool_] = np.isin(sources, sorted(entry.sources)) & np.isin(targets, sorted(entry.targets))
    return on


def alarm_of(timeline: Timeline) -> float:
    """Return the probability of a false alarm for each series of draws: `FAMILY`, shared equally."""
    series = sum(
        3 if isinstance(entry.fault, Loss) and entry.fault.mean_burst is not None else 1
        for entry in timeline.entries
        if isinstance(entry.fault, Loss | Delay | Duplicate | Reorder)
    )
    return FAMILY / max(series, 1)


def longer(wait: Wait, seconds: float) -> float:
    """Return the probability that a random wait is longer than a time of 0 s or more.

    The wait's distribution must not be constant.
    """
    first, *rest = wait.values
    match wait.shape:
        case "uniform":
            return min(max((rest[0] - seconds) / (rest[0] - first), 0.0), 1.0)
        case "normal":
            return 0.5 * math.erfc((seconds - first) / (rest[0] * math.sqrt(2.0)))
    return math.exp(-seconds / first)


def _is_random(wait: Wait) -> bool:
    first, *rest = wait.values
    match wait.shape:
        case "constant":
            return False
        case "uniform":
            return first < rest[0]
        case "normal":
            return rest[0] > 0.0
    return first > 0.0


def _median(wait: Wait) -> float:
    """Return the median of a wait, s."""
    first, *rest = wait.values
    match wait.shape:
        case "uniform":
            return 0.5 * (first + rest[0])
        case "exponential":
            return first * math.log(2.0)
    return first


def _judged(name: str, details: Sequence[str], counts: Sequence[tuple[str, _Count]], alarm: float) -> CheckResult:
    """Return the result of all series of draws; `details` are shown where chance explains them."""
    tellable = [(fault, count) for fault, count in counts if enough(count.draws, count.p, alarm)]
    wrong = [
        f"{fault}: {count.hits} of {count.draws} {count.what}, {100.0 * count.p:.4g} % configured"
        for fault, count in tellable
        if unexplained(count.hits, count.draws, count.p, alarm)
    ]
    if wrong:
        return CheckResult(name, False, "; ".join(wrong))
    if not details:
        return CheckResult(name, True, "none of these faults is random", judged=False)
    return CheckResult(
        name, True, "; ".join(details) + ("" if tellable else "; too few to judge"), judged=bool(tellable)
    )


def _counts(fault: Loss) -> list[_Count]:
    if fault.mean_burst is None:
        return [_Count("frames were lost", fault.rate)]
    recovers = 1.0 / fault.mean_burst
    return [
        _Count("good ticks turned bad", min(fault.rate * recovers / (1.0 - fault.rate), 1.0)),
        _Count("bad ticks turned good", recovers),
        _Count("links were bad to begin with", fault.rate),
    ]
