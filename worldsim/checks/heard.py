"""The verdict's checks by repetition: a fresh ether carries the frames again, and fresh inboxes hear them again."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.faults.kinds import Forgery, Spoof
from patrol.journal import Status, TickRecord
from patrol.journal.links import Links, drops_of, joined, links_of, places_of
from patrol.journal.records import FORGED, frame_sequence
from patrol.pose import Pose
from patrol.prepare import inboxes_of
from patrol.radio.inbox import heard_by
from patrol.radio.message import CONTACT, Position
from patrol.scenario.radio_spec import MODELS
from runtime.security.private_files import fleet_key
from worldsim.checks.check import NO_ROBOT, Check
from worldsim.checks.fates import sent_links
from worldsim.radio.ether import RECEIVER_DEAD, Delivery, Ether, Link, ether_of
from worldsim.radio.models import OWN_MODEL, OnAir, RadioModel, model_of
from worldsim.robots.senses import Senses

if TYPE_CHECKING:
    from patrol.radio.inbox import Intake
    from worldsim.checks.check import JudgedRun

_GONE = tuple(status.name.lower() for status in (Status.DEAD, Status.LEFT, Status.LOST, Status.ABSENT))


class _Stated:
    """A radio model that loses the frames that the run's model has lost by the journal."""

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

    `delivery` is the ether's work in the last tick, None where that could not be recomputed.
    """

    name = "radio"
    of_ether = True
    reads_on = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        prepared, scenario = run.prepared, run.prepared.scenario
        self._ether: Ether | None = None
        self._fates = 0
        self.delivery: Delivery | None = None
        self._stated = None if scenario.radio.model in MODELS else _Stated()
        try:
            # A model that is not built in does not run in a verdict: its word is taken.
            model: RadioModel | None = self._stated or model_of(scenario, prepared.terrain)
            senses = Senses(scenario, run.timeline, prepared.terrain)
            self._ether = ether_of(scenario, run.timeline, prepared.terrain, senses, model=model)
        except BadInput as bad:
            self._unknown = f"not judged: the forged frames cannot be recomputed: {bad}"

    @property
    def in_flight(self) -> Counter[Link]:
        """The frames that are still in flight after the ticks so far, by their links."""
        return Counter() if self._ether is None else self._ether.in_flight

    def _tick(self, record: TickRecord) -> None:
        self.delivery = None
        if self._ether is None or self._problem:
            return
        frames: dict[int, list[bytes]] = defaultdict(list)
        for source, frame in record.frames:
            if source != FORGED:
                frames[source].append(frame)
        statuses = {row.number: row.status for row in record.robots}
        for source in frames:
            if statuses.get(source) is not Status.ALIVE:
                self._fail(f"tick {record.k}: a frame of {self._name(source)}, which is not alive")
                return
        if lost := self._run.lost_in(record.k):  # before they could hear anything
            receivers = {to for _, to, _, why in record.dropped if why == RECEIVER_DEAD and to in lost}
            statuses |= dict.fromkeys(receivers, Status.LOST)
        poses = {row.number: Pose(row.x, row.y, row.heading) for row in record.robots if row.status.is_present}
        if self._stated is not None:
            self._stated.record = record
        self.delivery = self._ether.carry(record.k, frames, statuses, poses)
        self._fail(self._describe_difference(record, self.delivery))
        self._fates += len(record.deliveries) + len(record.dropped)

    def _end(self) -> str:
        of_model = "" if self._stated is None else ", but for what the radio model has lost, which is code of one's own"
        return f"the fates of {self._fates} frames are as recomputed{of_model}"

    def _describe_difference(self, record: TickRecord, due: Delivery) -> str:
        forged = [frame for source, frame in record.frames if source == FORGED]
        if (forged, record.forged) != ([forgery.frame for forgery in due.forged], tuple(f.fault for f in due.forged)):
            return f"tick {record.k}: the forged frames are not those that the faults ask for"
        for fate, rows, expected in (
            ("delivered", record.deliveries, due.arrived),
            ("dropped", record.dropped, due.dropped),
            ("copied", record.copies, due.copies),
            ("delayed", record.delayed, due.delayed),
        ):
            if rows != expected and (difference := self._describe_first(fate, rows, expected)):
                return f"tick {record.k}: {difference}"
        return ""

    def _describe_first(self, fate: str, rows: Sequence[tuple[object, ...]], due: Sequence[tuple[object, ...]]) -> str:
        """Return the first difference between two rows of fates, in words; empty where there is none that matters."""
        surplus, missing = Counter(rows) - Counter(due), Counter(due) - Counter(rows)
        if not surplus and not missing:
            # Journals of 0.2 have dropped frames in other orders, which mean nothing.
            return "" if fate == "dropped" else f"the order of what was {fate} is not the recomputed one"
        (source, to, sequence, *why) = min(surplus or missing)
        reason = f" ({why[0]})" if why else ""
        text = f"was {fate}{reason} and should not have been" if surplus else f"should have been {fate}{reason}"
        return f"frame {sequence} {self._way((source, to, sequence))} {text}"  # type: ignore[arg-type]


class LinksAddUp(Check):
    """On every directed link each frame sent, copies included, was delivered or dropped once, or is still in flight.

    Nothing else was delivered or dropped. `FatesAsRecomputed` names the frames in flight at the end.
    """

    name = "links add up"
    of_ether = True
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._recomputed = run.reading(FatesAsRecomputed)
        self._sent = self._settled = 0
        self._open: Counter[tuple[int, int, int]] = Counter()

    def _tick(self, record: TickRecord) -> None:
        links = sent_links(record)
        settled = joined(links_of(record.deliveries), drops_of(record.dropped))
        self._sent += len(links) + len(record.copies)
        self._settled += len(settled)
        # Most ticks settle all that they send; only the others are counted link by link.
        if not record.copies and _same_links(links, settled):
            return
        self._open.update(links)
        self._open.update(copy[:3] for copy in record.copies)
        for link in settled:
            self._open[link] -= 1
            # Settled links go, or a long run would fill the memory.
            if self._open[link] == 0:
                del self._open[link]

    def _end(self) -> str:
        wrong = Counter(self._open)
        wrong.subtract(self._recomputed.in_flight)
        wrong = Counter({link: balance for link, balance in wrong.items() if balance})
        if wrong:
            link, balance = min(wrong.items())
            problem = "neither delivered nor dropped" if balance > 0 else "delivered or dropped but not sent"
            self._fail(f"frame {link[2]} {self._way(link)} was {problem} ({len(wrong)} such frames)")
        flying = f", {self._open.total()} in flight" if self._open else ""
        return f"{self._sent} frames sent over links, {self._settled} delivered or dropped{flying}"


def _same_links(links: Links, others: Links) -> bool:
    """Return True if two lists hold the same links, each as often, in any order."""
    if len(links) != len(others):
        return False
    if links == others:
        return True
    mine, theirs = places_of(links), places_of(others)
    if mine is None or theirs is None:
        return False
    # Both are made of few ascending parts, which a stable sort takes as they are.
    return np.array_equal(np.sort(mine, kind="stable"), np.sort(theirs, kind="stable"))


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

        For example, the sequence 10 is bit 2 of part 1.

        `rows`, int64 (n,), are the robots' places in the roster, and `column` is the sender's. The sequence is less
        than the number of ticks.
        """
        # A byte for eight sequences of each pair: a long run of a large fleet fits into memory.
        part, bit = sequence // 8, np.uint8(1 << sequence % 8)
        if part not in self._bits:
            self._bits[part] = np.zeros((self._robots, self._robots), dtype=np.uint8)
        bits = self._bits[part][:, column]
        before: NDArray[np.bool_] = bits[rows] & bit != 0
        bits[rows] |= bit
        return before

    def clear(self, row: int) -> None:
        """Forget the frames that a robot has accepted: another process takes its place."""
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
    reads_on = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._scenario = run.prepared.scenario
        self._recomputed = run.reading(FatesAsRecomputed)
        if self._scenario.factor is not None:
            self._unknown = "not judged: the run kept to the clock, so nobody knows in which tick a frame was heard"
        self._place = {spec.number: index for index, spec in enumerate(self._scenario.roster)}
        self._listening: set[int] = set()
        self._used = Used(len(self._place))
        self._refused: Counter[str] = Counter()
        self.accepted: list[AcceptedForgery] = []
        key = None
        try:
            key = fleet_key(self._scenario.radio.key)
        except BadInput as bad:
            self._unknown = f"not judged: {bad}"
        self._inboxes = inboxes_of(self._scenario, list(self._place), run.prepared.terrain.bounds, key)

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the fog is verified, the world carried frames, and a fault or a key makes robots refuse."""
        on_frames = any(entry.fault.acts_on not in ("processes", "ground") for entry in run.timeline.entries)
        keyed = run.prepared.scenario.radio.key is not None
        return run.verify_fog and run.by_ether and (on_frames or keyed)

    @property
    def unknown(self) -> str:
        """The reason why nothing can be judged, empty when it can."""
        return self._unknown

    def _tick(self, record: TickRecord) -> None:
        self.accepted.clear()
        delivery = self._recomputed.delivery
        if self._unknown or delivery is None:
            return
        departed = (event.robot for event in self._events_before(record.k) if event.kind in _GONE)
        self._drop_inboxes(self._listening.intersection(departed))
        rows = [row for row in record.robots if row.status is Status.ALIVE and row.number in delivery.heard]
        self._listening.update(row.number for row in rows)
        intake = self._inboxes.hear(record.k, heard_by([row.number for row in rows], delivery.heard))
        forged: dict[int, list[int]] = defaultdict(list)
        arrived = links_of(delivery.arrived)
        # Forged frames come first.
        for _, to, sequence in arrived[: np.count_nonzero(arrived.source == FORGED)]:
            forged[to].append(sequence)
        self._collect_forged(record.k, intake, forged)
        for row in rows:
            self._compare_refused(row.number, row.rejected, self._inboxes.rejected(row.number), record.k)

    def _end(self) -> str:
        if not self._problem:
            self._drop_inboxes(self._listening)
        return ", ".join(f"{count} {reason}" for reason, count in sorted(self._refused.items())) or "none"

    def _collect_forged(self, k: int, intake: Intake, forged: Mapping[int, Sequence[int]]) -> None:
        """Collect the forged frames that robots have accepted, and fail for other frames accepted twice.

        `forged` has the sequences of the forged frames that each robot heard; they come before all others.
        """
        listeners = np.array([self._place[number] for number in intake.listeners], dtype=np.int64)
        accepted: list[tuple[int, int, AcceptedForgery]] = []
        for column, position in enumerate(intake.said):
            rows = np.flatnonzero(intake.accepted[:, column])
            if position is None or not rows.size:
                continue
            again = self._note_sequence(listeners[rows], position)
            if not forged and not again.any():
                continue
            for row, is_again in zip(rows.tolist(), again.tolist(), strict=True):
                number = intake.listeners[row]
                # Its place among the frames that this robot heard, the forged ones first.
                # `said` has each frame once, whichever robots heard it.
                index = int(np.count_nonzero(intake.heard[row, :column]))
                if index < len(forged.get(number, ())):
                    forgery = AcceptedForgery(number, forged[number][index], position, is_again)
                    accepted.append((row, index, forgery))
                elif is_again:
                    frame = f"frame {position.sequence} of {self._name(position.robot)}"
                    self._fail(f"{self._name(number)} accepted {frame} a second time at tick {k}")
        self.accepted += [forgery for _, _, forgery in sorted(accepted, key=lambda entry: entry[:2])]

    def _compare_refused(self, number: int, reported: int | None, counted: int, k: int) -> None:
        if reported is None or self._problem or reported == counted or (self._run.processes and reported > counted):
            return
        refused = f"refused {reported} frames; from what it heard it should be {counted}"
        self._fail(f"{self._name(number)} reports at tick {k} that it {refused}")

    def _note_sequence(self, receivers: NDArray[np.int64], position: Position) -> NDArray[np.bool_]:
        """Note that receivers accept a sender's sequence; return whether each had before.

        `receivers` are places in the roster. Contacts have no sequence.
        """
        if position.robot == CONTACT or position.sequence >= self._scenario.ticks:
            return np.zeros(len(receivers), dtype=np.bool_)
        return self._used.use(receivers, self._place[position.robot], position.sequence)

    def _drop_inboxes(self, numbers: set[int]) -> None:
        """Drop the inboxes of processes that are gone, and keep their counts."""
        for number in numbers:
            counts = self._inboxes.counts(number)
            self._refused.update({reason.value: count for reason, count in counts.items() if count})
            self._inboxes.clear(number)
            self._used.clear(self._place[number])
        self._listening -= numbers


class ForgedAsConfigured(Check):
    """Forged frames are refused where they can be told: without the key, of no robot, of a future tick, a second time.

    A forgery with the key, or in a fleet without one, can only be refused where it is implausible; how much of it was
    accepted is reported, not judged. A genuine frame sent again is accepted by robots that had not heard it, and tells
    them nothing false.
    """

    name = "forged frames"
    kinds = (Spoof,)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._hearing = run.reading(Hearing)
        self._keyed = run.prepared.scenario.radio.key is not None
        self._spoofs = {entry.id: entry for entry in self._entries}
        self._fault_of: dict[int, str] = {}
        self._heard: Counter[str] = Counter()
        self._accepted: Counter[str] = Counter()

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if robots' hearing is checked and a fault forges frames."""
        return Hearing.applies(run) and super().applies(run)

    def _tick(self, record: TickRecord) -> None:
        for index, fault in enumerate(record.forged):
            self._fault_of[frame_sequence(record.k, index)] = fault
        for source, _, sequence in record.deliveries:
            if source != FORGED:
                break
            self._heard[self._fault_of.get(sequence, "")] += 1
        for accepted in self._hearing.accepted:
            fault = self._fault_of.get(accepted.sequence, "")
            self._accepted[fault] += 1
            if fault in self._spoofs:
                self._judge_forgery(record.k, accepted, fault)

    def _end(self) -> str:
        self._unknown = self._hearing.unknown
        return "; ".join(
            f"{fault}: {self._accepted[fault]} of {self._heard[fault]} heard were accepted" for fault in self._spoofs
        )

    def _judge_forgery(self, k: int, accepted: AcceptedForgery, fault: str) -> None:
        entry, position = self._spoofs[fault], accepted.position
        assert isinstance(entry.fault, Spoof)
        payload = entry.fault.payload
        repeated = isinstance(payload, Forgery) and payload.replay is not None
        why = ""
        if position.robot not in self._run.names and position.robot != CONTACT:
            why = "in the name of a robot that does not exist"
        elif position.sequence > k:
            why = "of a tick that was still to come"
        elif self._keyed and entry.sources[0] == NO_ROBOT and not repeated:
            why = "without the fleet's key"
        elif accepted.again:
            why = "a second time"
        if why:
            self._fail(f"{self._name(accepted.receiver)} accepted a forged frame of {fault} {why} at tick {k}")
