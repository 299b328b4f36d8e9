"""The verdict's checks of the radio: the faults carried out once more, and what must not come through them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.faults import Bandwidth, Partition, Silence
from patrol.journal import Status, TickRecord
from patrol.pose import Pose
from patrol.records import FORGED, frame_sequence, sent_at
from worldsim.airborne import BEFORE_THE_AIR, active, kind_of
from worldsim.checks import Check, names_of
from worldsim.ether import RECEIVER_DEAD, Delivery, Ether, Link, ether_of, there
from worldsim.radio_rules import LEAST_BUCKET
from worldsim.senses import Senses
from worldsim.timeline import Entry, Timeline

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.record import RunRecord


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
                if active(entry, k) and _stops(entry, source, destination):
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
        limits = [entry for entry in self._limits if active(entry, record.k)]
        if not limits or self._problem:
            return
        sent = self._sent(record)
        for entry in limits:
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
        held = Counter((s, q) for s, _, q, why in record.dropped if kind_of(why) in BEFORE_THE_AIR)
        sent: Counter[int] = Counter()
        places: Counter[int] = Counter()
        for source, frame in record.frames:
            sequence = frame_sequence(record.k, places[source])
            places[source] += 1
            if source != FORGED and held[source, sequence] < there_are - 1:
                sent[source] += len(frame)
        return sent


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
