"""The verdict's checks of the radio: its faults recomputed, and the bytes that a bandwidth lets through."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.faults.kinds import Bandwidth
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import Pose
from patrol.scenario.radio_spec import MODELS
from worldsim.radio.ether import RECEIVER_DEAD, Delivery, Ether, Link, ether_of
from worldsim.radio.models import OWN_MODEL, OnAir, RadioModel, model_of
from worldsim.radio.rules import LEAST_BUCKET
from worldsim.robots.senses import Senses
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import FrameFaultCheck
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.airborne import BEFORE_THE_AIR, fates, fault_of, kind_of, origins_of

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.faults import Entry
    from worldsim.verdict.common.check import JudgedRun, Readings

ROUNDING_BYTES = 1e-6
"""A bucket that is this nearly full counts as full and as not full."""


class _Stated:
    """A radio model that loses what the journal says that the run's model has lost."""

    record: TickRecord | None = None  # the tick that it is asked about next

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        assert self.record is not None
        dropped = {row[:3] for row in self.record.dropped if row[3] == OWN_MODEL}
        frames = list(zip(air.source.tolist(), air.sequence.tolist(), strict=True))
        receivers = air.receivers.tolist()
        rows = [[(source, to, sequence) in dropped for to in receivers] for source, sequence in frames]
        return np.array(rows, dtype=np.bool_).reshape(air.on_the_way.shape)


class FatesAsRecomputed(Check):
    """A fresh ether decides the fates of the journal's frames as the journal has them, draw for draw.

    `delivery` is what the ether did in the last tick, None where that could not be recomputed.
    """

    name = "radio"
    of_ether = True
    needs = (RobotsThere,)
    reads_on = True

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        prepared, scenario = run.prepared, run.prepared.scenario
        self._names = run.senders
        self._ether: Ether | None = None
        self._unknown = ""
        self._fates = 0
        self.delivery: Delivery | None = None
        self._stated: _Stated | None = None
        try:
            senses = Senses(scenario, run.timeline, prepared.terrain)
            self._ether = ether_of(scenario, run.timeline, prepared.terrain, senses, model=self._model(prepared))
        except BadInput as bad:
            self._unknown = f"not judged: the forged frames cannot be recomputed: {bad}"

    @property
    def in_flight(self) -> Counter[Link]:
        """The frames that are still in flight after the ticks so far, by their links."""
        return Counter() if self._ether is None else self._ether.in_flight

    def _tick(self, record: TickRecord) -> None:
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
                self._fail(f"tick {record.k}: a frame of {self._names.get(source, source)}, which is not alive")
                self.delivery = None
                return
        statuses |= dict.fromkeys(self._gone(record), Status.LOST)
        poses = {row.number: Pose(row.x, row.y, row.heading) for row in record.robots if row.status.is_present}
        if self._stated is not None:
            self._stated.record = record
        self.delivery = self._ether.carry(record.k, frames, statuses, poses)
        self._fail(self._differs(record, self.delivery))
        self._fates += len(record.deliveries) + len(record.dropped)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        return self._not_judged(self._unknown) if self._unknown else super().result()

    def _good(self) -> str:
        of_model = "" if self._stated is None else ", but for what the radio model has lost, which is code of one's own"
        return f"the fates of {self._fates} frames are as recomputed{of_model}"

    def _model(self, prepared: Prepared) -> RadioModel | None:
        """Make the scenario's radio model. One that is not built in does not run in a verdict: its word is taken."""
        if prepared.scenario.radio.model in MODELS:
            return model_of(prepared.scenario, prepared.terrain)
        self._stated = _Stated()
        return self._stated

    def _gone(self, record: TickRecord) -> set[int]:
        """Return robots lost in a tick before they could hear anything; their status is LOST from the next tick on."""
        lost = {e.robot for e in self._run.journal.events if e.k == record.k + 1 and e.kind == Status.LOST.name.lower()}
        return {to for _, to, _, why in record.dropped if why == RECEIVER_DEAD and to in lost} if lost else set()

    def _differs(self, record: TickRecord, due: Delivery) -> str:
        forged = [frame for source, frame in record.frames if source == FORGED]
        if (forged, record.forged) != ([forgery.frame for forgery in due.forged], tuple(f.fault for f in due.forged)):
            return f"tick {record.k}: the forged frames are not those that the faults ask for"
        for fate, rows, expected in (
            ("delivered", record.deliveries, due.arrived),
            ("dropped", record.dropped, due.dropped),
            ("copied", record.copies, due.copies),
            ("delayed", record.delayed, due.delayed),
        ):
            if rows != expected and (difference := self._first(fate, rows, expected)):
                return f"tick {record.k}: {difference}"
        return ""

    def _first(self, fate: str, rows: Sequence[tuple[object, ...]], due: Sequence[tuple[object, ...]]) -> str:
        """Return the first difference between two rows of fates, in words; empty where there is none that matters."""
        surplus, missing = Counter(rows) - Counter(due), Counter(due) - Counter(rows)
        if not surplus and not missing:
            # Journals of 0.2 have dropped frames in other orders, which mean nothing.
            return "" if fate == "dropped" else f"the order of what was {fate} is not the recomputed one"
        (source, to, sequence, *why) = min(surplus or missing)
        link = f"frame {sequence} from {self._names.get(source, source)} to {self._names.get(to, to)}"  # type: ignore[call-overload]
        reason = f" ({why[0]})" if why else ""
        return (
            f"{link} was {fate}{reason} and should not have been"
            if surplus
            else f"{link} should have been {fate}{reason}"
        )


