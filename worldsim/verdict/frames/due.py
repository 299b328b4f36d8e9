"""The robots that should have sent a frame in a tick: all of them, or fewer where the fleet saves on its radio."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.radio.prediction import Predictor

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.radio.message import Position
    from patrol.scenario import Scenario
    from worldsim.run_record import RunRecord


@dataclass(slots=True)
class _Known:
    """The known state of a robot.

    since: the tick of its last frame or, where that is not known to be its process's, of the process's start.
    last: that frame's position; None where the process may not know it.
    """

    since: int
    last: Position | None = None


class DueFrames:
    """Finds frames that are missing in lockstep, where the world waits for all that a robot has to say.

    A robot that may not send in each tick is due when it wants to send for sure, and must have earned the longest frame
    since its last; where it sees an intruder, all that it can save. It may send earlier, so this says nothing about
    frames that are not missing.
    """

    def __init__(self, scenario: Scenario, terrain: Terrain, journal: RunRecord) -> None:
        """Begin before the first tick; a tick's events must be in the journal when the tick is asked about."""
        radio, share = scenario.radio, scenario.radio_share
        self._always = not radio.spares_frames
        self._silence = radio.silence_ticks(scenario.step)
        self._error = None if radio.adaptive is None else radio.adaptive.error
        self._earns_in = (0, 0) if share is None else (share.earns_frame_in, share.earns_most_in)
        self._predictor = Predictor(terrain, radio.trail_every, self._silence)
        self._journal = journal
        self._read = 0
        self._known: dict[int, _Known] = {}

    def missing(
        self, k: int, living: Mapping[int, Position], sent: Mapping[int, Position], seers: Collection[int]
    ) -> list[int]:
        """Return the numbers of the robots that should have sent a frame in a tick and have not.

        Ticks are asked about in turn. `living` says where each living robot takes itself to be, `seers` which robots
        see an intruder.
        """
        if self._always:
            return [number for number in living if number not in sent]
        for number in self._interrupted(k):
            self._known.pop(number, None)
        self._known = {number: self._known.get(number, _Known(k)) for number in living}
        for number, position in sent.items():
            self._known[number] = _Known(k, position)
        silent = [number for number in living if number not in sent]
        return [n for n in silent if self._due(self._known[n], living[n], sees=n in seers)]

    def _due(self, known: _Known, now: Position, *, sees: bool) -> bool:
        silent = now.sequence - known.since
        if silent < self._earns_in[sees]:
            return False
        if self._error is None or silent >= self._silence:
            return True
        return known.last is not None and self._predictor.error(known.last, now) > self._error

    def _interrupted(self, k: int) -> Iterator[int]:
        """Yield the robots that had an event since the tick before: their processes may be other ones."""
        events = self._journal.events
        while self._read < len(events) and events[self._read].k <= k:
            event = events[self._read]
            self._read += 1
            if event.robot is not None:
                yield event.robot
