"""The verdict's checks of frames that were stopped: each for a cause that applies, and all that a cut is to stop.

A frame's fate on a link is fixed when it is sent, so each tick is judged by itself, whenever its frames arrive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED, sent_at
from patrol.radio.message import MAX_FRAME
from patrol.scenario.faults.kinds import Bandwidth, Loss, Partition, Range, Silence
from worldsim.radio.ether import OVERSIZED, OWN, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.frames.airborne import NO_ROBOT, active, fates, fault_of, forgers_of, kind_of, on_link, origins_of

if TYPE_CHECKING:
    from worldsim.radio.ether import Link
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Entry, Timeline

_DEAF = {
    RECEIVER_DEAD: (Status.DEAD, Status.LOST),
    RECEIVER_PAUSED: (Status.PAUSED,),
    RECEIVER_ABSENT: (Status.ABSENT, Status.LEFT),
}
"""How a robot is that does not hear a frame when it arrives, by the cause that the journal names."""


class DropsExplained:
    """Every frame that was lost was lost for a cause that applies to it.

    A fault that is active and that its sender, or its link, has; a receiver that cannot hear; more bytes than a frame
    has; or being heard by who forged it. Whether a silence, a partition, a range or a bandwidth had reason to stop this
    very frame, their own checks say.
    """

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._journal = journal
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._entries = {entry.id: entry for entry in timeline.entries}
        self._forgers = forgers_of(timeline)
        self._problem = ""
        self._explained = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._problem or not record.dropped:
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
                self._problem = f"a frame {link} was lost in tick {record.k} for no reason: {why}"
                return
            self._explained += 1

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("drops", not self._problem, self._problem or f"{self._explained} frames lost, each for its cause")

    def _applies(self, why: str, source: int, origin: int, to: int, k: int) -> bool:
        """Whether a cause that acts when a frame is sent can befall this one."""
        if why == OWN:
            return source == FORGED and origin == to
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
        """Whether a robot died unasked in a tick, before it could hear anything."""
        lost = Status.LOST.name.lower()
        return any(e.k == k + 1 and e.robot == number and e.kind == lost for e in self._journal.events)


class NothingCrossed:
    """Silences and partitions stop the frames that they are to stop, and no others.

    The faults' ticks and groups, held against what became of each frame when it was sent: the first silence that
    applies is named, then the first partition. Of a frame that somebody forged it counts whose radio sent it.
    """

    def __init__(self, journal: RunRecord, timeline: Timeline) -> None:
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._cuts = [entry for entry in timeline.entries if isinstance(entry.fault, Silence)]
        self._cuts += [entry for entry in timeline.entries if isinstance(entry.fault, Partition)]
        self._forgers = forgers_of(timeline)
        self._problem = ""
        self._stopped = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        cuts = [entry for entry in self._cuts if active(entry, record.k)]
        if not cuts or self._problem:
            return
        for origin, link, why in fates(record, self._forgers):
            if why in (OVERSIZED, OWN):
                continue
            due = next((entry for entry in cuts if _stops(entry, origin, link[1])), None)
            cut = why if kind_of(why) in ("silence", "partition") else ""
            self._stopped += bool(cut)
            if cut != ("" if due is None else f"{due.fault.kind}:{due.id}"):
                self._wrong(link, record.k, due, cut)
                return

    def check(self) -> Check:
        """The result, once all ticks are in."""
        good = f"{self._stopped} frames were stopped, none came through"
        return Check("nothing crossed", not self._problem, self._problem or good)

    def _wrong(self, link: Link, k: int, due: Entry | None, cut: str) -> None:
        source, to, _ = link
        frame = f"a frame from {self._names.get(source, source)} to {self._names.get(to, to)} of tick {k}"
        if due is None:
            self._problem = f"{frame} was stopped by {cut.replace(':', ' ')}, which lets it through"
        else:
            instead = f" and was stopped by {cut.replace(':', ' ')}" if cut else ""
            self._problem = f"{frame} came through {due.fault.kind} {due.id}{instead}"


def _stops(entry: Entry, origin: int, to: int) -> bool:
    """Whether a silence or partition stops what a radio sends to a robot; a stranger is in no group."""
    fault = entry.fault
    if isinstance(fault, Silence):
        out = origin in entry.who and fault.direction != "in"
        return out or (to in entry.who and fault.direction != "out")
    if not isinstance(fault, Partition) or origin == NO_ROBOT:
        return False
    here = [place for place, group in enumerate(entry.groups) if origin in group]
    other = [place for place, group in enumerate(entry.groups) if to in group]
    return here != other and (fault.direction == "both" or here < other)
