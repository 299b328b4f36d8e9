"""What the listeners of one process have heard of each other: a row for each listener, a column for each sender.

A frame is decoded and checked once, however many hear it. Most frames follow from the last one of their sender without
any doubt and are taken in for all listeners at once. For the rest a listener's own inbox and tracker decide as they
would in a process of their own, after what the table says of the sender has been given to them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.radio.heard import Heard
from patrol.radio.inbox import ROUNDING, History, Inbox
from patrol.radio.kernels.hear import ODD, PLAIN, hear
from patrol.radio.message import CONTACT, Position
from patrol.radio.peers import Peer, PeerTracker
from patrol.radio.replay_window import SPAN, ReplayWindow

if TYPE_CHECKING:
    from patrol.pose import Pose

NOTHING = -1
"""The sequence of a sender that was not heard."""


@dataclass(frozen=True, slots=True)
class Ear:
    """One listener's own part.

    Attributes:
        row: In the tables.
        inbox: Decides on frames in doubt, and counts what it refuses.
        tracker: Finds the looks of what it accepts.
    """

    row: int
    inbox: Inbox
    tracker: PeerTracker


@dataclass(frozen=True, slots=True)
class Learnt:
    """What listeners have learnt in one tick.

    Attributes:
        said: Positions that were taken in without any doubt; each is a look of this tick, and of another robot.
        knows: uint8 (listeners, positions), 1 where a listener has taken in the position.
        accepted: Other positions and contacts, in their order, by listener.
        more: The looks that these make known, as tick and pose, by listener.
    """

    said: list[Position]
    knows: NDArray[np.uint8]
    accepted: dict[int, list[Position]] = field(default_factory=dict)
    more: dict[int, list[tuple[int, Pose]]] = field(default_factory=dict)


class Ears:
    """The tables. All listeners' clocks show the same time, and the same frames are genuine for all of them.

    Attributes:
        numbers: The roster's, ascending; a robot's place is its row and its column.
        sequence: int64 (n, n), of the last frame that a listener accepted of a sender; `NOTHING` for none.
        at: int64 (n, n), the tick at which that was heard.
    """

    def __init__(self, numbers: Sequence[int], step: float, speed: float) -> None:
        """Nothing heard yet.

        Args:
            numbers: Of all robots.
            step: s per tick.
            speed: Of the fastest robot, m/s.
        """
        self.numbers = sorted(numbers)
        self._column = {number: column for column, number in enumerate(self.numbers)}
        self._step = step
        self._speed = speed
        shape = len(self.numbers), len(self.numbers)
        self.sequence, self.at, self.x, self.y, self.heading, self._time = (
            np.full(shape, NOTHING, dtype=np.int64) for _ in range(6)
        )
        self._newest, self._looked = np.full(shape, -1, dtype=np.int64), np.full(shape, -1, dtype=np.int64)
        self._used, self._looks = np.zeros(shape, dtype=np.uint64), np.zeros(shape, dtype=np.uint64)
        self._start = np.zeros(shape, dtype=np.float64)
        self._odd = np.zeros(shape, dtype=np.uint8)

    def row_of(self, number: int) -> int:
        """A robot's row and column."""
        return self._column[number]

    def clear(self, row: int) -> None:
        """Forget what a listener has heard: another mind takes its place."""
        self.sequence[row] = NOTHING
        for table in (self._newest, self._looked):
            table[row] = -1
        self._used[row] = self._looks[row] = 0
        self._odd[row] = 0

    def peer(self, row: int, column: int) -> Peer:
        """What a listener knows of a robot that it has heard."""
        said = self._position(row, column)
        return Peer(said.sequence, said.pose, int(self.at[row, column]))

    def listen(self, tick: int, ears: Mapping[int, Ear], heard: Mapping[int, Sequence[bytes]]) -> Learnt:
        """Take in a tick's frames.

        Args:
            tick: Now.
            ears: Of the listeners, by number.
            heard: The frames that reach each of them, by its number, in their order.

        Returns:
            What they learn.
        """
        if not ears:
            return Learnt([], np.zeros((0, 0), dtype=np.uint8))
        frames, reaches, uneven = _as_table(heard, list(ears))
        positions = self._plain(frames, next(iter(ears.values())).inbox, tick)
        columns = np.array(list(positions), dtype=np.int64)
        said = list(positions.values())
        knows = np.ascontiguousarray(reaches[:, columns])
        rows = np.array([ear.row for ear in ears.values()], dtype=np.int64)
        doubts = self._hear(tick, rows, said, knows)
        learnt = Learnt(said, knows)
        if not doubts and len(said) == len(frames) and not uneven:
            return learnt
        others = np.ones(len(frames), dtype=np.bool_)
        others[columns] = False
        in_doubt = (knows == ODD).any(axis=1) | reaches[:, others].any(axis=1)
        for place, (number, ear) in enumerate(ears.items()):
            if in_doubt[place] or number in uneven:
                taken = {frames[columns[at]] for at in np.flatnonzero(knows[place] == PLAIN)}
                found, looks = self.decide(ear, _left(heard[number], taken), tick)
                learnt.accepted[number] = [position for position in found if position is not None]
                learnt.more[number] = looks
        knows[knows == ODD] = 0
        return learnt

    def _plain(self, frames: Sequence[bytes], inbox: Inbox, tick: int) -> dict[int, Position]:
        """The positions in frames of which each sender has one, by their place; none where a contact has to be judged.

        A contact is judged by what was heard before it, so then each listener takes its frames one by one.
        """
        found: dict[int, Position] = {}
        senders: dict[int, int] = {}
        for place, frame in enumerate(frames):
            position = inbox.plain(frame, tick * self._step)
            if position is None:
                claimed = _claimed(frame, inbox)
                if claimed == CONTACT:
                    return {}
                if claimed is not None:
                    senders[claimed] = senders.get(claimed, 0) + 1
            else:
                found[place] = position
                senders[position.robot] = senders.get(position.robot, 0) + 1
        return {place: position for place, position in found.items() if senders[position.robot] == 1}

    def _hear(self, tick: int, rows: NDArray[np.int64], said: Sequence[Position], knows: NDArray[np.uint8]) -> bool:
        """Take in what is without doubt; whether any of the rest reaches anybody."""
        facts = np.array(
            [(self._column[p.robot], p.sequence, p.x_cm, p.y_cm, p.heading_mrad, p.time_ms) for p in said],
            dtype=np.int64,
        ).reshape(-1, 6)
        senders, sequences, xs, ys, headings, times = np.ascontiguousarray(facts.T)
        now = (tick, self._step, self._speed, ROUNDING, SPAN)
        last = (self.sequence, self.x, self.y, self.heading, self._time, self.at, self._start)
        windows = (self._newest, self._used, self._looked, self._looks)
        facts_said = (senders, sequences, xs, ys, headings, times)
        return bool(hear(knows, rows, *facts_said, *now, self._odd, *last, *windows))

    def decide(
        self, ear: Ear, frames: Sequence[bytes], tick: int
    ) -> tuple[list[Position | None], list[tuple[int, Pose]]]:
        """Let a listener's own inbox decide on frames, one by one.

        Args:
            ear: The listener's.
            frames: In their order.
            tick: Now.

        Returns:
            What each frame says, None where it was refused; and the looks that the positions make known.
        """
        claimed = {_claimed(frame, ear.inbox) for frame in frames}
        everybody = range(len(self.numbers))
        concerned = (
            [column for column in everybody if self.sequence[ear.row, column] != NOTHING] if CONTACT in claimed else []
        )
        named = {self._column[number] for number in claimed if number in self._column}
        touched = sorted({*concerned, *named})
        for column in touched:
            self._lend(ear, column)
        looks: list[tuple[int, Pose]] = []
        accepted: list[Position | None] = []
        for frame in frames:
            position = ear.inbox.accept(frame, tick * self._step)
            accepted.append(position)
            if position is not None and position.robot != CONTACT:
                looks += ear.tracker.hear(position, tick)
        for column in touched:
            self._take_back(ear, column)
        return accepted, looks

    def _lend(self, ear: Ear, column: int) -> None:
        """Give a listener's inbox and tracker what the tables say of a sender."""
        row = ear.row
        if self.sequence[row, column] == NOTHING:
            return
        said = self._position(row, column)
        tick = int(self.at[row, column])
        windows = (
            ReplayWindow.resumed(int(newest[row, column]), int(used[row, column]))
            for newest, used in ((self._newest, self._used), (self._looked, self._looks))
        )
        ear.inbox.resume(History(said, tick * self._step, next(windows), float(self._start[row, column])))
        ear.tracker.resume(Peer(said.sequence, said.pose, tick), said, next(windows))

    def _take_back(self, ear: Ear, column: int) -> None:
        """Write down what a listener's inbox and tracker know of a sender."""
        row, number = ear.row, self.numbers[column]
        self._odd[row, column] = ear.inbox.doubts(number)
        history, known = ear.inbox.release(number), ear.tracker.release(number)
        if history is None or known is None:
            return
        (peer, _, looks), said = known, history.last
        at = row, column
        self.sequence[at], self.at[at], self._time[at] = said.sequence, peer.tick, said.time_ms
        self.x[at], self.y[at], self.heading[at] = said.x_cm, said.y_cm, said.heading_mrad
        self._start[at] = history.start
        self._newest[at], self._used[at] = history.window.newest, history.window.used
        self._looked[at], self._looks[at] = looks.newest, looks.used

    def _position(self, row: int, column: int) -> Position:
        at = row, column
        return Position(
            robot=self.numbers[column],
            sequence=int(self.sequence[at]),
            time_ms=int(self._time[at]),
            x_cm=int(self.x[at]),
            y_cm=int(self.y[at]),
            heading_mrad=int(self.heading[at]),
        )


