"""What follows from the positions heard in a run that goes on, by everybody or by one robot, worked out when wanted."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING, Final

from monitor.beliefs import GONE, frames_of
from monitor.observer import NOBODY, Listener, as_sent
from patrol.inbox import inbox_of
from patrol.journal import unpack
from patrol.message import Rejected, decode
from patrol.pose import Pose
from patrol.records import Status, TickRecord, frame_sequence, sent_at

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.fog import Fog
    from patrol.footprint import Footprint
    from patrol.scenario import Scenario
    from patrol.terrain import Terrain

HEARD: Final = "heard"
"""The fog of whoever hears every position that is sent."""

PAST = 256
"""Ticks whose frames are kept for those that arrive late."""


class Follower:
    """One listener, taken along a log of packed ticks that grows at its end and may lose its beginning.

    number: whose belief, None for somebody who hears every frame that is sent. area: bool (h, w), what it patrols. log:
    (k, packed record); `forget` is to be called whenever its first entry is taken away.
    """

    def __init__(
        self,
        number: int | None,
        scenario: Scenario,
        terrain: Terrain,
        footprint: Footprint,
        area: NDArray[np.bool_],
        key: bytes | None,
        log: Sequence[tuple[int, bytes]] | deque[tuple[int, bytes]],
    ) -> None:
        self._number = number
        self._scenario = scenario
        self._bounds = terrain.bounds
        self._footprint = footprint
        self._area = area
        self._key = key
        self._log = log
        self._done = 0
        self._past: deque[tuple[int, dict[tuple[int, int], bytes]]] = deque(maxlen=PAST)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._was = Status.ALIVE
        self._listener = self._new_listener()

    @property
    def behind(self) -> bool:
        """Whether there are ticks that it has not taken in."""
        return self._done < len(self._log)

    @property
    def fog(self) -> Fog:
        """What follows from the ticks taken in."""
        return self._listener.fog

    def forget(self) -> None:
        """The log has lost its first entry."""
        self._done = max(0, self._done - 1)

    def step(self) -> None:
        """Take in the next tick."""
        if not self._waiting:
            self._waiting.extend(islice(self._log, self._done, self._done + PAST))
        _, packed = self._waiting.popleft()
        self._done += 1
        record = unpack(packed)
        if not isinstance(record, TickRecord):
            return
        frames = frames_of(record)
        self._past.append((record.k, frames))
        if self._number is None:
            self._listener.hear(record.k, frames.values())
            return
        row = next(row for row in record.robots if row.number == self._number)
        if row.status.name.lower() not in GONE and self._was.name.lower() in (*GONE, "absent"):
            self._listener = self._new_listener()  # a new mind, which knows nothing
        self._was = row.status
        if row.status is Status.ALIVE:
            self._listener.look(record.k, self._own(record, frames, Pose(row.x, row.y, row.heading)))
            self._listener.hear(record.k, self._heard(record))

    def _own(self, record: TickRecord, frames: dict[tuple[int, int], bytes], true: Pose) -> Pose:
        """Where the robot takes itself to be, by the position that it has sent."""
        number = self._number or 0
        frame = frames.get((number, frame_sequence(record.k, 0)))
        try:
            if frame is not None and (position := decode(frame)).robot == number:
                return position.pose
        except Rejected:
            pass
        return as_sent(number, true)

    def _heard(self, record: TickRecord) -> list[bytes]:
        """The frames that reach the robot in this tick, in the order of arrival."""
        past = defaultdict(dict, self._past)
        found = (
            past[sent_at(sequence)].get((source, sequence))
            for source, to, sequence in record.deliveries
            if to == self._number
        )
        return [frame for frame in found if frame is not None]

    def _new_listener(self) -> Listener:
        own = NOBODY if self._number is None else self._number
        inbox = inbox_of(self._scenario, own, self._bounds, self._key)
        return Listener(self._footprint, self._area, inbox, self._scenario.step)
