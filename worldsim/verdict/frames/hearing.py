"""The verdict's checks of what robots made of what they heard: which frames they refused, and forged ones above all."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED, frame_sequence
from patrol.radio.fleet_key import fleet_key
from patrol.radio.inbox import Inbox, inbox_of
from patrol.radio.message import CONTACT, Position
from patrol.scenario.faults.kinds import Forgery, Spoof
from worldsim.radio.rules import NOBODY
from worldsim.verdict.checks import Check, names_of

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Timeline
    from worldsim.verdict.frames.recomputed import Replay

_GONE = tuple(status.name.lower() for status in (Status.DEAD, Status.LEFT, Status.LOST, Status.ABSENT))


@dataclass(frozen=True, slots=True)
class Belief:
    """A forged frame that a robot believed. again: it had believed one of that robot's with that sequence before."""

    receiver: int
    sequence: int
    position: Position
    again: bool


class Hearing:
    """What each robot's inbox makes of what the ether brings it, as the replay has it; one inbox for each process.

    Robots count what they refuse. In one process that is what fresh inboxes refuse. A robot that is a process also
    counts messages that somebody else sent it over the network, so there it may be more. At the pace of a clock a robot
    may miss a tick, and nobody knows when it heard what.

    No inbox may believe a sender's sequence twice, whoever sends it: that is counted here, and not by the inboxes.

    believed: the forged frames that were accepted in the last tick.
    """

    def __init__(self, journal: RunRecord, prepared: Prepared, replay: Replay, *, processes: bool) -> None:
        self._journal = journal
        self._prepared = prepared
        self._replay = replay
        self._names = names_of(journal)
        self._processes = processes
        self._key: bytes | None = None
        self._unknown = "" if prepared.scenario.factor is None else "not judged at the pace of a clock"
        self._problem = ""
        self._events = 0
        self._inboxes: dict[int, Inbox] = {}
        self._refused: Counter[str] = Counter()
        self._used: dict[int, dict[int, bytearray]] = {}
        self.believed: list[Belief] = []
        try:
            self._key = fleet_key(prepared.scenario)
        except BadInput as bad:
            self._unknown = f"not judged: {bad}"

    @property
    def unknown(self) -> str:
        """Why nothing can be judged, if nothing can."""
        return self._unknown

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick, the replay having done so."""
        self.believed.clear()
        if self._unknown or self._replay.delivery is None:
            return
        self._bury(record.k)
        delivery = self._replay.delivery
        forged: dict[int, list[int]] = defaultdict(list)
        for source, to, sequence in delivery.arrived:
            if source != FORGED:
                break  # forged frames come first
            forged[to].append(sequence)
        now_s = record.k * self._prepared.scenario.step
        for row in record.robots:
            if row.status is not Status.ALIVE or row.number not in delivery.heard:
                continue
            inbox = self._inboxes.get(row.number)
            if inbox is None:
                bounds = self._prepared.terrain.bounds
                inbox = self._inboxes[row.number] = inbox_of(self._prepared.scenario, row.number, bounds, self._key)
                self._used[row.number] = {}
            of_forgers = iter(forged[row.number])
            for frame in delivery.heard[row.number]:
                forgery = next(of_forgers, None)
                position = inbox.accept(frame, now_s)
                if position is None:
                    continue
                again = self._again(row.number, position)
                if forgery is not None:
                    self.believed.append(Belief(row.number, forgery, position, again))
                elif again and not self._problem:
                    what = f"frame {position.sequence} of {self._names.get(position.robot, position.robot)}"
                    self._problem = f"{self._names[row.number]} believed {what} for the second time at tick {record.k}"
            self._compare(row.number, row.rejected, inbox.rejected, record.k)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        if self._unknown:
            return Check("refused frames", True, self._unknown, judged=False)
        if not self._problem:
            self._bury(None)
        reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(self._refused.items()))
        return Check("refused frames", not self._problem, self._problem or (reasons or "none"))

    def _compare(self, number: int, said: int | None, found: int, k: int) -> None:
        if said is None or self._problem or said == found or (self._processes and said > found):
            return
        name = self._names[number]
        self._problem = f"{name} says at tick {k} that it has refused {said} frames; by what it heard it is {found}"

    def _again(self, receiver: int, position: Position) -> bool:
        """Whether a receiver has believed this sender's sequence before; from now on it has. Contacts have none."""
        ticks = self._prepared.scenario.ticks
        if position.robot == CONTACT or position.sequence >= ticks:
            return False
        used = self._used[receiver].setdefault(position.robot, bytearray(ticks))
        before, used[position.sequence] = used[position.sequence], 1
        return bool(before)

    def _bury(self, k: int | None) -> None:
        """Let go of the inboxes of processes that were gone before tick k, or of all."""
        gone = [] if k is not None else list(self._inboxes)
        events = self._journal.events
        while k is not None and self._events < len(events) and events[self._events].k <= k:
            event = events[self._events]
            self._events += 1
            if event.robot is not None and event.kind in _GONE:
                gone.append(event.robot)
        for number in gone:
            inbox = self._inboxes.pop(number, None)
            self._used.pop(number, None)
            if inbox is not None:
                self._refused.update({reason.value: count for reason, count in inbox.counts.items() if count})