def _left(frames: Sequence[bytes], taken: set[bytes]) -> list[bytes]:
    """The frames without the first of each that was taken in; a copy of it has to be refused."""
    left = []
    for frame in frames:
        if frame in taken:
            taken.discard(frame)
        else:
            left.append(frame)
    return left


def _claimed(frame: bytes, inbox: Inbox) -> int | None:
    """Whose frame it is, as far as it can be decoded."""
    said = inbox.decoded(frame)
    return None if said is None else said.robot


def _as_table(
    heard: Mapping[int, Sequence[bytes]], numbers: Collection[int]
) -> tuple[Sequence[bytes], NDArray[np.uint8], set[int]]:
    """All frames once, who hears which (uint8 (listeners, frames)), and who hears one more than once."""
    if isinstance(heard, Heard) and len(set(heard.frames)) == len(heard.frames):
        rows = [heard.receivers.index(number) for number in numbers] if len(numbers) != len(heard) else slice(None)
        return heard.frames, heard.reaches[rows].view(np.uint8), set()
    index: dict[bytes, int] = {}
    for number in numbers:
        for frame in heard[number]:
            index.setdefault(frame, len(index))
    reaches = np.zeros((len(numbers), len(index)), dtype=np.uint8)
    uneven: set[int] = set()
    for row, number in enumerate(numbers):
        places = [index[frame] for frame in heard[number]]
        reaches[row, places] = 1
        if len(set(places)) < len(places):
            uneven.add(number)
    return tuple(index), reaches, uneven
