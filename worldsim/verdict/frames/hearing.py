"""The verdict's checks of robots' hearing: the frames that they refused, forged ones above all."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from patrol.errors import BadInput
from patrol.faults.kinds import Forgery, Spoof
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED, frame_sequence
from patrol.prepare import inboxes_of
from patrol.radio.fleet_key import fleet_key
from patrol.radio.heard import heard_by
from patrol.radio.message import CONTACT, Position
from worldsim.radio.fates import STRANGER
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.recomputed import FatesAsRecomputed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from patrol.radio.inbox import Intake
    from worldsim.verdict.common.check import JudgedRun, Readings

_GONE = tuple(status.name.lower() for status in (Status.DEAD, Status.LEFT, Status.LOST, Status.ABSENT))


@dataclass(frozen=True, slots=True)
class AcceptedForgery:
    """A forged frame that a robot accepted."""

    receiver: int
    sequence: int  # of the frame, as the journal counts it
    position: Position
    again: bool  # it had accepted this sequence of this sender before


class Used:
    """The sequences of each sender that each robot has accepted: one bit for each."""

    def __init__(self, robots: int) -> None:
        self._robots = robots
        self._bits: dict[int, NDArray[np.uint8]] = {}

    def use(self, rows: NDArray[np.int64], column: int, sequence: int) -> NDArray[np.bool_]:
        """Note that robots accept a sequence of a sender; return whether each had before.

        `rows`, int64 (n,), are the robots' places in the roster, and `column` is the sender's. The sequence is less
        than the number of ticks.
        """
        part, bit = sequence // 8, np.uint8(1 << sequence % 8)
        if part not in self._bits:
            self._bits[part] = np.zeros((self._robots, self._robots), dtype=np.uint8)
        bits = self._bits[part][:, column]
        before: NDArray[np.bool_] = bits[rows] & bit != 0
        bits[rows] |= bit
        return before

    def clear(self, row: int) -> None:
        """Forget what a robot has accepted: another process takes its place."""
        for bits in self._bits.values():
            bits[row] = 0


class Hearing(Check):
    """Each robot's inbox, one for each process, takes the frames that the ether brings it in the replay.

    Robots count the frames that they refuse. In one process these are the frames that fresh inboxes refuse. A robot
    that is a process also counts a stranger's messages over the network, so its count may be higher. When the run keeps
    to the clock, a robot may miss a tick, so it is unknown when it heard what.

    No inbox may accept a sender's sequence twice, from any radio. That is counted here, not by the inboxes. `accepted`
    holds the forged frames that were accepted in the last tick.
    """

    name = "refused frames"
    needs = (RobotsThere, FatesAsRecomputed)
    reads_on = True

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._prepared = run.prepared
        self._recomputed = readings[FatesAsRecomputed]
        self._names = run.names
        self._unknown = ""
        if run.prepared.scenario.factor is not None:
            self._unknown = "not judged: the run kept to the clock, so nobody knows in which tick a frame was heard"
        self._events = 0
        roster = run.prepared.scenario.roster
        self._place = {spec.number: place for place, spec in enumerate(roster)}
        self._listening: set[int] = set()
        self._used = Used(len(roster))
        self._refused: Counter[str] = Counter()
        self.accepted: list[AcceptedForgery] = []
        key = None
        try:
            key = fleet_key(run.prepared.scenario.radio.key)
        except BadInput as bad:
            self._unknown = f"not judged: {bad}"
        self._inboxes = inboxes_of(run.prepared.scenario, list(self._place), run.prepared.terrain.bounds, key)

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the fog is verified, the world carried frames, and a fault or a key makes robots refuse."""
        on_frames = any(entry.fault.acts_on not in ("processes", "closures") for entry in run.timeline.entries)
        keyed = run.prepared.scenario.radio.key is not None
        return run.verify_fog and run.by_ether and (on_frames or keyed)

    @property
    def unknown(self) -> str:
        """The reason why nothing can be judged, empty when it can."""
        return self._unknown

    def _tick(self, record: TickRecord) -> None:
        self.accepted.clear()
        if self._unknown or self._recomputed.delivery is None:
            return
        self._drop_inboxes(record.k)
        delivery = self._recomputed.delivery
        rows = [row for row in record.robots if row.status is Status.ALIVE and row.number in delivery.heard]
        self._listening.update(row.number for row in rows)
        intake = self._inboxes.hear(record.k, heard_by([row.number for row in rows], delivery.heard))
        forged: dict[int, list[int]] = defaultdict(list)
        for source, to, sequence in delivery.arrived:
            if source != FORGED:
                break  # forged frames come first
            forged[to].append(sequence)
        self._look(record.k, intake, forged)
        for row in rows:
            self._compare(row.number, row.rejected, self._inboxes.rejected(row.number), record.k)

    def _look(self, k: int, intake: Intake, forged: Mapping[int, Sequence[int]]) -> None:
        """Collect the forged frames that robots have accepted, and fail for other frames accepted twice.

        `forged` has the sequences of the forged frames that each robot heard; they come before all others.
        """
        listeners = np.array([self._place[number] for number in intake.listeners], dtype=np.int64)
        accepted: list[tuple[int, int, AcceptedForgery]] = []
        for column, position in enumerate(intake.said):
            rows = np.flatnonzero(intake.accepted[:, column])
            if position is None or not rows.size:
                continue
            again = self._again(listeners[rows], position)
            if not forged and not again.any():
                continue
            for row, is_again in zip(rows.tolist(), again.tolist(), strict=True):
                number = intake.listeners[row]
                place = int(np.count_nonzero(intake.heard[row, :column]))
                if place < len(forged.get(number, ())):
                    forgery = AcceptedForgery(number, forged[number][place], position, is_again)
                    accepted.append((row, place, forgery))
                elif is_again:
                    self._accepted_again(number, position, k)
        self.accepted += [forgery for _, _, forgery in sorted(accepted, key=lambda entry: entry[:2])]

    def _accepted_again(self, number: int, position: Position, k: int) -> None:
        frame = f"frame {position.sequence} of {self._names.get(position.robot, position.robot)}"
        self._fail(f"{self._names[number]} accepted {frame} a second time at tick {k}")

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        if self._unknown:
            return self._not_judged(self._unknown)
        if not self._problem:
            self._drop_inboxes(None)
        return super().result()

    def _good(self) -> str:
        return ", ".join(f"{count} {reason}" for reason, count in sorted(self._refused.items())) or "none"

    def _compare(self, number: int, reported: int | None, counted: int, k: int) -> None:
        if reported is None or self._problem or reported == counted or (self._run.processes and reported > counted):
            return
        name = self._names[number]
        self._fail(
            f"{name} reports at tick {k} that it refused {reported} frames; from what it heard it should be {counted}"
        )

    def _again(self, receivers: NDArray[np.int64], position: Position) -> NDArray[np.bool_]:
        """Note that receivers accept a sender's sequence; return whether each had before.

        `receivers` are places in the roster. Contacts have no sequence.
        """
        if position.robot == CONTACT or position.sequence >= self._prepared.scenario.ticks:
            return np.zeros(len(receivers), dtype=np.bool_)
        return self._used.use(receivers, self._place[position.robot], position.sequence)

    def _drop_inboxes(self, k: int | None) -> None:
        """Drop the inboxes of processes that were gone before tick k, or all of them, and keep their counts."""
        leavers = [] if k is not None else sorted(self._listening)
        events = self._run.journal.events
        while k is not None and self._events < len(events) and events[self._events].k <= k:
            event = events[self._events]
            self._events += 1
            if event.robot is not None and event.kind in _GONE:
                leavers.append(event.robot)
        for number in self._listening.intersection(leavers):
            counts = self._inboxes.counts(number)
            self._refused.update({reason.value: count for reason, count in counts.items() if count})
            self._inboxes.clear(number)
            self._used.clear(self._place[number])
            self._listening.discard(number)


