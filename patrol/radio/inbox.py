"""What a robot believes of the position frames it receives: every check between the radio and its belief.

Pure: the caller says what time its own clock shows. Senders' clocks may disagree with it, so a frame's age and a
sender's speed are judged by the receiver's clock at arrival; the sequence orders a sender's frames.

A sequence is the tick in which a frame was sent, and all robots of a fleet count the same ticks. So no frame can be of
a tick that is still to come, and whatever was forged or repeated, a robot's next frame is never out of date.

A radio may delay frames, repeat them and let them overtake each other. A frame that is older than the newest of its
sender's is *late*: it is accepted once, if it comes within a window of `patrol.radio.replay_window.SPAN` sequences, and
says only where the sender was then.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from patrol.radio.message import CONTACT, Position, Rejected, RejectReason, decode
from patrol.radio.replay_window import SPAN, ReplayWindow
from patrol.radio.units import cm_to_m, m_to_cm

# Rounding to centimetres moves each of two positions by up to 0.5 cm along each axis.
ROUNDING = 0.02
# Frames in a row that agree with each other before a jump is believed: localisation jumps honestly, once.
_STEADY = 3
# Who does not know the ticks can only hold a sender's frames against each other: how much further than its clock
# can have run a sequence may be, in steps. Covers stalls of the network.
_AHEAD = 64
# By how many steps a contact's sequence may differ from what some robot would send now; older replays are refused.
_CONTACT_SLACK = 4


@dataclass(slots=True)
class _Heard:
    """A frame and when it came by the receiver's clock (s)."""

    position: Position
    at: float


@dataclass(slots=True)
class History:
    """What an inbox knows of one sender.

    Attributes:
        last: Its newest accepted position.
        at: When that came, by the receiver's clock, s.
        window: Which of its last sequences have come.
        start: When its sequence 0 would have come, had it taken as long as its quickest frame, s.
    """

    last: Position
    at: float
    window: ReplayWindow
    start: float


