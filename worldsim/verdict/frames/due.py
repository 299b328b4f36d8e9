"""Which robots should have sent a frame in a tick: all of them, or fewer where the fleet saves on its radio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.radio.prediction import Predictor
from patrol.scenario import share_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.ground.terrain import Terrain
    from patrol.journal.records import Event
    from patrol.radio.message import Position
    from patrol.scenario import Scenario


@dataclass(slots=True)
class _Known:
    """What is known of a robot.

    since: the tick of its last frame or, where that is not known to be its process's, of the process's start.
    last: what that frame said; None where it may not know what it said.
    """

    since: int
    last: Position | None = None


class DueFrames:
    """Finds frames that are missing in lockstep, where the world waits for all that a robot has to say.

    A robot that may not send in each tick is due when it wants to send for sure, and must have earned the longest frame
    since its last. It may send earlier, so this says nothing about frames that are not missing.
    """

    def __init__(self, scenario: Scenario, terrain: Terrain, events: Sequence[Event]) -> None:
        """Begin before the first tick.

        Args:
            scenario: The run's.
            terrain: Its ground.
            events: Of the run; those of a tick are there when the tick is asked about.
        """
        radio, share = scenario.radio, share_of(scenario)
        self._always = not radio.spares_frames
        self._silence = radio.silence_ticks(scenario.step)
        self._error = None if radio.adaptive is None else radio.adaptive.error
        self._earns_in = 0 if share is None else share.fills_in
        self._predictor = Predictor(terrain, radio.trail_every, self._silence)
        self._events = events
        self._read = 0
        self._known: dict[int, _Known] = {}

    def missing(self, k: int, living: Mapping[int, Position], said: Mapping[int, Position]) -> list[int]:
        """The robots that should have sent and have not.

        Args:
            k: The tick; each in turn.
            living: Where each living robot takes itself to be, by number.
            said: What each has sent.

        Returns:
            Their numbers.
        """
        if self._always:
            return [number for number in living if number not in said]
        for number in self._interrupted(k):
            self._known.pop(number, None)
        self._known = {number: self._known.get(number, _Known(k)) for number in living}
        for number, position in said.items():
            self._known[number] = _Known(k, position)
        return [number for number, now in living.items() if number not in said and self._due(self._known[number], now)]

    def _due(self, known: _Known, now: Position) -> bool:
        silent = now.sequence - known.since
        if silent < self._earns_in:
            return False
        if self._error is None or silent >= self._silence:
            return True
        return known.last is not None and self._predictor.error(known.last, now) > self._error

    def _interrupted(self, k: int) -> Iterator[int]:
        """The robots that something has happened to since the tick before: their processes may be other ones."""
        while self._read < len(self._events) and self._events[self._read].k <= k:
            event = self._events[self._read]
            self._read += 1
            if event.robot is not None:
                yield event.robot
