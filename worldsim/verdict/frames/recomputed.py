"""The verdict's checks of the radio: the faults carried out once more, and the bytes that a bandwidth lets through."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import Pose
from patrol.scenario.faults.kinds import Bandwidth
from worldsim.radio.ether import RECEIVER_DEAD, Delivery, Ether, Link, ether_of, there
from worldsim.radio.rules import LEAST_BUCKET
from worldsim.senses import Senses
from worldsim.timeline import Entry, Timeline
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.frames.airborne import BEFORE_THE_AIR, active, fates, fault_of, forgers_of, kind_of, origins_of

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord

ROUNDING_BYTES = 1e-6
"""A bucket that is so nearly full counts as either."""


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


@dataclass(slots=True)
class _Leaky:
    """A leaky bucket of one bandwidth and sender. least, most: bytes that may be in it."""

    room: float
    least: float = 0.0
    most: float = 0.0

    def leak(self, size: float) -> None:
        self.least, self.most = max(self.least - size, 0.0), max(self.most - size, 0.0)


class WithinBandwidth:
    """Nobody sent more than its bandwidth, and nobody was stopped who had not used it up.

    A leaky bucket for each fault and sender, of one second's worth: what is sent must not make it run over, and what is
    stopped would have. What was stopped on every link before it came to that may or may not have been sent. What a
    robot forges counts as its own.
    """

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._names = names_of(journal)
        self._step = float(journal.header.scenario["step"])
        self._limits = [entry for entry in timeline.entries if isinstance(entry.fault, Bandwidth)]
        self._forgers = forgers_of(timeline)
        self._buckets: dict[tuple[int, int], _Leaky] = {}
        self._problem = ""
        self._bytes = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        limits = [entry for entry in self._limits if active(entry, record.k)]
        if not limits or self._problem:
            return
        for entry in limits:
            for number in entry.who:
                self._bucket(entry, number).leak(_bytes_per_s(entry) * self._step if record.k > entry.begin else 0.0)
        whys: dict[tuple[int, int], list[str]] = defaultdict(list)
        for _, (source, _, sequence), why in fates(record, self._forgers):
            whys[source, sequence].append(why)
        origins = origins_of(record, self._forgers)
        for (key, origin), (_, frame) in zip(origins.items(), record.frames, strict=True):
            on = [entry for entry in limits if origin in entry.who]
            if on and not self._problem:
                self._frame(on, origin, len(frame), whys[key], record.k)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("bandwidth", not self._problem, self._problem or f"{self._bytes} bytes sent within it")

    def _frame(self, on: Sequence[Entry], number: int, size: int, whys: Sequence[str], k: int) -> None:
        """A frame of so many bytes, and what became of it on each link."""
        jams = {fault_of(why) for why in whys if kind_of(why) == "bandwidth"}
        sent = any(kind_of(why) not in BEFORE_THE_AIR for why in whys)
        for entry in on:
            bucket = self._bucket(entry, number)
            if entry.id in jams and (sent or bucket.most + size <= bucket.room - ROUNDING_BYTES):
                self._problem = f"{self._names[number]} was stopped by bandwidth {entry.id} in tick {k} and had room"
            if jams:
                continue
            if sent:
                bucket.least += size
                self._bytes += size
            bucket.most = min(bucket.most + size, bucket.room)
            if bucket.least > bucket.room + ROUNDING_BYTES:
                limit = _bytes_per_s(entry)
                self._problem = f"{self._names[number]} sent more than {limit:g} bytes/s allow in tick {k}"

    def _bucket(self, entry: Entry, number: int) -> _Leaky:
        return self._buckets.setdefault((entry.index, number), _Leaky(max(LEAST_BUCKET, _bytes_per_s(entry))))


def _bytes_per_s(entry: Entry) -> float:
    assert isinstance(entry.fault, Bandwidth)
    return entry.fault.bytes_per_s