class Inbox:
    """Decodes frames and drops, with a counted reason, what cannot be true.

    What follows the last frame of a sender must be a place that it can have reached; where it is not, frames that agree
    with each other are believed in the end, because localisation may jump honestly. The time that a sender had is the
    time between the arrivals and, where the earlier frame was delayed, what the sequences say on top: a frame's delay,
    beyond the least of its sender's frames so far, shows in its sequence. A trail is cut off where it leads farther in
    a step than a robot can go.

    A contact, an intruder's position, does not say who reports it and may be reported by several at once. It must lie
    on the terrain, and its sequence must be one that some robot of the roster would send about now, going on from that
    robot's last accepted frame.

    Args:
        own: The receiver's robot number.
        roster: The numbers of all robots.
        bounds: The terrain's (x_min, y_min, x_max, y_max), m.
        max_speed: Of the fastest robot, m/s.
        key: Of the tags, or None when the fleet uses none.
        step: s between two frames of a sender; a frame may come one step early or late.
        ahead: By how many ticks a sequence may be ahead of the receiver's own, which is the time by its clock in steps;
            None where the two are not counted from the same moment. Then frames too far ahead of their sender's last,
            and too old ones, are believed too, once enough of them agree with each other: what a forged one has shut
            out comes back.
        trail_every: Ticks between the places of a trail.

    Attributes:
        counts: Frames dropped so far, by reason.
        rejected: Frames dropped so far, for any reason.
        trail_every: Ticks between the places of a trail.
    """

    def __init__(
        self,
        own: int,
        roster: Iterable[int],
        bounds: tuple[float, float, float, float],
        max_speed: float,
        key: bytes | None = None,
        step: float = 0.5,
        ahead: int | None = 0,
        trail_every: int = 1,
    ) -> None:
        self.trail_every = trail_every
        self.counts: dict[RejectReason, int] = dict.fromkeys(RejectReason, 0)
        self.rejected = 0
        self._own = own
        self._roster = frozenset(roster)
        x_min, y_min, x_max, y_max = bounds
        self._bounds = x_min - ROUNDING, y_min - ROUNDING, x_max + ROUNDING, y_max + ROUNDING
        self._max_speed = max_speed
        self._key = key
        self._step = step
        self._ahead = ahead
        self._last: dict[int, _Heard] = {}
        self._windows: dict[int, ReplayWindow] = {}
        self._starts: dict[int, float] = {}
        self._jumped: dict[int, list[_Heard]] = {}

    def plain(self, frame: bytes, now_s: float) -> Position | None:
        """The position in a frame that passes every check which is the same for all receivers of a fleet.

        What is left to check of it is whether it follows from what was heard of its sender, and is not the receiver's
        own.

        Args:
            frame: Any bytes.
            now_s: When it came by the receivers' clocks, s.

        Returns:
            The position of a robot without a trail; None for any other frame.
        """
        try:
            position = decode(frame, self._key)
            self._check_place(position)
            self._check_tick(position, now_s)
        except Rejected:
            return None
        return None if position.trail or position.robot not in self._roster else position

    def decoded(self, frame: bytes) -> Position | None:
        """What a frame says, whether or not it can be true; None where it cannot be decoded.

        Args:
            frame: Any bytes.
        """
        try:
            return decode(frame, self._key)
        except Rejected:
            return None

    def doubts(self, robot: int) -> bool:
        """Whether the last frames of a sender did not follow from those before.

        Args:
            robot: Its number.
        """
        return robot in self._jumped

    def release(self, robot: int) -> History | None:
        """Forget what was heard of a sender, but for its frames that are in doubt.

        Args:
            robot: Its number.

        Returns:
            What was forgotten, None where there was nothing.
        """
        heard = self._last.pop(robot, None)
        window = self._windows.pop(robot, None)
        if heard is None or window is None:
            return None
        return History(heard.position, heard.at, window, self._starts.pop(robot))

    def resume(self, history: History) -> None:
        """Go on from what was heard of a sender.

        Args:
            history: From `release`.
        """
        robot = history.last.robot
        self._last[robot] = _Heard(history.last, history.at)
        self._windows[robot] = history.window
        self._starts[robot] = history.start

    def accept(self, frame: bytes, now_s: float) -> Position | None:
        """Decode a frame and check it.

        The caller recognises a late position by its sequence, which is below that of an earlier one of its sender's.

        Args:
            frame: Any bytes.
            now_s: When it came by the receiver's clock, s; never decreasing.

        Returns:
            The position, or None when the frame is dropped.
        """
        try:
            position = decode(frame, self._key)
            if position.robot != CONTACT:
                self._check_sender(position)
            self._check_place(position)
            self._check_tick(position, now_s)
            if position.robot == CONTACT:
                self._check_contact(_Heard(position, now_s))
            else:
                self._check_motion(_Heard(position, now_s))
        except Rejected as rejected:
            self.counts[rejected.reason] += 1
            self.rejected += 1
            return None
        return self._plausible_trail(position)

    def last(self, robot: int) -> tuple[Position, float] | None:
        """The newest accepted position of a robot.

        Args:
            robot: Its number.

        Returns:
            The position and when it came (own clock, s), or None.
        """
        heard = self._last.get(robot)
        return None if heard is None else (heard.position, heard.at)

    def _check_sender(self, position: Position) -> None:
        if position.robot == self._own:
            raise Rejected(RejectReason.OWN, "a frame under this robot's own number")
        if position.robot not in self._roster:
            raise Rejected(RejectReason.UNKNOWN, f"robot {position.robot} is not in the roster")

    def _check_place(self, position: Position) -> None:
        x_min, y_min, x_max, y_max = self._bounds
        for x, y in ((cm_to_m(position.x_cm), cm_to_m(position.y_cm)), *position.past):
            if not (x_min <= x <= x_max and y_min <= y <= y_max):
                raise Rejected(RejectReason.OUTSIDE, f"({x}, {y}) is off the terrain")

    def _check_tick(self, position: Position, now_s: float) -> None:
        # Half a step is for rounding: ticks are whole.
        if self._ahead is not None and position.sequence > now_s / self._step + self._ahead + 0.5:
            raise Rejected(RejectReason.AHEAD, "from a tick that is still to come")

    def _check_motion(self, heard: _Heard) -> None:
        """Believe what follows the last accepted frame, or `_STEADY` frames in a row that follow one another."""
        robot, sequence = heard.position.robot, heard.position.sequence
        last = self._last.get(robot)
        window = self._windows.setdefault(robot, ReplayWindow())
        outdated = window.newest - sequence >= SPAN
        if not window.fresh(sequence) and not (outdated and self._ahead is None):
            raise Rejected(RejectReason.OLD, "heard before, or too old to be checked")
        if last is not None:
            if sequence < last.position.sequence and not outdated:
                self._check_late(heard.position, last.position)
                window.use(sequence)
                return
            reason = RejectReason.OLD if outdated else self._implausible(last, heard)
            if reason is not None:
                row = self._jumped.get(robot, [])
                row = [*row, heard] if row and self._follows(row[-1], heard) else [heard]
                self._jumped[robot] = row
                if len(row) < _STEADY:
                    raise Rejected(reason, "does not follow the last one")
        if outdated:
            self._windows[robot] = window = ReplayWindow()
            del self._starts[robot]
        self._jumped.pop(robot, None)
        self._last[robot] = heard
        self._starts[robot] = min(self._start_of(heard), self._starts.get(robot, math.inf))
        window.use(sequence)

    def _check_late(self, late: Position, newest: Position) -> None:
        """A late frame is judged by how many steps it lies before the newest: only its place is new."""
        steps = newest.sequence - late.sequence
        if _apart(late, newest) > self._max_speed * (steps + 1) * self._step + ROUNDING:
            raise Rejected(RejectReason.TOO_FAST, "does not lead to the newest one")

    def _plausible_trail(self, position: Position) -> Position:
        """The position with as much of its trail as a robot can have driven."""
        limit = m_to_cm(self._max_speed * self._step * self.trail_every + ROUNDING)
        for place, (dx, dy) in enumerate(position.trail):
            if math.hypot(dx, dy) > limit:
                return replace(position, trail=position.trail[:place])
        return position

    def _check_contact(self, heard: _Heard) -> None:
        if not self._last:
            raise Rejected(RejectReason.UNKNOWN, "a contact, and no robot that could report it has been heard")
        leads = [
            heard.position.sequence - last.position.sequence - (heard.at - last.at) / self._step
            for last in self._last.values()
        ]
        lead = min(leads, key=abs)
        if abs(lead) > _CONTACT_SLACK:
            raise Rejected(
                RejectReason.AHEAD if lead > 0.0 else RejectReason.OLD, "no robot would report a contact of then"
            )

    def _follows(self, before: _Heard, after: _Heard) -> bool:
        return after.position.sequence > before.position.sequence and self._implausible(before, after) is None

    def _implausible(self, before: _Heard, after: _Heard) -> RejectReason | None:
        elapsed = after.at - before.at
        steps = after.position.sequence - before.position.sequence
        if self._ahead is None and steps > 2.0 * elapsed / self._step + _AHEAD:
            return RejectReason.AHEAD
        held_up = min(max(steps * self._step - elapsed, 0.0), self._delay(before))
        if _apart(before.position, after.position) > self._max_speed * (elapsed + held_up + self._step) + ROUNDING:
            return RejectReason.TOO_FAST
        return None

    def _start_of(self, heard: _Heard) -> float:
        """When the sender's sequence 0 would have come, had it taken as long as this frame."""
        return heard.at - heard.position.sequence * self._step

    def _delay(self, heard: _Heard) -> float:
        """How much longer than the quickest of its sender's frames a frame took, s; no more than the window holds."""
        quickest = self._starts.get(heard.position.robot, math.inf)
        return min(max(self._start_of(heard) - quickest, 0.0), SPAN * self._step)


def _apart(a: Position, b: Position) -> float:
    """The distance between two places, m."""
    return cm_to_m(math.hypot(b.x_cm - a.x_cm, b.y_cm - a.y_cm))
