"""The verdict's statistical checks of the radio: whether chance explains how many frames fared in which way."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from patrol.journal.records import FORGED, frame_sequence
from patrol.scenario.faults.kinds import Delay, Duplicate, Loss, Reorder, Wait
from worldsim.radio.ether import there
from worldsim.radio.rules import chain_of
from worldsim.verdict.chance import FAMILY, enough, unexplained
from worldsim.verdict.checks import Check
from worldsim.verdict.frames.airborne import (
    BEFORE_THE_AIR,
    active,
    airborne,
    arrived,
    fault_of,
    forgers_of,
    kind_of,
    on_link,
)
from worldsim.verdict.frames.timing import SOON

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.radio.ether import Link
    from worldsim.timeline import Entry, Timeline


@dataclass(slots=True)
class _Count:
    """Draws of one probability. hits: how many came true."""

    what: str
    p: float
    draws: int = 0
    hits: int = 0


@dataclass(slots=True)
class _Losses:
    """What one loss fault did. bad: the last state of each link and its tick, for bursts."""

    entry: Entry
    counts: list[_Count]
    frames: int = 0
    lost: int = 0
    bad: dict[tuple[int, int], tuple[int, bool]] = field(default_factory=dict)


class LossesAsAsked:
    """Frames are lost as often as the faults say, and in bursts as long, as far as chance goes (`chance.py`).

    A fault without bursts is one series of draws, one for each frame that got as far as it. A fault with bursts is
    three: which links are bad when it begins; and from one tick to the next on the same link, from good to bad, and
    from bad to good.
    """

    def __init__(self, timeline: Timeline) -> None:
        self._faults: dict[int, _Losses] = {}
        for entry in timeline.entries:
            if isinstance(entry.fault, Loss):
                self._faults[entry.index] = _Losses(entry, _counts(entry.fault))
        self._index = {entry.id: entry.index for entry in timeline.entries}
        self._alarm = alarm_of(timeline)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        faults = [losses for losses in self._faults.values() if active(losses.entry, record.k)]
        if not faults:
            return
        why = {(source, to, sequence): cause for source, to, sequence, cause in record.dropped}
        here = [row.number for row in record.robots if there(row.status)]
        places: Counter[int] = Counter()
        for source, _ in record.frames:
            sequence = frame_sequence(record.k, places[source])
            places[source] += 1
            if source == FORGED:
                continue
            for to in here:
                if to != source:
                    cause = why.get((source, to, sequence), "")
                    self._frame(faults, record.k, (source, to), cause, first=places[source] == 1)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        said = []
        for losses in self._faults.values():
            share = (
                f"{100.0 * losses.lost / losses.frames:.1f} % of {losses.frames} frames lost" if losses.frames else ""
            )
            said.append(f"{losses.entry.id}: {share or 'no frames'}")
        counts = [(losses.entry.id, count) for losses in self._faults.values() for count in losses.counts]
        return _judged("losses", said, counts, self._alarm)

    def _frame(self, faults: Sequence[_Losses], k: int, link: tuple[int, int], cause: str, *, first: bool) -> None:
        """One frame on one link; the faults before the one that lost it let it through, those after never had it."""
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


class DelaysAsAsked:
    """Frames are copied, held back and delayed as often as the faults say, as far as chance goes (`chance.py`).

    Only what can be told is counted: reorders whose `hold` alone makes a frame late; and of delays drawn at random, on
    frames that nothing else holds up or copies, how many are still on their way after about the median. Such a frame
    counts when that time is over, whether or not it came sooner: else the last ticks would add those that came early,
    and not those that did not.
    """

    def __init__(self, timeline: Timeline, step: float) -> None:
        """step: s."""
        self._counts: dict[int, _Count] = {}
        self._patience: dict[int, int] = {}
        self._entries = [entry for entry in timeline.entries if isinstance(entry.fault, Delay | Duplicate | Reorder)]
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
        self._forgers = forgers_of(timeline)
        self._alarm = alarm_of(timeline)
        self._awaited: set[Link] = set()
        self._until: dict[int, list[tuple[Link, _Count]]] = defaultdict(list)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
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

    def check(self) -> Check:
        """The result, once all ticks are in."""
        counts = [(entry.id, self._counts[entry.index]) for entry in self._entries if entry.index in self._counts]
        said = [f"{fault}: {count.hits} of {count.draws} {count.what}" for fault, count in counts]
        return _judged("delays and copies", said, counts, self._alarm)

    def _count(self, on: Iterable[Entry], link: Link, befell: set[tuple[int, int, int, str]]) -> None:
        """A frame on its way, and the faults of its link: which of them hit it."""
        for entry in on:
            if entry.index in self._counts and not isinstance(entry.fault, Delay):
                self._counts[entry.index].draws += 1
                self._counts[entry.index].hits += (*link, entry.id) in befell

    def _await(self, on: Iterable[Entry], link: Link, k: int, *, alone: bool) -> None:
        """The same frame, if a random delay is all that befalls it: to be looked for when its median is over."""
        holding = [entry for entry in on if not isinstance(entry.fault, Duplicate)]
        if alone and len(holding) == 1 and holding[0].index in self._patience:
            index = holding[0].index
            self._awaited.add(link)
            self._until[k + self._patience[index]].append((link, self._counts[index]))


def alarm_of(timeline: Timeline) -> float:
    """The probability of a false alarm that each series of draws may have, so that all together have `FAMILY`."""
    series = sum(
        3 if isinstance(entry.fault, Loss) and entry.fault.mean_burst is not None else 1
        for entry in timeline.entries
        if isinstance(entry.fault, Loss | Delay | Duplicate | Reorder)
    )
    return FAMILY / max(series, 1)


def longer(wait: Wait, seconds: float) -> float:
    """The probability that a wait drawn at random is longer than so many seconds (0 or more)."""
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
    """The median of a wait, s."""
    first, *rest = wait.values
    match wait.shape:
        case "uniform":
            return 0.5 * (first + rest[0])
        case "exponential":
            return first * math.log(2.0)
    return first


def _judged(name: str, said: Sequence[str], counts: Sequence[tuple[str, _Count]], alarm: float) -> Check:
    """What all series of draws come to. said: what to say of them where chance explains them."""
    tellable = [(fault, count) for fault, count in counts if enough(count.draws, count.p, alarm)]
    wrong = [
        f"{fault}: {count.hits} of {count.draws} {count.what}, {100.0 * count.p:.4g} % asked for"
        for fault, count in tellable
        if unexplained(count.hits, count.draws, count.p, alarm)
    ]
    if wrong:
        return Check(name, False, "; ".join(wrong))
    if not said:
        return Check(name, True, "nothing that chance has a part in", judged=False)
    return Check(name, True, "; ".join(said) + ("" if tellable else "; too few to judge"), judged=bool(tellable))


def _counts(fault: Loss) -> list[_Count]:
    if fault.mean_burst is None:
        return [_Count("frames were lost", fault.rate)]
    recovers, fails = chain_of(fault.rate, fault.mean_burst)
    return [
        _Count("good ticks turned bad", fails),
        _Count("bad ticks turned good", recovers),
        _Count("links were bad to begin with", fault.rate),
    ]
