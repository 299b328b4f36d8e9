"""The verdict's checks of the radio: what the faults did to frames, recomputed and looked at from several sides."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.faults import Bandwidth, Loss, Partition, Silence
from patrol.journal import Status, TickRecord
from patrol.pose import Pose
from patrol.records import FORGED, frame_sequence, sent_at
from worldsim.chance import FAMILY, enough, unexplained
from worldsim.checks import Check, Tally, names_of
from worldsim.ether import OVERSIZED, OWN, RECEIVER_DEAD, Delivery, Ether, Link, ether_of, there
from worldsim.radio_rules import LEAST_BUCKET, chain_of
from worldsim.senses import Senses
from worldsim.timeline import Entry, Timeline

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.record import RunRecord

_BEFORE_THE_AIR = ("silence", "partition", "range", "bandwidth", OVERSIZED, OWN)
"""Why a frame is dropped before it can be lost on its way."""


class Replay:
    """What a fresh ether does with the journal's frames is what the journal says, draw for draw.

    delivery: of the tick that came last, None where it could not be recomputed.
    """

    def __init__(self, journal: RunRecord, prepared: Prepared, timeline: Timeline) -> None:
        scenario = prepared.scenario
        self._journal = journal
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._ether: Ether | None = None
        self._problem = self._unknown = ""
        self._fates = 0
        self.delivery: Delivery | None = None
        try:
            senses = Senses(scenario, timeline, prepared.terrain)
            self._ether = ether_of(scenario, timeline, prepared.terrain, senses)
        except BadInput as bad:
            self._unknown = f"forged frames cannot be made anew: {bad}"

    @property
    def in_flight(self) -> Counter[Link]:
        """What is still on its way after the ticks so far."""
        return Counter() if self._ether is None else self._ether.in_flight

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._ether is None or self._problem:
            self.delivery = None
            return
        frames: dict[int, list[bytes]] = defaultdict(list)
        for source, frame in record.frames:
            if source != FORGED:
                frames[source].append(frame)
        statuses = {row.number: row.status for row in record.robots}
        for source in frames:
            if statuses.get(source) is not Status.ALIVE:
                self._problem = f"tick {record.k}: a frame of {self._names.get(source, source)}, which is not alive"
                self.delivery = None
                return
        statuses |= dict.fromkeys(self._gone(record), Status.LOST)
        poses = {row.number: Pose(row.x, row.y, row.heading) for row in record.robots if there(row.status)}
        self.delivery = self._ether.carry(record.k, frames, statuses, poses)
        self._problem = self._differs(record, self.delivery)
        self._fates += len(record.deliveries) + len(record.dropped)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        if self._unknown:
            return Check("radio", True, self._unknown, judged=False)
        return Check("radio", not self._problem, self._problem or f"{self._fates} frames fared as recomputed")

    def _gone(self, record: TickRecord) -> set[int]:
        """Who died unasked before it could hear anything in a tick: it counts as lost from the next tick on."""
        lost = {e.robot for e in self._journal.events if e.k == record.k + 1 and e.kind == Status.LOST.name.lower()}
        return {to for _, to, _, why in record.dropped if why == RECEIVER_DEAD and to in lost} if lost else set()

    def _differs(self, record: TickRecord, due: Delivery) -> str:
        forged = [frame for source, frame in record.frames if source == FORGED]
        if forged != [one.frame for one in due.forged] or record.forged != tuple(one.fault for one in due.forged):
            return f"tick {record.k}: the forged frames are not those that the faults ask for"
        for what, found, expected in (
            ("delivered", record.deliveries, due.arrived),
            ("dropped", record.dropped, due.dropped),
            ("copied", record.copies, due.copies),
            ("delayed", record.delayed, due.delayed),
        ):
            if found != expected:
                return f"tick {record.k}: {self._first(what, found, expected)}"
        return ""

    def _first(self, what: str, found: Sequence[tuple[object, ...]], due: Sequence[tuple[object, ...]]) -> str:
        """The first difference between two rows of fates, in words."""
        surplus, missing = Counter(found) - Counter(due), Counter(due) - Counter(found)
        if not surplus and not missing:
            return f"what was {what} is in another order than recomputed"
        (source, to, sequence, *why) = min(surplus or missing)
        link = f"frame {sequence} from {self._names.get(source, source)} to {self._names.get(to, to)}"  # type: ignore[call-overload]
        reason = f" ({why[0]})" if why else ""
        return f"{link} was {what}{reason} and should not be" if surplus else f"{link} should be {what}{reason}"


def radio_checks(journal: RunRecord, timeline: Timeline) -> list[Tally]:
    """The checks besides the replay that a scenario's faults call for."""
    kinds = {entry.fault.kind for entry in timeline.entries}
    checks: list[Tally] = []
    if kinds & {"silence", "partition"}:
        checks.append(NothingCrossed(journal, timeline))
    if "bandwidth" in kinds:
        checks.append(WithinBandwidth(journal, timeline))
    if "loss" in kinds:
        checks.append(LossesAsAsked(timeline))
    return checks


