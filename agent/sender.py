"""The frames of one robot in a tick: its position and the intruders that it sees, or none where they may wait.

Where the fleet saves on its radio (`radio.budget`, `radio.adaptive`), a robot sends when the others' prediction of it
is off, when it sees other intruders than before, or when it has been silent for long enough, as soon as its share of
the budget holds the frame. Its trail then reaches back to its last frame, so that a lost frame takes its looks with it.
"""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from patrol.radio.allowance import Allowance
from patrol.radio.message import MAX_CONTACTS, Position, encode

if TYPE_CHECKING:
    from patrol.exchange import Sensed
    from patrol.radio.allowance import Share
    from patrol.radio.peers import Predictor

Places = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Sending:
    """The rules by which the robots of a fleet send."""

    trail: int  # most past positions sent along
    trail_every: int = 1  # ticks between them
    share: Share | None = None  # of the fleet's budget; None without one
    error: float | None = None  # by which a prediction may be off before its robot sends, m; None: send when it may
    silence: int = 1  # ticks after which a robot sends anyway
    predictor: Predictor | None = None


class Sender:
    """Makes the frames of one robot. Call `frames` once a tick, the ticks counting up."""

    def __init__(self, number: int, sending: Sending, key: bytes | None) -> None:
        """Begin with nothing sent."""
        self._number = number
        self._sending = sending
        self._key = key
        self._allowance = None if sending.share is None else Allowance(sending.share)
        self._track: deque[tuple[int, int]] = deque(maxlen=sending.trail * sending.trail_every + 1)
        self._framed = -1
        self._last: Position | None = None
        self._reported: Places = ()
        self._turn = 0

    def frames(self, sensed: Sensed) -> tuple[bytes, ...]:
        """Make the frames that the robot sends in a tick."""
        position = Position.of(self._number, sensed.k, sensed.clock_s, sensed.pose)
        self._note_position(position)
        spots = sensed.contacts[:MAX_CONTACTS]
        if self._allowance is not None:
            self._allowance.earn(sensed.k)
            spots = self._in_turn(spots)
        if not self._has_news(position, spots):
            return ()
        position, frame = self._fit_trail(position)
        contacts = [encode(Position.of_contact(sensed.k, sensed.clock_s, x, y), self._key) for x, y in spots]
        frames = self._affordable_frames((frame, *contacts))
        if frames:
            self._last = position
            if spots or self._reported:
                reported = spots[: len(frames) - 1]
                self._reported = tuple(spot for spot in spots if spot in reported or spot in self._reported)
                self._turn += len(reported)
        return frames

    def _in_turn(self, seen: Places) -> Places:
        """Sort intruders: first those that are not reported yet, and whose turn it is, since not all may fit."""
        first = self._turn % len(seen) if seen else 0
        return tuple(sorted((*seen[first:], *seen[:first]), key=self._reported.__contains__))

    def _note_position(self, position: Position) -> None:
        if position.sequence != self._framed + 1:
            # Receivers date a trail's places by counting ticks back.
            self._track.clear()
        self._framed = position.sequence
        self._track.appendleft((position.x_cm, position.y_cm))

    def _has_news(self, position: Position, seen: Places) -> bool:
        sending, last = self._sending, self._last
        if sending.error is None or sending.predictor is None or last is None:
            return True
        silent = position.sequence - last.sequence
        return (
            silent >= sending.silence
            or set(seen) != set(self._reported)
            or sending.predictor.error(last, position) > sending.error
        )

    def _fit_trail(self, position: Position) -> tuple[Position, bytes]:
        """Return the position with as much of its trail as is of use and fits into a frame, and the frame."""
        if len(self._track) == 1:  # no trail, as of a fleet that sends none
            return position, encode(position, self._key)
        sending = self._sending
        places = list(self._track)[:: sending.trail_every]
        steps = tuple((old[0] - new[0], old[1] - new[1]) for new, old in itertools.pairwise(places))
        if self._last is not None and (sending.share is not None or sending.error is not None):
            # One step shows the others how fast the robot is, even where it reports nothing new.
            steps = steps[: max(1, (position.sequence - self._last.sequence - 1) // sending.trail_every)]
        while True:
            trailed = replace(position, trail=steps) if steps else position
            frame = encode(trailed, self._key)
            if not steps or sending.share is None or len(frame) <= sending.share.frame:
                return trailed, frame
            steps = steps[:-1]

    def _affordable_frames(self, frames: tuple[bytes, ...]) -> tuple[bytes, ...]:
        """Return the frames that may be sent now: all, or as many as can be saved up for; none while waiting pays."""
        allowance = self._allowance
        if allowance is None:
            return frames
        if not allowance.suffices(map(len, frames)):
            return ()
        return tuple(itertools.takewhile(lambda frame: allowance.take(len(frame)), frames))
