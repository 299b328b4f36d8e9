"""The verdict's checks of frames that were dropped: each for a cause that applies, and all that a cut should stop.

A frame's fate on a link is fixed when it is sent, so each tick is judged by itself, whenever its frames arrive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from patrol.faults.kinds import Bandwidth, Loss, Partition, Range, Silence
from patrol.journal import Status, TickRecord
from patrol.journal.links import drops_of
from patrol.journal.records import FORGED, MAX_TICKS, sent_at
from patrol.radio.message import MAX_FRAME
from patrol.scenario.radio_spec import IDEAL
from worldsim.radio.ether import OVERSIZED, OWN, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED
from worldsim.radio.models import cause_of
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.faults import NO_ROBOT, FrameFaultCheck, active, forgers_of, on_link
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.airborne import fates, fault_of, kind_of, name_of, origins_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from worldsim.faults import Entry
    from worldsim.radio.ether import Link
    from worldsim.verdict.common.check import JudgedRun, Readings

_DEAF = {
    RECEIVER_DEAD: (Status.DEAD, Status.LOST),
    RECEIVER_PAUSED: (Status.PAUSED,),
    RECEIVER_ABSENT: (Status.ABSENT, Status.LEFT),
}
"""The statuses of robots that hear no arriving frame, by the cause that the journal names."""


class DropsExplained(Check):
    """Every frame that was dropped was dropped for a cause that applies to it.

    That is a fault that is active and acts on its sender or its link; a receiver that cannot hear; a frame that is too
    long; a receiver that forged it; or the radio model. Whether a silence, a partition, a range, a bandwidth or the
    model `path-loss` had reason to stop this very frame is judged by their own checks.
    """

    name = "drops"
    of_ether = True
    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.senders
        self._entries = {entry.id: entry for entry in run.timeline.entries}
        self._forgers = forgers_of(run.timeline)
        model = run.prepared.scenario.radio.model
        self._of_model = "" if model == IDEAL else cause_of(model)
        self._explained = 0

    def _tick(self, record: TickRecord) -> None:
        if not record.dropped:
            return
        if (lost := self._lost_on_links(record)) is not None:
            self._explained += lost
            return
        origins = origins_of(record, self._forgers)
        lengths = {key: len(frame) for key, (_, frame) in zip(origins, record.frames, strict=True)}
        statuses = {row.number: row.status for row in record.robots}
        for source, to, sequence, why in record.dropped:
            if why in _DEAF:
                right = statuses.get(to) in _DEAF[why] or (why == RECEIVER_DEAD and self._dies(to, record.k))
            elif sent_at(sequence) != record.k:
                right = False
            elif why == OVERSIZED:
                right = lengths.get((source, sequence), 0) > MAX_FRAME
            else:
                right = self._applies(why, source, origins.get((source, sequence), NO_ROBOT), to, record.k)
            if not right:
                link = f"from {self._names.get(source, source)} to {self._names.get(to, to)}"
                self._fail(f"a frame {link} was dropped in tick {record.k} for a cause that does not apply: {why}")
                return
            self._explained += 1

    def _good(self) -> str:
        return f"{self._explained} frames dropped, each for a cause that applies"

    def _lost_on_links(self, record: TickRecord) -> int | None:
        """Count dropped frames, if losses that act on their links dropped all of them; else return None."""
        dropped = drops_of(record.dropped)
        if (dropped.source == FORGED).any() or (dropped.sequence % (MAX_TICKS + 1) != record.k).any():
            return None
        for number, why in enumerate(dropped.causes):
            of = dropped.cause == number
            if not of.any():
                continue
            entry = self._entries.get(fault_of(why))
            if entry is None or not isinstance(entry.fault, Loss) or kind_of(why) != "loss":
                return None
            ends = ((dropped.source, entry.sources), (dropped.destination, entry.targets))
            if not (active(entry, record.k) and all(np.isin(end[of], sorted(robots)).all() for end, robots in ends)):
                return None
        senders = {source for source, _ in record.frames}
        return len(dropped) if senders.issuperset(np.unique(dropped.source).tolist()) else None

    def _applies(self, why: str, source: int, origin: int, to: int, k: int) -> bool:
        """Return True if a cause that acts when a frame is sent can act on this one."""
        if why == OWN:
            return source == FORGED and origin == to
        if why == self._of_model:
            return True
        entry = self._entries.get(fault_of(why))
        if entry is None or entry.fault.kind != kind_of(why) or not active(entry, k):
            return False
        match entry.fault:
            case Loss():
                return on_link(entry, origin, to)
            case Range() | Bandwidth():
                return origin in entry.who
        return isinstance(entry.fault, Silence | Partition)

    def _dies(self, number: int, k: int) -> bool:
        """Return True if a robot was lost in a tick, before it could hear anything."""
        kind = Status.LOST.name.lower()
        return any(e.k == k + 1 and e.robot == number and e.kind == kind for e in self._run.journal.events)


class NothingCrossed(FrameFaultCheck):
    """Silences and partitions stop the frames that they should stop, and no others.

    The faults' ticks and groups are compared with what became of each frame when it was sent: the first silence that
    applies is named, then the first partition. A forged frame counts as sent by the robot whose radio sent it.
    """

    name = "nothing crossed"
    kinds = (Silence, Partition)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._stopped = 0
        self._cuts = frozenset(name_of(kind) for kind in self.kinds)

    def _active_tick(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        cuts = sorted(entries, key=lambda entry: isinstance(entry.fault, Partition))
        for origin, link, why in fates(record, self._forgers):
            if why in (OVERSIZED, OWN):
                continue
            due = next((entry for entry in cuts if _stops(entry, origin, link[1])), None)
            cut = why if kind_of(why) in self._cuts else ""
            self._stopped += bool(cut)
            if cut != ("" if due is None else f"{due.fault.kind}:{due.id}"):
                self._wrong(link, record.k, due, cut)
                return

    def _good(self) -> str:
        return f"{self._stopped} frames were stopped, none got through"

    def _wrong(self, link: Link, k: int, due: Entry | None, cut: str) -> None:
        frame = self._frame(link, k)
        if due is None:
            self._fail(f"{frame} was stopped by {cut.replace(':', ' ')}, which does not apply to it")
        else:
            instead = f" and was stopped by {cut.replace(':', ' ')}" if cut else ""
            self._fail(f"{frame} got through {due.fault.kind} {due.id}{instead}")


def _stops(entry: Entry, origin: int, to: int) -> bool:
    """Return True if a silence or partition stops what a radio sends to a robot; a stranger is in no group."""
    fault = entry.fault
    if isinstance(fault, Silence):
        muted = origin in entry.who and fault.direction != "in"
        return muted or (to in entry.who and fault.direction != "out")
    if not isinstance(fault, Partition) or origin == NO_ROBOT:
        return False
    here = [place for place, group in enumerate(entry.groups) if origin in group]
    other = [place for place, group in enumerate(entry.groups) if to in group]
    return here != other and (fault.direction == "both" or here < other)
