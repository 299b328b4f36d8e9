"""The fate of each frame on each link, read from a journal's records, and the checks of frames that were dropped.

Of the code that carries frames this uses names only (causes, the order of faults, which statuses are addressed), so an
error there cannot confirm itself. A frame's fate on a link is fixed when it is sent, except that it is lost where it
arrives at a robot that cannot hear.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import Bandwidth, Fault, Loss, Partition, Range, Silence
from patrol.journal import Status
from patrol.journal.links import Drops, Links, Pairs, WholeLinks, drops_of, joined, links_of, pairs_of
from patrol.journal.records import FORGED, MAX_TICKS, frame_sequence
from patrol.radio.message import MAX_FRAME
from patrol.scenario.radio_spec import IDEAL
from worldsim.checks.check import NO_ROBOT, Check, active
from worldsim.radio.ether import OVERSIZED, OWN, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED, Link
from worldsim.radio.models import cause_of
from worldsim.radio.rules import DROPS, LEAST_BUCKET

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry

_DEAF = {
    RECEIVER_DEAD: (Status.DEAD, Status.LOST),
    RECEIVER_PAUSED: (Status.PAUSED,),
    RECEIVER_ABSENT: (Status.ABSENT, Status.LEFT),
}
"""The statuses of robots that hear no arriving frame, by the cause that the journal names.

All other causes apply when a frame is sent.
"""

ROUNDING_BYTES = 1e-6
"""A bucket that is this nearly full counts as full and as not full."""


def causes_before(kind: type[Fault]) -> frozenset[str]:
    """Return the causes, and kinds of faults, that may drop a frame before a fault of some kind has its turn."""
    earlier = DROPS[: DROPS.index(kind)]
    return frozenset(
        {OVERSIZED, OWN, *(get_args(fault_class.model_fields["kind"].annotation)[0] for fault_class in earlier)}
    )


BEFORE_THE_AIR = causes_before(Loss)
"""Causes that drop a frame before it can be lost on its way."""


def _list_sequences(record: TickRecord) -> Iterator[tuple[int, int, int]]:
    """Yield the source and the sequence of each frame of a tick, and its place among those of its source.

    For example, in tick 7 a robot's position and contact give (1, 7, 0) and (1, 536870919, 1).
    """
    places: Counter[int] = Counter()
    for source, _ in record.frames:
        yield source, frame_sequence(record.k, places[source]), places[source]
        places[source] += 1


def origins_of(record: TickRecord, forgers: Mapping[str, int]) -> dict[tuple[int, int], int]:
    """Return the robot whose radio sends each frame of a tick, by (source, sequence), in frame order.

    It is `NO_ROBOT` for a stranger. `forgers` are as in `JudgedRun`.
    """
    forged = dict(enumerate(record.forged))
    return {
        (source, sequence): forgers.get(forged.get(index, ""), NO_ROBOT) if source == FORGED else source
        for source, sequence, index in _list_sequences(record)
    }


def fates(record: TickRecord, forgers: Mapping[str, int]) -> Iterator[tuple[int, Link, str]]:
    """Yield every frame of a tick on every link: the robot whose radio sent it, the link, the cause that stopped it.

    The last is empty where nothing stopped the frame when it was sent, so that it arrives, sooner or later.
    """
    here = [row.number for row in record.robots if row.status.is_present]
    causes = {drop[:3]: drop[3] for drop in record.dropped if drop[3] not in _DEAF}
    for (source, sequence), origin in origins_of(record, forgers).items():
        for to in here:
            if to != source:
                link = (source, to, sequence)
                yield origin, link, causes.get(link, "")


def airborne(record: TickRecord, forgers: Mapping[str, int]) -> Iterator[tuple[int, Link]]:
    """Return those of the `fates` that nothing stopped when they were sent, so that they arrive, sooner or later."""
    return ((origin, link) for origin, link, why in fates(record, forgers) if not why)


def arrived(record: TickRecord) -> Links:
    """Return the links of a tick's arriving frames, once for each copy, whether or not the receiver could hear."""
    delivered, dropped = links_of(record.deliveries), drops_of(record.dropped)
    unheard = np.isin(dropped.cause, [number for number, why in enumerate(dropped.causes) if why in _DEAF])
    if not unheard.any():
        return delivered
    return joined(delivered, Links(dropped.source[unheard], dropped.destination[unheard], dropped.sequence[unheard]))


def sent_links(record: TickRecord) -> WholeLinks:
    """Return the link of every frame of a tick to every robot that is there, by frame and receiver."""
    here = tuple([row.number for row in record.robots if row.status.is_present])
    pairs = _pair_frames(tuple([source for source, _ in record.frames]), here)
    return WholeLinks(pairs, np.array([sequence for _, sequence, _ in _list_sequences(record)], dtype=np.int64))