class ForgedAsConfigured:
    """Forged frames are refused where they can be told: without the key, of no robot, of no tick yet, a second time.

    What somebody with the key says, or anybody in a fleet without one, can only be judged by whether it is plausible;
    how much of it was believed is told and not judged. A genuine frame sent again is believed by those who had not
    heard it, and tells them nothing false.
    """

    def __init__(self, journal: RunRecord, prepared: Prepared, timeline: Timeline, hearing: Hearing) -> None:
        self._names = names_of(journal)
        self._hearing = hearing
        self._keyed = prepared.scenario.radio.key is not None
        self._spoofs = {entry.id: entry for entry in timeline.entries if isinstance(entry.fault, Spoof)}
        self._fault_of: dict[int, str] = {}
        self._heard: Counter[str] = Counter()
        self._believed: Counter[str] = Counter()
        self._problem = ""

    @property
    def called_for(self) -> bool:
        """Whether anything is forged at all."""
        return bool(self._spoofs)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick, after the hearing has."""
        for place, fault in enumerate(record.forged):
            self._fault_of[frame_sequence(record.k, place)] = fault
        for source, _, sequence in record.deliveries:
            if source != FORGED:
                break
            self._heard[self._fault_of.get(sequence, "")] += 1
        for belief in self._hearing.believed:
            fault = self._fault_of.get(belief.sequence, "")
            self._believed[fault] += 1
            if fault in self._spoofs:
                self._judge(record.k, belief, fault)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        if self._hearing.unknown:
            return Check("forged frames", True, self._hearing.unknown, judged=False)
        told = [
            f"{fault}: {self._believed[fault]} of {self._heard[fault]} heard were believed" for fault in self._spoofs
        ]
        return Check("forged frames", not self._problem, self._problem or "; ".join(told))

    def _judge(self, k: int, belief: Belief, fault: str) -> None:
        entry, position = self._spoofs[fault], belief.position
        assert isinstance(entry.fault, Spoof)
        payload = entry.fault.payload
        repeated = isinstance(payload, Forgery) and payload.replay is not None
        why = ""
        if position.robot not in self._names and position.robot != CONTACT:
            why = "of a robot that does not exist"
        elif position.sequence > k:
            why = "of a tick that was still to come"
        elif self._keyed and entry.sources[0] == NOBODY and not repeated:
            why = "without the fleet's key"
        elif belief.again:
            why = "for the second time"
        if why and not self._problem:
            self._problem = f"{self._names[belief.receiver]} believed a forged frame of {fault} {why} at tick {k}"
