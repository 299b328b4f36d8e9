"""What a robot believes of the position frames it receives: every check between the radio and its belief.

Pure: the caller says what time its own clock shows. Senders' clocks may disagree with it, so a frame's age and a
sender's speed are judged by the receiver's clock at arrival; the sequence orders a sender's frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from patrol.message import CONTACT, Position, Rejected, RejectReason, decode

# Rounding to centimetres moves each of two positions by up to 0.5 cm along each axis.
_ROUNDING = 0.02
# Frames in a row that agree with each other before a jump is believed: localisation jumps honestly, once.
_STEADY = 3
# How much further than its sender's clock can have run a sequence may be, in steps: covers stalls of the network.
_AHEAD = 64
# How many steps a contact may be off what some robot would send now: a replayed one ends after so many.
_CONTACT_SLACK = 4


@dataclass(slots=True)
class _Heard:
    """A frame and when it came by the receiver's clock (s)."""

    position: Position
    at: float


class Inbox:
    """Decodes frames and drops, with a counted reason, what cannot be true.

    own: the receiver's robot number. roster: the numbers of all robots. bounds: the terrain's (x_min, y_min, x_max,
    y_max), m. max_speed: of the fastest robot, m/s. step: s between two frames of a sender; a frame may come one step
    early or late. key: of the tags, or None when the fleet uses none.

    A contact, an intruder's position, does not say who reports it and may be reported by several at once. It must lie
    on the terrain, and its sequence must be one that some robot of the roster would send about now, going on from that
    robot's last accepted frame.
    """

    def __init__(
        self,
        own: int,
        roster: Iterable[int],
        bounds: tuple[float, float, float, float],
        max_speed: float,
        key: bytes | None = None,
        step: float = 0.5,
    ) -> None:
        self.counts: dict[RejectReason, int] = dict.fromkeys(RejectReason, 0)
        self.accepted = 0
        self._own = own
        self._roster = frozenset(roster)
        self._bounds = bounds
        self._max_speed = max_speed
        self._key = key
        self._step = step
        self._last: dict[int, _Heard] = {}
        self._jumped: dict[int, list[_Heard]] = {}

    @property
    def rejected(self) -> int:
        """Frames dropped so far, for any reason."""
        return sum(self.counts.values())

    def accept(self, frame: bytes, now_s: float) -> Position | None:
        """The position in a frame that came at now_s (own clock, s, never decreasing), or None when it is dropped."""
        try:
            position = decode(frame, self._key)
            if position.robot == CONTACT:
                self._check_place(position)
                self._check_contact(_Heard(position, now_s))
            else:
                self._check_sender(position)
                self._check_place(position)
                self._check_motion(_Heard(position, now_s))
        except Rejected as rejected:
            self.counts[rejected.reason] += 1
            return None
        self.accepted += 1
        return position

    def last(self, robot: int) -> tuple[Position, float] | None:
        """The newest accepted position of a robot and when it came (own clock, s), or None."""
        heard = self._last.get(robot)
        return None if heard is None else (heard.position, heard.at)

    def _check_sender(self, position: Position) -> None:
        if position.robot == self._own:
            raise Rejected(RejectReason.OWN, "a frame under this robot's own number")
        if position.robot not in self._roster:
            raise Rejected(RejectReason.UNKNOWN, f"robot {position.robot} is not in the roster")

    def _check_place(self, position: Position) -> None:
        x_min, y_min, x_max, y_max = self._bounds
        pose = position.pose
        for x, y in ((pose.x, pose.y), *position.past):
            inside_x = x_min - _ROUNDING <= x <= x_max + _ROUNDING
            if not (inside_x and y_min - _ROUNDING <= y <= y_max + _ROUNDING):
                raise Rejected(RejectReason.OUTSIDE, f"({x}, {y}) is off the terrain")

    def _check_motion(self, heard: _Heard) -> None:
        """Believe what follows the last accepted frame, or `_STEADY` frames in a row that follow one another."""
        robot = heard.position.robot
        last = self._last.get(robot)
        if last is not None:
            if heard.position.sequence <= last.position.sequence:
                raise Rejected(RejectReason.OLD, "not newer than the last one")
            reason = self._implausible(last, heard)
            if reason is not None:
                row = self._jumped.get(robot, [])
                row = [*row, heard] if row and self._follows(row[-1], heard) else [heard]
                self._jumped[robot] = row
                if len(row) < _STEADY:
                    raise Rejected(reason, "does not follow the last one")
        self._jumped.pop(robot, None)
        self._last[robot] = heard

    def _check_contact(self, heard: _Heard) -> None:
        if not self._last:
            raise Rejected(RejectReason.UNKNOWN, "a contact, and no robot has been heard that could report it")
        leads = [
            heard.position.sequence - last.position.sequence - (heard.at - last.at) / self._step
            for last in self._last.values()
        ]
        lead = min(leads, key=abs)
        if abs(lead) > _CONTACT_SLACK:
            raise Rejected(
                RejectReason.AHEAD if lead > 0.0 else RejectReason.OLD, "nobody reports contacts of then now"
            )

    def _follows(self, before: _Heard, after: _Heard) -> bool:
        return after.position.sequence > before.position.sequence and self._implausible(before, after) is None

    def _implausible(self, before: _Heard, after: _Heard) -> RejectReason | None:
        elapsed = after.at - before.at
        steps = after.position.sequence - before.position.sequence
        if steps > 2.0 * elapsed / self._step + _AHEAD:
            return RejectReason.AHEAD
        a, b = before.position.pose, after.position.pose
        if math.hypot(b.x - a.x, b.y - a.y) > self._max_speed * (elapsed + self._step) + _ROUNDING:
            return RejectReason.TOO_FAST
        return None
