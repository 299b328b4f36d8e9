"""Every check between received frames and beliefs, for all listeners of a process: a row for each, in a process one.

Theory of operation
    Pure: the caller says which tick it is. Senders' clocks may disagree, so a frame's age and a sender's speed are
    judged by the listener's tick at arrival; the sequence orders a sender's frames.

    A sequence is the tick in which a frame was sent, and all robots of a fleet count the same ticks. So no frame can be
    of a tick that is still to come, and whatever was forged or repeated, a robot's next frame is never out of date.

    What follows the last frame of a sender must be a place that it can have reached; where it is not, frames that agree
    with each other are believed in the end, because localisation may jump honestly. A trail is cut off where it leads
    farther in a step than a robot can go.

    A radio may delay frames, repeat them and let them overtake each other. A frame that is older than the newest of its
    sender's is *late*: it is accepted once, if it comes within a window of `patrol.radio.message.SPAN` sequences, and
    says only where the sender was then. A sender's sequences go on with time, also over a restart of the sender, so its
    window outlives it.

    A contact, an intruder's position, does not name its reporter and may be reported by several at once. It must lie
    on the terrain, and its sequence must be one that some robot of the roster would send about now, going on from that
    robot's last accepted frame.

    Here each frame is decoded once, however many hear it, and refused for all where it cannot be true for any listener.
    The rest is judged by a kernel (`patrol.kernels.hear`), which has the whole rule for what depends on what a
    listener has heard before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.hear import (
    ACCEPTED,
    AHEAD,
    CELL,
    FRAME,
    NO_ROBOT,
    NO_SENDER,
    NOTHING,
    OLD,
    OWN,
    POSITION,
    REPORT,
    ROUNDING,
    THEN,
    TOO_FAST,
    UNKNOWN,
    columns_heard,
    hear,
)
from patrol.pose import Pose
from patrol.radio.message import CM_PER_M, CONTACT, SPAN, Position, Rejected, RejectReason, cm_to_m, decode, m_to_cm
from patrol.radio.peers import Columns, Peer


class Heard(Mapping[int, list[bytes]]):
    """The frames that reach each receiver, by its number, in their order. Each frame is held once.

    `frames` holds all of them, by sender and sequence, forged ones first; `receivers` is ascending; and `reaches`, bool
    (receivers, frames), says which receiver hears which frame.
    """

    def __init__(self, frames: Sequence[bytes], receivers: Sequence[int], reaches: NDArray[np.bool_]) -> None:
        self.frames = tuple(frames)
        self.receivers = tuple(receivers)
        self.reaches = reaches
        self._row = {number: row for row, number in enumerate(self.receivers)}

    def __getitem__(self, number: int) -> list[bytes]:
        return list(compress(self.frames, self.reaches[self._row[number]].tolist()))

    def __contains__(self, number: object) -> bool:
        return number in self._row

    def __iter__(self) -> Iterator[int]:
        return iter(self.receivers)

    def __len__(self) -> int:
        return len(self.receivers)


def heard_by(receivers: Sequence[int], heard: Mapping[int, Sequence[bytes]]) -> Mapping[int, Sequence[bytes]]:
    """Return the frames that some receivers hear; the receivers' numbers are ascending."""
    if not isinstance(heard, Heard):
        return {number: heard[number] for number in receivers}
    if heard.receivers == tuple(receivers):
        return heard
    # Both lists ascend, so the rows stay in the receivers' order.
    return Heard(heard.frames, receivers, heard.reaches[np.isin(heard.receivers, receivers)])


_CODES = {
    RejectReason.OWN: OWN,
    RejectReason.UNKNOWN: UNKNOWN,
    RejectReason.OLD: OLD,
    RejectReason.AHEAD: AHEAD,
    RejectReason.TOO_FAST: TOO_FAST,
    RejectReason.MALFORMED: 7,
    RejectReason.VERSION: 8,
    RejectReason.TAG: 9,
    RejectReason.OUTSIDE: 10,
}


