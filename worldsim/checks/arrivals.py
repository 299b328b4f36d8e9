"""The verdict's checks of when frames arrive, and how often they are lost, copied and delayed, by docs/faults.md."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import FRAME_KINDS, Delay, Duplicate, Loss, Reorder, Wait
from patrol.journal.links import drops_of, places_of
from patrol.journal.records import FORGED, MAX_TICKS, sent_at
from worldsim.checks.check import FAMILY, Check, Series, on_link
from worldsim.checks.fates import BEFORE_THE_AIR, airborne, arrived, fault_of, kind_of, sent_links

if TYPE_CHECKING:
    from patrol.journal.links import Drops, Links
    from patrol.journal.records import TickRecord
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry, Timeline
    from worldsim.radio.ether import Link

SOON = 0.2
"""A frame that takes at most this share of a step is heard in its own tick."""

QUANTILES = (0.25, 0.5, 0.75, 0.95)
"""Shares of delays that are shorter than the times at which frames are looked for."""

_NEVER = 2**31 - 1
"""Above the index of every fault."""

Span = tuple[float, float]
"""The least and the most, in s or ticks; the most may be infinite."""

Row = tuple[int, int, int, str]
"""(source, destination, sequence, fault)."""


class OnTime(Check):
    """Each frame arrives when the faults of its tick let it; in its own tick, and once, where none acts on it.

    A fault that delayed it by the journal must be able to: a delay within its bounds, a reorder by its `hold`. A copy
    takes as long as the frame, and its own delay more.
    """

    name = "on time"
    kinds = (Delay, Duplicate, Reorder)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._due: dict[Link, list[Span]] = {}
        self._last: dict[float, list[Link]] = defaultdict(list)
        self._arrived = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the world carried the frames and there is any fault of the radio."""
        return run.by_ether and any(entry.fault.kind in FRAME_KINDS for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        entries = self._active(record.k)
        landed = arrived(record)
        self._arrived += len(landed)
        if not entries and not self._due:
            self._at_once(record, landed)
            return
        self._expect_arrivals(record, entries)
        for link in landed:
            self._match_arrival(link, record.k)
        for link in self._last.pop(record.k, ()):
            if any(last <= record.k for _, last in self._due.get(link, ())):
                self._fail_frame(link, f"should have arrived by tick {record.k}")

    def _end(self) -> str:
        return f"{self._arrived} frames arrived in time"

    def _at_once(self, record: TickRecord, landed: Links) -> None:
        """Judge a tick in which nothing is delayed, copied or in flight."""
        places = places_of(landed)
        # One sort shows that a tick is right; only a wrong one is counted link by link.
        if places is None or (landed.sequence != record.k).any() or (np.diff(np.sort(places)) == 0).any():
            for link, times in Counter(landed).items():
                if sent_at(link[2]) != record.k:
                    self._fail_frame(link, f"arrived in tick {record.k}")
                elif times > 1:
                    self._fail_frame(link, f"arrived {times} times")
        for row in (*record.copies, *record.delayed):
            self._fail_frame(row[:3], f"was copied or delayed by {row[3]}, which is not active")

    def _expect_arrivals(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        """Note the ticks in which the frames of a tick may arrive."""
        delayed, copied = _by_link(record.delayed), _by_link(record.copies)
        for origin, link in airborne(record, self._run.forgers):
            on = {entry.id: entry for entry in entries if on_link(entry, origin, link[1])}
            holders = delayed.pop(link, [])
            takes = self._bound_delay(link, on, holders)
            spans = [takes]
            copies = copied.pop(link, [])
            for fault in copies:
                entry = on.get(fault)
                if entry is None or not isinstance(entry.fault, Duplicate) or copies.count(fault) > 1:
                    self._fail_frame(link, f"was copied by {fault}, which does not copy it")
                    continue
                extra = (0.0, 0.0) if entry.fault.delay is None else bounds(entry.fault.delay)
                spans.append((takes[0] + extra[0], takes[1] + extra[1]))
            # A frame recorded as delayed is heard in a later tick at the earliest.
            soonest = record.k + bool(holders)
            ticks = [
                (self._heard_in(record.k, shortest), self._heard_in(record.k, longest)) for shortest, longest in spans
            ]
            self._due[link] = [(max(first, soonest), last) for first, last in ticks]
            for _, last in self._due[link]:
                if last < math.inf:
                    self._last[last].append(link)
        for link in (*delayed, *copied):
            self._fail_frame(link, "was copied or delayed, but was not in flight")

    def _bound_delay(self, link: Link, on: dict[str, Entry], delayers: Sequence[str]) -> Span:
        """Return the least and the longest time (s) of a frame that, by the journal, these faults delayed, or none."""
        lowest = greatest = 0.0
        for fault, entry in on.items():
            if isinstance(entry.fault, Delay):
                shortest, longest = bounds(entry.fault.delay)
                lowest, greatest = lowest + shortest, greatest + longest
            elif isinstance(entry.fault, Reorder):
                hold = self._step if entry.fault.hold is None else entry.fault.hold
                # The journal does not name the reorders of a frame that arrived in its own tick.
                lowest += hold * (fault in delayers)
                greatest += hold * (fault in delayers or not delayers)
        for fault in delayers:
            if fault not in on or isinstance(on[fault].fault, Duplicate):
                self._fail_frame(link, f"was delayed by {fault}, which does not delay it")
        if delayers and self._heard_in(0, greatest) < 1:
            self._fail_frame(link, "was recorded as delayed, but by too little to arrive in a later tick")
        if not delayers and self._heard_in(0, lowest) > 0:
            self._fail_frame(link, "was not delayed and should have been")
        at_once_s = SOON * self._step
        return (max(lowest, at_once_s), greatest) if delayers else (lowest, min(greatest, at_once_s))

    def _heard_in(self, k: int, seconds: float) -> float:
        """Return the tick in which a frame is heard that was sent in tick k and takes a time in seconds.

        For example, with steps of 0.5 s a frame that takes 0.1 s is heard in tick k, and one that takes 0.6 s in tick k
        + 1.
        """
        if math.isinf(seconds):
            return math.inf
        # Rounding must not put a frame off to the next tick.
        return k + max(0, math.ceil((seconds - SOON * self._step) / self._step - 1e-9))

    def _match_arrival(self, link: Link, k: int) -> None:
        """Match an arriving copy of a frame to the span that is open now and closes first."""
        spans = self._due.get(link, [])
        fitting = [span for span in spans if span[0] <= k]
        if not fitting:
            first = min((first for first, _ in spans), default=None)
            late = "once too often" if first is None else f"and should not have before tick {first:g}"
            self._fail_frame(link, f"arrived in tick {k} {late}")
            return
        # The one that closes first: any other choice could leave a copy that is due without an arrival.
        spans.remove(min(fitting, key=lambda span: span[1]))
        if not spans:
            del self._due[link]

    def _fail_frame(self, link: Link, problem: str) -> None:
        self._fail(f"frame {link[2]} {self._way(link)} {problem}")


class LinkDraws:
    """A fault's draws, one for each frame on each link, in the order of senders and receivers.

    Each hits with the same chance whatever came before. So those that follow a hit are series of their own: at the
    sender's receiver before, of the sender before at the same receiver, on the same link the last time, and on the link
    back. If one draw decides for two links, for example, all that follow a hit hit as well.
    """

    def __init__(self, p: float, words: str, expected: str, robots: int) -> None:
        """Begin without draws; `p` is their chance."""
        lasts = ("at the receiver before", "of the sender before", "on their link before", "on the link back")
        after = [Series(p, f"after a hit {last}, {words}", expected) for last in lasts]
        self.series = (Series(p, words, expected), *after)
        self._hit = np.zeros((robots + 1, robots + 1), dtype=np.bool_)

    def add(
        self, links: Sequence[tuple[int, int]] | NDArray[np.int64], hits: Sequence[bool] | NDArray[np.bool_]
    ) -> None:
        """Add a tick's draws: senders and receivers, in their order, and which draws hit."""
        hit = np.array(hits, dtype=np.bool_)
        source, to = np.array(links, dtype=np.int64).reshape(-1, 2).T
        before, now = np.zeros((5, hit.size), dtype=np.bool_), np.zeros_like(self._hit)
        before[0], before[3] = True, self._hit[source, to]
        before[1, 1:] = hit[:-1] & (source[1:] == source[:-1])
        order = np.lexsort((source, to))
        before[2, order[1:]] = (hit[order][:-1]) & (to[order][1:] == to[order][:-1])
        now[source, to] = self._hit[source, to] = hit
        # Only the link that was drawn first can have come before the one back.
        before[4] = now[to, source] & (to < source)
        for series, counts in zip(self.series, before, strict=True):
            series.draws += int(np.count_nonzero(counts))
            series.hits += int(np.count_nonzero(counts & hit))


class ShareCheck(Check):
    """A check of how often faults act on frames, as far as chance allows (`check.py`).

    A subclass counts in `_draws`, by the indices of its faults, and gives its counts in `_list_counts`.
    """

    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._draws: dict[int, list[LinkDraws]] = {}
        self._alarm = alarm_of(run.timeline)

    def _add_fault(self, entry: Entry, p: float, what: str) -> None:
        """Begin to count how often a fault acts; `p` is its probability."""
        words, expected = f"{entry.id}: {{hits}} of {{draws}} {what}", f", {100.0 * p:.4g} % configured"
        self._draws.setdefault(entry.index, []).append(LinkDraws(p, words, expected, len(self._run.names)))

    def _list_counts(self) -> Iterator[str]:
        """Yield the counts as text; nothing where no fault acts by chance."""
        return (draws.series[0].found() for of_fault in self._draws.values() for draws in of_fault)

    def _end(self) -> str:
        counted = [series for of_fault in self._draws.values() for draws in of_fault for series in draws.series]
        self._fail("; ".join(filter(None, (series.problem(self._alarm) for series in counted))))
        details = "; ".join(self._list_counts())
        if not details:
            self._unknown = "none of these faults is random"
        elif not any(series.is_told(self._alarm) for series in counted):
            self._unknown = f"{details}; too few to judge"
        return details


class LossesAsAsked(ShareCheck):
    """Frames are lost as often as the faults say, and in bursts as long.

    A fault without bursts is one series of draws, one for each frame that got as far as it. A fault with bursts is
    three: from one tick to the next on the same link, from good to bad, and from bad to good; and which links are bad
    when it begins.
    """

    name = "losses"
    kinds = (Loss,)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._index = {entry.id: entry.index for entry in run.timeline.entries}
        self._frames: Counter[int] = Counter()
        self._lost: Counter[int] = Counter()
        # The last tick of each link, and whether it was bad then, by the index of the fault.
        self._bad: dict[int, dict[tuple[int, int], tuple[int, bool]]] = defaultdict(dict)
        for entry in self._entries:
            assert isinstance(entry.fault, Loss)
            rate = entry.fault.rate
            if entry.fault.mean_burst is None:
                self._add_fault(entry, rate, "frames were lost")
                continue
            recovers = 1.0 / entry.fault.mean_burst
            # With this chance, links are bad for the share `rate` of the time in the long run.
            self._add_fault(entry, min(rate * recovers / (1.0 - rate), 1.0), "good ticks turned bad")
            self._add_fault(entry, recovers, "bad ticks turned good")
            self._add_fault(entry, rate, "links were bad to begin with")

    def _list_counts(self) -> Iterator[str]:
        for entry in self._entries:
            lost, frames = self._lost[entry.index], self._frames[entry.index]
            share = f"{100.0 * lost / frames:.1f} % of {frames} frames lost" if frames else "no frames"
            yield f"{entry.id}: {share}"

    def _tick(self, record: TickRecord) -> None:
        entries = self._active(record.k)
        if not entries:
            return
        sent, dropped = sent_links(record), drops_of(record.dropped)
        now = (dropped.sequence % (MAX_TICKS + 1) == record.k) & (dropped.source != FORGED)
        stop = np.array([self._find_stop(why) for why in dropped.causes], dtype=np.int64)[dropped.cause]
        for entry in entries:
            reached = _mark_links(entry, sent) & (sent.source != FORGED)
            on = now & _mark_links(entry, dropped)
            before, lost = on & (stop < entry.index), on & (stop == entry.index)
            frames, hits = int(np.count_nonzero(reached) - np.count_nonzero(before)), int(np.count_nonzero(lost))
            self._frames[entry.index] += frames
            self._lost[entry.index] += hits
            draws = self._draws[entry.index]
            if len(draws) == 1:
                # A frame that an earlier loss stopped never got as far as this one's draw.
                tried = reached & ~mark_among(_keys(sent), _keys(dropped)[before]) if before.any() else reached
                links = np.column_stack((sent.source, sent.destination))
                draws[0].add(links[tried], mark_among(_keys(sent)[tried], _keys(dropped)[lost]))
                continue
            # All frames of a tick share a link's fate, so the first of each sender tells it.
            first = dropped.sequence == record.k
            bad = _list_ends(dropped, lost & first)
            ends = _list_ends(sent, reached & (sent.sequence == record.k)) - _list_ends(dropped, before & first)
            self._count_turns(entry, record.k, sorted(ends), bad)

    def _find_stop(self, cause: str) -> int:
        """Return the index of the loss that is a cause; below all of them where a frame never got as far as a loss."""
        if kind_of(cause) in BEFORE_THE_AIR:
            return -1
        return self._index.get(fault_of(cause), _NEVER) if kind_of(cause) == "loss" else _NEVER

    def _count_turns(
        self, entry: Entry, k: int, links: Sequence[tuple[int, int]], bad: Collection[tuple[int, int]]
    ) -> None:
        """Count how links have turned since the tick before."""
        to_bad, to_good, first = self._draws[entry.index]
        before, now = self._bad[entry.index], {link: (k, link in bad) for link in links}
        for draws, was in ((to_bad, (k - 1, False)), (to_good, (k - 1, True))):
            # Links are seen only in ticks with a frame, so turns are counted between neighbouring ticks alone.
            turning = [link for link in links if before.get(link) == was]
            draws.add(turning, [now[link][1] != was[1] for link in turning])
        if k == entry.begin:
            first.add(links, [now[link][1] for link in links])
        before |= now


class DelaysAsAsked(ShareCheck):
    """Frames are copied, held back and delayed as often as the faults say.

    Counted are reorders whose `hold` alone makes a frame late, and for random delays, of frames that nothing else
    delays or copies, how many are still in flight after some quantiles; and so for the random delays of copies.
    Such a frame counts when that time is over, also if it arrived sooner: else the last ticks would add early frames,
    and no late ones.
    """

    name = "delays and copies"
    kinds = (Delay, Duplicate, Reorder)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        step = run.step
        self._patience: dict[int, list[tuple[int, LinkDraws]]] = defaultdict(list)
        for entry in self._entries:
            fault = entry.fault
            if isinstance(fault, Duplicate):
                self._add_fault(entry, fault.rate, "frames were copied")
            elif isinstance(fault, Reorder) and (step if fault.hold is None else fault.hold) > (SOON + 1e-6) * step:
                self._add_fault(entry, fault.rate, "frames were held back")
            wait = fault.delay if isinstance(fault, Delay | Duplicate) else None
            if wait is not None and bounds(wait)[0] < bounds(wait)[1]:
                for ticks in sorted({math.floor(_find_quantile(wait, share) / step) for share in QUANTILES}):
                    what = "frames" if isinstance(fault, Delay) else "copies"
                    self._add_fault(
                        entry, longer(wait, (ticks + SOON) * step), f"{what} took longer than {ticks} ticks"
                    )
                    self._patience[entry.index].append((ticks, self._draws[entry.index][-1]))
        self._awaited: dict[Link, int] = {}  # arrivals of a frame, and its copy, that are yet to come
        self._until: dict[int, list[tuple[LinkDraws, list[Link]]]] = defaultdict(list)

    def _tick(self, record: TickRecord) -> None:
        entries = self._active(record.k)
        if any(entry.index in self._draws for entry in entries):
            befell = {*record.copies, *record.delayed}
            copied = Counter(row[:3] for row in record.copies)
            tried: dict[int, list[Link]] = defaultdict(list)
            waiting: dict[int, list[Link]] = defaultdict(list)
            for origin, link in airborne(record, self._run.forgers):
                on = [entry for entry in entries if on_link(entry, origin, link[1])]
                for entry in on:
                    if entry.index in self._draws and not isinstance(entry.fault, Delay):
                        tried[entry.index].append(link)
                holding = [entry for entry in on if isinstance(entry.fault, Duplicate) is (link in copied)]
                if len(holding) == 1 and (not copied[link] or len(on) == 1) and holding[0].index in self._patience:
                    waiting[holding[0].index].append(link)
                    self._awaited[link] = 1 + copied[link]
            for entry in entries:
                links = sorted(tried[entry.index])
                if links:
                    hits = [(*link, entry.id) in befell for link in links]
                    self._draws[entry.index][0].add([link[:2] for link in links], hits)
                for ticks, draws in self._patience[entry.index] if waiting[entry.index] else ():
                    self._until[record.k + ticks].append((draws, sorted(waiting[entry.index])))
        for link in arrived(record) if self._awaited else ():
            # A copied frame arrives twice; it is awaited until its second arrival.
            if self._awaited.pop(link, 0) == 2:
                self._awaited[link] = 1
        for draws, links in self._until.pop(record.k, ()):
            draws.add([link[:2] for link in links], [link in self._awaited for link in links])


def alarm_of(timeline: Timeline) -> float:
    """Return the probability of a false alarm for each series of draws: `FAMILY`, shared equally.

    For example, 2e-10 for a single loss without bursts, which makes five series.
    """
    lasting = {Reorder: 1, Delay: len(QUANTILES), Duplicate: 1 + len(QUANTILES)}
    draws = sum(
        (1 if entry.fault.mean_burst is None else 3)
        if isinstance(entry.fault, Loss)
        else lasting.get(type(entry.fault), 0)
        for entry in timeline.entries
    )
    return FAMILY / max(5 * draws, 1)


def bounds(wait: Wait) -> Span:
    """Return the least and the greatest length of a wait, s.

    For example, (0.1, 0.4) for ``uniform: [0.1, 0.4]``, and (0, infinity) for ``exponential: 2``.
    """
    first, *parameters = wait.values
    match wait.shape:
        case "constant":
            return first, first
        case "uniform":
            return first, parameters[0]
        case "normal" if parameters[0] == 0.0:
            return first, first
    return 0.0, (math.inf if first > 0.0 or wait.shape == "normal" else 0.0)


def longer(wait: Wait, seconds: float) -> float:
    """Return the probability that a random wait is longer than a time of 0 s or more.

    For example, 0.37 for 2 s and ``exponential: 2``.

    The wait's distribution must not be constant.
    """
    first, *parameters = wait.values
    match wait.shape:
        case "uniform":
            return min(max((parameters[0] - seconds) / (parameters[0] - first), 0.0), 1.0)
        case "normal":
            return 0.5 * math.erfc((seconds - first) / (parameters[0] * math.sqrt(2.0)))
    return math.exp(-seconds / first)


def _find_quantile(wait: Wait, share: float) -> float:
    """Return the time that a share of waits is shorter than, s; at least 0.

    For example, 1.5 s for a share of 0.75 and ``uniform: [0, 2]``.
    """
    first, *parameters = wait.values
    match wait.shape:
        case "uniform":
            return first + share * (parameters[0] - first)
        case "exponential":
            return -first * math.log(1.0 - share)
    return max(NormalDist(first, parameters[0]).inv_cdf(share), 0.0)


def _mark_links(entry: Entry, links: Links | Drops) -> NDArray[np.bool_]:
    """Mark the links that a fault acts on."""
    on: NDArray[np.bool_] = np.isin(links.source, entry.sources) & np.isin(links.destination, entry.targets)
    return on


def _keys(links: Links | Drops) -> NDArray[np.int64]:
    """Return a number for each link of each frame."""
    # 15 bits for the source keep the number positive; sequences beyond 32 bits are of forged frames, which are left
    # out.
    return (links.source << 48) | (links.destination << 32) | links.sequence


def mark_among(keys: NDArray[np.int64], some: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark the keys, none of them there twice, that are among some others; far faster than `isin` where keys ascend."""
    marks = np.zeros(keys.size, dtype=np.bool_)
    if keys.size:
        order = np.argsort(keys, kind="stable")
        places = order[np.minimum(np.searchsorted(keys, some, sorter=order), keys.size - 1)]
        marks[places[keys[places] == some]] = True
    return marks


def _list_ends(links: Links | Drops, of: NDArray[np.bool_]) -> set[tuple[int, int]]:
    """Return the sources and destinations of some links."""
    return set(zip(links.source[of].tolist(), links.destination[of].tolist(), strict=True))


def _by_link(rows: Sequence[Row]) -> dict[Link, list[str]]:
    """Return the faults of rows, by link."""
    faults: dict[Link, list[str]] = defaultdict(list)
    for source, to, sequence, fault in rows:
        faults[source, to, sequence].append(fault)
    return faults