@dataclass(slots=True)
class _Leaky:
    """A leaky bucket of one bandwidth and sender. room: its size, bytes. least, most: bytes that may be in it."""

    room: float
    least: float = 0.0
    most: float = 0.0

    def leak(self, size: float) -> None:
        self.least, self.most = max(self.least - size, 0.0), max(self.most - size, 0.0)


class WithinBandwidth(FrameFaultCheck):
    """No robot sent more than its bandwidth, and none was stopped that had not used it up.

    Each fault and sender have a leaky bucket of one second's worth: what is sent must not make it overflow, and what is
    stopped would have. A frame that other faults stopped on every link may or may not have used up bandwidth. What a
    robot forges counts as its own.
    """

    name = "bandwidth"
    kinds = (Bandwidth,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._step = run.step
        self._buckets: dict[tuple[int, int], _Leaky] = {}
        self._bytes = 0

    def _active_tick(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        for entry in entries:
            for number in entry.who:
                self._bucket(entry, number).leak(_bytes_per_s(entry) * self._step if record.k > entry.begin else 0.0)
        whys: dict[tuple[int, int], list[str]] = defaultdict(list)
        for _, (source, _, sequence), why in fates(record, self._forgers):
            whys[source, sequence].append(why)
        origins = origins_of(record, self._forgers)
        for (key, origin), (_, frame) in zip(origins.items(), record.frames, strict=True):
            on = [entry for entry in entries if origin in entry.who]
            if on and not self._problem:
                self._sort_out(on, origin, len(frame), whys[key], record.k)

    def _good(self) -> str:
        return f"{self._bytes} bytes sent within the bandwidth"

    def _sort_out(self, on: Sequence[Entry], number: int, size: int, whys: Sequence[str], k: int) -> None:
        """Count a frame of `size` bytes by what became of it on each link."""
        jams = {fault_of(why) for why in whys if kind_of(why) == "bandwidth"}
        sent = any(kind_of(why) not in BEFORE_THE_AIR for why in whys)
        for entry in on:
            bucket = self._bucket(entry, number)
            if entry.id in jams and (sent or bucket.most + size <= bucket.room - ROUNDING_BYTES):
                self._fail(f"bandwidth {entry.id} stopped {self._names[number]} in tick {k} although it had bytes left")
            if jams:
                continue
            if sent:
                bucket.least += size
                self._bytes += size
            bucket.most = min(bucket.most + size, bucket.room)
            if bucket.least > bucket.room + ROUNDING_BYTES:
                self._fail(f"{self._names[number]} exceeded {_bytes_per_s(entry):g} bytes/s in tick {k}")

    def _bucket(self, entry: Entry, number: int) -> _Leaky:
        return self._buckets.setdefault((entry.index, number), _Leaky(max(LEAST_BUCKET, _bytes_per_s(entry))))


def _bytes_per_s(entry: Entry) -> float:
    assert isinstance(entry.fault, Bandwidth)
    return entry.fault.bytes_per_s