class NothingCrossed:
    """No frame came through a silence or a partition: the faults' ticks and groups, held against what was delivered."""

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._cuts = [entry for entry in timeline.entries if isinstance(entry.fault, Silence | Partition)]
        self._problem = ""
        self._tried = 0
        self._stopped = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        self._stopped += sum(why.startswith(("silence:", "partition:")) for *_, why in record.dropped)
        for source, destination, sequence in () if self._problem else record.deliveries:
            k = sent_at(sequence)
            for entry in self._cuts:
                begun = k >= entry.begin and (entry.end is None or k < entry.end)
                if begun and _stops(entry, source, destination):
                    link = f"from {self._names.get(source, source)} to {self._names.get(destination, destination)}"
                    self._problem = f"a frame {link} of tick {k} came through {entry.fault.kind} {entry.id}"

    def check(self) -> Check:
        """The result, once all ticks are in."""
        good = f"{self._stopped} frames were stopped, none came through"
        return Check("nothing crossed", not self._problem, self._problem or good)


class WithinBandwidth:
    """Nobody sent more than its bandwidth: at no time more bytes than flow in since, and one second's worth.

    A leaky bucket for each fault and sender, which must not run over. Only what got as far as the air counts.
    """

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._names = names_of(journal)
        self._step = float(journal.header.scenario["step"])
        self._limits = [entry for entry in timeline.entries if isinstance(entry.fault, Bandwidth)]
        self._level: dict[tuple[int, int], float] = defaultdict(float)
        self._problem = ""
        self._bytes = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        active = [e for e in self._limits if record.k >= e.begin and (e.end is None or record.k < e.end)]
        if not active or self._problem:
            return
        sent = self._sent(record)
        for entry in active:
            assert isinstance(entry.fault, Bandwidth)
            limit = entry.fault.bytes_per_s
            for number in entry.who:
                key = (entry.index, number)
                left = self._level[key] - (limit * self._step if record.k > entry.begin else 0.0)
                self._level[key] = max(left, 0.0) + sent[number]
                self._bytes += sent[number]
                if self._level[key] > max(LEAST_BUCKET, limit) + 1e-6:
                    self._problem = f"{self._names[number]} sent more than {limit:g} bytes/s allow in tick {record.k}"

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("bandwidth", not self._problem, self._problem or f"{self._bytes} bytes sent within it")

    def _sent(self, record: TickRecord) -> Counter[int]:
        """The bytes that each robot got as far as the air, for at least one receiver."""
        there_are = sum(there(row.status) for row in record.robots)
        held = Counter((s, q) for s, _, q, why in record.dropped if kind_of(why) in _BEFORE_THE_AIR)
        sent: Counter[int] = Counter()
        places: Counter[int] = Counter()
        for source, frame in record.frames:
            sequence = frame_sequence(record.k, places[source])
            places[source] += 1
            if source != FORGED and held[source, sequence] < there_are - 1:
                sent[source] += len(frame)
        return sent


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
    """Frames are lost as often as the faults say, and in bursts as long, as far as chance goes (`worldsim.chance`).

    A fault without bursts is one series of draws, one for each frame that got as far as it. A fault with bursts is two,
    from one tick to the next on the same link: from good to bad, and from bad to good.
    """

    def __init__(self, timeline: Timeline) -> None:
        self._faults: dict[int, _Losses] = {}
        for entry in timeline.entries:
            if isinstance(entry.fault, Loss):
                self._faults[entry.index] = _Losses(entry, _counts(entry.fault))
        self._index = {entry.id: entry.index for entry in timeline.entries}
        tests = sum(len(losses.counts) for losses in self._faults.values())
        self._alarm = FAMILY / max(tests, 1)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        active = [
            losses
            for losses in self._faults.values()
            if record.k >= losses.entry.begin and (losses.entry.end is None or record.k < losses.entry.end)
        ]
        if not active:
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
                    self._frame(active, record.k, (source, to), cause, first=places[source] == 1)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        said, wrong, judged = [], [], False
        for losses in self._faults.values():
            share = (
                f"{100.0 * losses.lost / losses.frames:.1f} % of {losses.frames} frames lost" if losses.frames else ""
            )
            for count in losses.counts:
                if not enough(count.draws, count.p, self._alarm):
                    continue
                judged = True
                if unexplained(count.hits, count.draws, count.p, self._alarm):
                    found = f"{count.hits} of {count.draws} {count.what}, {100.0 * count.p:.4g} % asked for"
                    wrong.append(f"{losses.entry.id}: {found}")
            said.append(f"{losses.entry.id}: {share or 'no frames'}")
        if wrong:
            return Check("losses", False, "; ".join(wrong))
        return Check("losses", True, "; ".join(said) + ("" if judged else "; too few to judge"), judged=judged)

    def _frame(self, active: Sequence[_Losses], k: int, link: tuple[int, int], cause: str, *, first: bool) -> None:
        """One frame on one link; the faults before the one that lost it let it through, those after never had it."""
        kind = kind_of(cause)
        if kind in _BEFORE_THE_AIR:
            return
        last = self._index.get(fault_of(cause), math.inf) if kind == "loss" else math.inf
        for losses in active:
            index = losses.entry.index
            if index > last or link[0] not in losses.entry.sources or link[1] not in losses.entry.targets:
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
        if before is not None and before[0] == k - 1:
            count = losses.counts[1 if before[1] else 0]
            count.draws += 1
            count.hits += bad != before[1]


def _counts(fault: Loss) -> list[_Count]:
    if fault.mean_burst is None:
        return [_Count("frames were lost", fault.rate)]
    recovers, fails = chain_of(fault.rate, fault.mean_burst)
    return [_Count("good ticks turned bad", fails), _Count("bad ticks turned good", recovers)]


def _stops(entry: Entry, source: int, destination: int) -> bool:
    """Whether a silence or partition stops frames on a link. Of a forger only its receiver is known here."""
    fault = entry.fault
    if isinstance(fault, Silence):
        out = source in entry.who and fault.direction != "in"
        return out or (destination in entry.who and fault.direction != "out")
    if not isinstance(fault, Partition) or source == FORGED:
        return False
    here = [place for place, group in enumerate(entry.groups) if source in group]
    other = [place for place, group in enumerate(entry.groups) if destination in group]
    return here != other and (fault.direction == "both" or here < other)


def kind_of(cause: str) -> str:
    """The kind of what dropped a frame, from the journal's words."""
    return cause.partition(":")[0]


def fault_of(cause: str) -> str:
    """The id of the fault that dropped a frame, empty where none did."""
    return cause.partition(":")[2]