@dataclass(frozen=True, slots=True)
class Rules:
    """The settings by which all listeners of a fleet judge frames.

    Where `ahead` is None, frames too far ahead of their sender's last, and too old ones, are accepted too, once enough
    of them agree with each other: what a forged one has shut out comes back.
    """

    roster: tuple[int, ...]  # the numbers of all robots
    bounds: tuple[float, float, float, float]  # of the terrain: x_min, y_min, x_max, y_max, m
    speed: float  # of the fastest robot, m/s
    key: bytes | None = None  # of the tags; None when the fleet uses none
    step: float = 0.5  # s between a sender's frames, which may come one step early or late
    ahead: int | None = 0  # ticks by which a sequence may lead the listener's; None where they begin at other moments
    trail_every: int = 1  # ticks between the places of a trail


@dataclass(frozen=True, slots=True)
class Intake:
    """The judgement of listeners on the frames of one tick."""

    tick: int
    listeners: tuple[int, ...]  # their numbers, in the order of the rows
    # by frame, with as much of its trail as can be true; None where it cannot be decoded or true
    said: tuple[Position | None, ...]
    heard: NDArray[np.uint8]  # (listeners, frames), not 0 where a frame reaches a listener
    accepted: NDArray[np.bool_]  # (listeners, frames)
    plain: NDArray[np.bool_]  # (listeners, frames), where only the sender's place in this tick became known
    # (row, frame, tick, pose) of other looks made known, in order: earlier, or told of by a trail
    past: list[tuple[int, int, int, Pose]]

    def positions(self, number: int) -> list[Position]:
        """Return the positions and contacts that one listener has accepted, in their order."""
        places = np.flatnonzero(self.accepted[self.listeners.index(number)]).tolist()
        return [position for index in places if (position := self.said[index]) is not None]

    def looks(self, number: int) -> list[tuple[int, Pose]]:
        """Return the looks that one listener learns of, tick and pose, in their order."""
        row = self.listeners.index(number)
        plain = np.flatnonzero(self.plain[row]).tolist()
        looks = [(index, self.tick, position.pose) for index in plain if (position := self.said[index]) is not None]
        looks += [(index, tick, pose) for listener, index, tick, pose in self.past if listener == row]
        looks.sort(key=itemgetter(0))
        return [(tick, pose) for _, tick, pose in looks]