@lru_cache(maxsize=2)
def _pair_frames(sources: tuple[int, ...], here: tuple[int, ...]) -> Pairs:
    """Pair each frame with each robot that is there but its sender.

    The ether has code of its own for this, so that an error in it does not confirm itself.
    """
    of, to = np.array(sources, dtype=np.int64), np.array(here, dtype=np.int64)
    frame, receiver = np.nonzero(of[:, None] != to[None, :])
    return pairs_of(frame, of[frame], to[receiver])


def kind_of(cause: str) -> str:
    """Return the kind of fault that dropped a frame, from the cause that the journal names.

    For example, "loss" of "loss:f1".
    """
    return cause.partition(":")[0]


def fault_of(cause: str) -> str:
    """Return the id of the fault that dropped a frame, empty where none did.

    For example, "f1" of "loss:f1".
    """
    return cause.partition(":")[2]


class DropsExplained(Check):
    """Every frame that was dropped was dropped for a cause that applies to it.

    That is a fault that is active and acts on its sender or its link; a receiver that cannot hear; a frame that is too
    long; a receiver that forged it; or the radio model. Whether a silence, a partition, a range, a bandwidth or the
    model `path-loss` had reason to stop this very frame is judged by their own checks.
    """

    name = "drops"
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._by_id = {entry.id: entry for entry in run.timeline.entries}
        model = run.prepared.scenario.radio.model
        self._of_model = "" if model == IDEAL else cause_of(model)
        self._explained = 0

    def _tick(self, record: TickRecord) -> None:
        if not record.dropped:
            return
        dropped = drops_of(record.dropped)
        now = dropped.sequence % (MAX_TICKS + 1) == record.k
        sent = origins_of(record, self._run.forgers)
        origins = _find_origins(dropped, sent, record.k)
        right = np.zeros(len(dropped), dtype=np.bool_)
        for number in np.unique(dropped.cause).tolist():
            why = dropped.causes[number]
            if why in _DEAF:
                deaf = {row.number for row in record.robots if row.status in _DEAF[why]}
                deaf |= self._run.lost_in(record.k) if why == RECEIVER_DEAD else set()
                applies = np.isin(dropped.destination, list(deaf))
            elif why == OVERSIZED:
                long = {key for key, (_, frame) in zip(sent, record.frames, strict=True) if len(frame) > MAX_FRAME}
                applies = now & np.array([(source, sequence) in long for source, _, sequence, _ in dropped])
            else:
                applies = now & self._mark_dropped(why, origins, dropped, record.k)
            # Cause by cause: a tick has many drops and few causes.
            right |= (dropped.cause == number) & applies
        if not right.all():
            source, to, sequence, why = dropped[int(right.argmin())]
            way = self._way((source, to, sequence))
            self._fail(f"a frame {way} was dropped in tick {record.k} for a cause that does not apply: {why}")
        self._explained += len(dropped)

    def _end(self) -> str:
        return f"{self._explained} frames dropped, each for a cause that applies"

    def _mark_dropped(self, why: str, origins: NDArray[np.int64], dropped: Drops, k: int) -> NDArray[np.bool_]:
        """Mark the dropped frames on which a cause can act when they are sent."""
        to, every = dropped.destination, np.ones(len(dropped), dtype=np.bool_)
        if why == OWN:
            is_own: NDArray[np.bool_] = (dropped.source == FORGED) & (origins == to)
            return is_own
        if why == self._of_model:
            return every
        entry = self._by_id.get(fault_of(why))
        if entry is None or entry.fault.kind != kind_of(why) or not active(entry, k):
            return ~every
        match entry.fault:
            case Loss():
                return np.isin(origins, entry.sources) & np.isin(to, entry.targets)
            case Range() | Bandwidth():
                return np.isin(origins, entry.who)
        return every if isinstance(entry.fault, Silence | Partition) else ~every


def _find_origins(dropped: Drops, sent: Mapping[tuple[int, int], int], k: int) -> NDArray[np.int64]:
    """Return the robot whose radio sent each dropped frame; `NO_ROBOT` also where none was sent."""
    # A position has its tick as sequence; only the few contacts and forgeries are looked up one by one.
    positions = [source for source, sequence in sent if source != FORGED and sequence == k]
    is_position = (dropped.sequence == k) & np.isin(dropped.source, positions)
    origins = np.where(is_position, dropped.source, NO_ROBOT)
    for row in np.flatnonzero(~is_position):
        # A drop of a frame that was never sent has no origin and is caught by its cause.
        origins[row] = sent.get((int(dropped.source[row]), int(dropped.sequence[row])), NO_ROBOT)
    return origins