class ForgedAsConfigured(Check):
    """Forged frames are refused where they can be told: without the key, of no robot, of a future tick, a second time.

    A forgery with the key, or in a fleet without one, can only be refused where it is implausible; how much of it was
    accepted is reported, not judged. A genuine frame sent again is accepted by robots that had not heard it, and tells
    them nothing false.
    """

    name = "forged frames"
    needs = (RobotsThere, Hearing)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.names
        self._hearing = readings[Hearing]
        self._keyed = run.prepared.scenario.radio.key is not None
        self._spoofs = {entry.id: entry for entry in run.timeline.entries if isinstance(entry.fault, Spoof)}
        self._fault_of: dict[int, str] = {}
        self._heard: Counter[str] = Counter()
        self._accepted: Counter[str] = Counter()

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if robots' hearing is checked and a fault forges frames."""
        return Hearing.applies(run) and any(isinstance(entry.fault, Spoof) for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        for place, fault in enumerate(record.forged):
            self._fault_of[frame_sequence(record.k, place)] = fault
        for source, _, sequence in record.deliveries:
            if source != FORGED:
                break
            self._heard[self._fault_of.get(sequence, "")] += 1
        for accepted in self._hearing.accepted:
            fault = self._fault_of.get(accepted.sequence, "")
            self._accepted[fault] += 1
            if fault in self._spoofs:
                self._judge(record.k, accepted, fault)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        return self._not_judged(self._hearing.unknown) if self._hearing.unknown else super().result()

    def _good(self) -> str:
        return "; ".join(
            f"{fault}: {self._accepted[fault]} of {self._heard[fault]} heard were accepted" for fault in self._spoofs
        )

    def _judge(self, k: int, accepted: AcceptedForgery, fault: str) -> None:
        entry, position = self._spoofs[fault], accepted.position
        assert isinstance(entry.fault, Spoof)
        payload = entry.fault.payload
        repeated = isinstance(payload, Forgery) and payload.replay is not None
        why = ""
        if position.robot not in self._names and position.robot != CONTACT:
            why = "in the name of a robot that does not exist"
        elif position.sequence > k:
            why = "of a tick that was still to come"
        elif self._keyed and entry.sources[0] == STRANGER and not repeated:
            why = "without the fleet's key"
        elif accepted.again:
            why = "a second time"
        if why:
            self._fail(f"{self._names[accepted.receiver]} accepted a forged frame of {fault} {why} at tick {k}")