class Inboxes:
    """Memory of listeners about a fleet's robots: a row for each listener, a column for each robot.

    In a process there is one row; in a fleet of one process there is one for each robot:

        inboxes = Inboxes([2], Rules((1, 2, 3), (0.0, 0.0, 100.0, 88.0), speed=4.0))
        intake = inboxes.hear(7, {2: [frame_of_robot_1, frame_of_robot_3]})
        intake.positions(2), intake.looks(2), inboxes.peers(2)
    """

    def __init__(self, listeners: Sequence[int], rules: Rules) -> None:
        """Begin with nothing heard; a listener with the number of no robot only listens."""
        self.rules = rules
        self._column = {number: column for column, number in enumerate(sorted(rules.roster))}
        self._numbers = np.array(list(self._column), dtype=np.int64)
        self._row = {number: row for row, number in enumerate(listeners)}
        self._own = np.array([self._column.get(number, NO_ROBOT) for number in listeners], dtype=np.int64)
        self._cells = np.zeros((len(listeners), len(self._column)), dtype=CELL)
        self._cells["sequence"] = NOTHING
        self._refused = np.zeros((len(listeners), 1 + max(_CODES.values())), dtype=np.int64)
        x_min, y_min, x_max, y_max = rules.bounds
        # A robot at the very edge may be rounded to a centimetre beyond it.
        self._bounds = x_min - ROUNDING, y_min - ROUNDING, x_max + ROUNDING, y_max + ROUNDING
        self._longest_step_cm = m_to_cm(rules.speed * rules.step * rules.trail_every + ROUNDING)

    def clear(self, number: int) -> None:
        """Forget the frames that a listener has heard and refused: another process or mind takes its place."""
        row = self._row[number]
        self._cells[row] = np.zeros((), dtype=CELL)
        self._cells["sequence"][row] = NOTHING
        self._refused[row] = 0

    def counts(self, number: int) -> dict[RejectReason, int]:
        """Count the frames that a listener has refused so far, by reason.

        For example, after one frame with a wrong tag `RejectReason.TAG` has 1 and all other reasons 0.
        """
        return {reason: self._refused.item(self._row[number], _CODES[reason]) for reason in RejectReason}

    def rejected(self, number: int) -> int:
        """Count the frames that a listener has refused so far."""
        return sum(self._refused[self._row[number]].tolist())

    def peers(self, number: int, since: int = 0) -> Peers:
        """Return the robots that a listener has heard at a tick or later."""
        return Peers(self._column, self._numbers, self._cells[self._row[number]], since)

    def hear(self, tick: int, heard: Mapping[int, Sequence[bytes]]) -> Intake:
        """Take in a tick's frames, those that reach each listener by its number, in their order.

        The tick never decreases.
        """
        rules, listeners = self.rules, tuple(heard)
        frames, reaches = _as_table(heard)
        # By content: the same bytes are decoded once, however often they come in a tick.
        decoded = {frame: self._read_frame(frame, tick) for frame in frames}
        positions = tuple(decoded[frame][0] for frame in frames)
        facts = np.array([decoded[frame][1] for frame in frames], dtype=FRAME)
        fate, looks = np.zeros_like(reaches), np.zeros_like(reaches)
        since = np.zeros(reaches.shape, dtype=np.int32)
        rows = np.array([self._row[number] for number in listeners], dtype=np.int64)
        now = (tick, rules.step, rules.speed, rules.ahead is not None, rules.trail_every, SPAN)
        is_past = hear(self._cells, self._refused, rows, self._own, facts, reaches, *now, fate, looks, since)
        past = list(self._past_looks(tick, positions, looks, since)) if is_past else []
        return Intake(tick, listeners, positions, reaches, fate == ACCEPTED, looks == 1, past)

    def _past_looks(
        self, tick: int, said: Sequence[Position | None], looks: NDArray[np.uint8], since: NDArray[np.int32]
    ) -> Iterator[tuple[int, int, int, Pose]]:
        for row, column in np.argwhere(looks > 1).tolist():
            position, bits = said[column], int(looks[row, column])
            if position is None:
                continue
            then = tick - int(since[row, column]) if bits & THEN else tick
            for back, (x, y) in enumerate(((position.pose.x, position.pose.y), *position.past)):
                if bits >> back & 1:
                    yield row, column, then - back * self.rules.trail_every, Pose(x, y, position.pose.heading)

    def _read_frame(self, frame: bytes, tick: int) -> tuple[Position | None, tuple[int, ...]]:
        """Decode a frame, and give it as the kernel takes it: with the reason where no listener accepts it."""
        try:
            position = decode(frame, self.rules.key)
        except Rejected as rejected:
            return None, (_CODES[rejected.reason], NO_SENDER, 0, 0, 0, 0, 0, 0, 0)
        reason = self._refusal_reason(position, tick)
        # Only of a frame that can be accepted: a refused one needs no trail.
        position = position if reason else self._with_plausible_trail(position)
        sender = self._column.get(position.robot, NO_SENDER)
        kind = _CODES[reason] if reason else REPORT if position.robot == CONTACT else POSITION
        back = position.trail[0] if position.trail else (0, 0)
        rounded_pose = position.x_cm, position.y_cm, position.heading_mrad
        return position, (kind, sender, position.sequence, *rounded_pose, *back, len(position.trail))

    def _refusal_reason(self, position: Position, tick: int) -> RejectReason | None:
        """Return the reason for which no listener accepts a position, or None."""
        if position.robot != CONTACT and position.robot not in self._column:
            return RejectReason.UNKNOWN
        x_min, y_min, x_max, y_max = self._bounds
        for x, y in ((cm_to_m(position.x_cm), cm_to_m(position.y_cm)), *position.past):
            if not (x_min <= x <= x_max and y_min <= y <= y_max):
                return RejectReason.OUTSIDE
        ahead = self.rules.ahead
        return RejectReason.AHEAD if ahead is not None and position.sequence > tick + ahead else None

    def _with_plausible_trail(self, position: Position) -> Position:
        """Return the position with as much of its trail as a robot can have driven.

        For example, at 1 m/s, 0.5 s per tick and a place for each tick, a trail ends before its first step of more than
        52 cm.
        """
        for length, (dx, dy) in enumerate(position.trail):
            # What lies beyond an impossible step hangs on it and is cut off too.
            if math.hypot(dx, dy) > self._longest_step_cm:
                return replace(position, trail=position.trail[:length])
        return position