class NothingCrossed(Check):
    """Silences and partitions stop the frames that they should stop, and no others.

    The faults' ticks and groups are compared with the fate of each frame when it was sent: the first silence that
    applies is named, then the first partition. A forged frame counts as sent by the robot whose radio sent it.
    """

    name = "nothing crossed"
    kinds = (Silence, Partition)
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._stopped = 0

    def _tick(self, record: TickRecord) -> None:
        # A silence is named before a partition, as in the order of faults.
        cuts = sorted(self._active(record.k), key=lambda entry: isinstance(entry.fault, Partition))
        for origin, link, why in fates(record, self._run.forgers) if cuts else ():
            if why in (OVERSIZED, OWN):
                continue
            stopper = next((entry for entry in cuts if _is_stopped(entry, origin, link[1])), None)
            cut = why if kind_of(why) in ("silence", "partition") else ""
            self._stopped += bool(cut)
            if cut == ("" if stopper is None else f"{stopper.fault.kind}:{stopper.id}"):
                continue
            by = cut.replace(":", " ")
            problem = f"was stopped by {by}, which does not apply to it"
            if stopper is not None:
                problem = f"got through {stopper.fault.kind} {stopper.id}" + (
                    f" and was stopped by {by}" if cut else ""
                )
            self._fail(f"a frame {self._way(link)} of tick {record.k} {problem}")
            return

    def _end(self) -> str:
        return f"{self._stopped} frames were stopped, none got through"


def _is_stopped(entry: Entry, origin: int, to: int) -> bool:
    """Return True if a silence or partition stops the frames of a radio to a robot; a stranger is in no group."""
    fault = entry.fault
    if isinstance(fault, Silence):
        muted = origin in entry.who and fault.direction != "in"
        return muted or (to in entry.who and fault.direction != "out")
    if not isinstance(fault, Partition) or origin == NO_ROBOT:
        return False
    here = [index for index, group in enumerate(entry.groups) if origin in group]
    target_groups = [index for index, group in enumerate(entry.groups) if to in group]
    return here != target_groups and (fault.direction == "both" or here < target_groups)


@dataclass(slots=True)
class _Leaky:
    """A leaky bucket of one bandwidth and sender."""

    per_s: float  # bytes that leak out
    least: float = 0.0  # bytes that are in it at least, where some frames may not have counted
    most: float = 0.0

    @property
    def room(self) -> float:
        """Its size, bytes."""
        return max(LEAST_BUCKET, self.per_s)

    def leak(self, step: float) -> None:
        """Let time pass, s.

        For example, of 50 bytes at 20 bytes/s 40 are left after 0.5 s.
        """
        self.least, self.most = (max(level - self.per_s * step, 0.0) for level in (self.least, self.most))


class WithinBandwidth(Check):
    """No robot sent more than its bandwidth, and none was stopped that had not used it up.

    Each fault and sender have a leaky bucket of one second's worth: what is sent must not make it overflow, and what is
    stopped would have. A frame that other faults stopped on every link may or may not have used up bandwidth. What a
    robot forges counts as its own.
    """

    name = "bandwidth"
    kinds = (Bandwidth,)
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._buckets = {
            (entry.index, number): _Leaky(entry.fault.bytes_per_s)
            for entry in self._entries
            if isinstance(entry.fault, Bandwidth)
            for number in entry.who
        }
        self._bytes = 0

    def _tick(self, record: TickRecord) -> None:
        entries = self._active(record.k)
        if not entries:
            return
        for entry in entries:
            # In its fault's first tick a bucket is still empty.
            for number in entry.who if record.k > entry.begin else ():
                self._buckets[entry.index, number].leak(self._step)
        whys: dict[tuple[int, int], list[str]] = defaultdict(list)
        for _, (source, _, sequence), why in fates(record, self._run.forgers):
            whys[source, sequence].append(why)
        origins = origins_of(record, self._run.forgers)
        for (key, origin), (_, frame) in zip(origins.items(), record.frames, strict=True):
            on = [entry for entry in entries if origin in entry.who]
            if on and not self._problem:
                self._sort_out(on, origin, len(frame), whys[key], record.k)

    def _end(self) -> str:
        return f"{self._bytes} bytes sent within the bandwidth"

    def _sort_out(self, on: Sequence[Entry], number: int, size: int, whys: Sequence[str], k: int) -> None:
        """Count a frame of `size` bytes by its fate on each link."""
        jams = {fault_of(why) for why in whys if kind_of(why) == "bandwidth"}
        sent = any(kind_of(why) not in BEFORE_THE_AIR for why in whys)
        for entry in on:
            bucket = self._buckets[entry.index, number]
            if entry.id in jams and (sent or bucket.most + size <= bucket.room - ROUNDING_BYTES):
                self._fail(f"bandwidth {entry.id} stopped {self._name(number)} in tick {k} although it had bytes left")
            # A frame that one bandwidth stopped uses up no other.
            if jams:
                continue
            if sent:
                bucket.least += size
                self._bytes += size
            # It may have counted, even if other faults stopped it on every link.
            # More than the bucket holds cannot have been sent.
            bucket.most = min(bucket.most + size, bucket.room)
            if bucket.least > bucket.room + ROUNDING_BYTES:
                self._fail(f"{self._name(number)} exceeded {bucket.per_s:g} bytes/s in tick {k}")