class Peers(Mapping[int, Peer]):
    """The robots that one listener has heard of, by number, as far as they were heard at some tick or later."""

    def __init__(
        self, column: Mapping[int, int], numbers: NDArray[np.int64], cells: NDArray[np.void], since: int = 0
    ) -> None:
        """Show the robots that a listener has heard at tick `since` or later.

        `column` has the robots' columns by number, both ascending, and `numbers`, int64 (columns,), the numbers by
        column. `cells` is the listener's row, CELL (columns,), and is not copied: what is heard later shows.
        """
        self._column = column
        self._numbers = numbers
        self._cells = cells
        self._since = since
        self._lately: Columns | None = None

    def __getitem__(self, number: int) -> Peer:
        newest = self.said(number)
        return Peer(newest.sequence, newest.pose, self._cells["at"].item(self._column[number]))

    def __iter__(self) -> Iterator[int]:
        return compress(self._column, self._is_known.tolist())

    def __len__(self) -> int:
        return int(np.count_nonzero(self._is_known))

    def said(self, number: int) -> Position:
        """Return a robot's newest position, with the first place of its trail; `KeyError` where it was not heard."""
        cell = self._cells[self._column[number]]
        if cell["sequence"] == NOTHING or cell["at"] < self._since:
            raise KeyError(number)
        sequence, _, _, _, _, x, y, heading, back_x, back_y, *_ = cell.item()
        trail = ((back_x, back_y),) if back_x or back_y else ()
        return Position(number, sequence, 0, x, y, heading, trail=trail)

    def moving(self, number: int) -> Position:
        """Return a robot's newest position, with a trail: where it was a tick earlier if it moved straight.

        For example, a robot that has moved by 50 cm along x between its last two frames, a tick apart, has the trail
        ((-50, 0),).
        """
        newest, cell = self.said(number), self._cells[self._column[number]]
        return replace(newest, trail=((-round(cell.item()[-2]), -round(cell.item()[-1])),))

    @property
    def is_late(self) -> bool:
        """True if the newest frame of one of them had been on its way for a tick or longer when it came."""
        return bool(np.count_nonzero(self._is_known & (self._cells["at"] > self._cells["sequence"])))

    @property
    def columns(self) -> Columns:
        """The same robots in columns."""
        if self._lately is not None:
            return self._lately
        numbers, sequences, ticks = np.empty((3, len(self._column)), dtype=np.int64)
        places = np.empty((len(self._column), 2), dtype=np.float64)
        of_cells = self._cells, self._numbers, self._since, CM_PER_M
        count = columns_heard(*of_cells, numbers, sequences, ticks, places)
        return Columns(numbers[:count], sequences[:count], ticks[:count], places[:count])

    def lately(self, since: int) -> Peers:
        """List those that were heard at a tick or later; their columns are those of now."""
        peers = Peers(self._column, self._numbers, self._cells, since)
        peers._lately = peers.columns
        return peers

    def silent(self, since: int) -> Iterator[int]:
        """List the numbers of those that were not heard at a tick or later, ascending."""
        return compress(self._column, (self._is_known & (self._cells["at"] < since)).tolist())

    def oldest(self, now: int) -> int:
        """Return the earliest tick at which any of them was heard last; now where there are none.

        For example, 12 for robots last heard at ticks 15, 12 and 20.
        """
        return int(self._cells["at"][self._is_known].min(initial=now))

    @property
    def _is_known(self) -> NDArray[np.bool_]:
        is_heard: NDArray[np.bool_] = self._cells["sequence"] != NOTHING
        return is_heard if self._since <= 0 else is_heard & (self._cells["at"] >= self._since)


def _as_table(heard: Mapping[int, Sequence[bytes]]) -> tuple[Sequence[bytes], NDArray[np.uint8]]:
    """Tabulate all frames, each listener's in their order, and which hears which: uint8 (listeners, frames)."""
    if isinstance(heard, Heard):
        return heard.frames, heard.reaches.view(np.uint8)
    ends = np.cumsum([len(frames) for frames in heard.values()], dtype=np.int64)
    reaches = np.zeros((len(heard), int(ends[-1]) if len(heard) else 0), dtype=np.uint8)
    for row, (frames, end) in enumerate(zip(heard.values(), ends.tolist(), strict=True)):
        reaches[row, end - len(frames) : end] = 1
    return [frame for frames in heard.values() for frame in frames], reaches
