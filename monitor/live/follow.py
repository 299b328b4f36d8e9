"""What follows from the positions heard in a run that goes on, by everybody or by one robot, worked out when wanted."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection
from itertools import islice
from typing import TYPE_CHECKING, Final

from monitor.observer import NOBODY, Listener, as_sent, keep_outside
from monitor.replay.beliefs import GONE, frames_of
from patrol.journal import unpack
from patrol.journal.records import Status, TickRecord, frame_sequence, sent_at
from patrol.pose import Pose
from patrol.radio.inbox import inbox_of
from patrol.radio.message import Rejected, decode

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from monitor.source import Layer
    from patrol.ground.fog import Fog
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario

HEARD: Final = "heard"
"""The fog of whoever hears every position that is sent."""

PAST = 256
"""Ticks whose frames are kept for those that arrive late."""

KEPT_S = 10.0
"""For how long a belief is followed that nobody shows or asks for."""

Log = deque[tuple[int, bytes]]


class Follower:
    """One listener, taken along a log of packed ticks that grows at its end and may lose its beginning.

    number: whose belief, None for somebody who hears every frame that is sent. area: bool (h, w), what it patrols.
    patrolled: bool (h, w), what the fleet does. log: (k, packed record), one for each tick. since: its first tick.
    """

    def __init__(
        self,
        number: int | None,
        scenario: Scenario,
        terrain: Terrain,
        footprint: Footprint,
        area: NDArray[np.bool_],
        patrolled: NDArray[np.bool_],
        key: bytes | None,
        log: Log,
        since: int,
    ) -> None:
        self._number = number
        self._scenario = scenario
        self._bounds = terrain.bounds
        self._footprint = footprint
        self._area = area
        self._patrolled = patrolled
        self._key = key
        self._log = log
        self._next = 0
        self._past: deque[tuple[int, dict[tuple[int, int], bytes]]] = deque(maxlen=PAST)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._begin(since)

    @property
    def behind(self) -> bool:
        """Whether there are ticks that it has not taken in."""
        return bool(self._log) and self._next <= self._log[-1][0]

    @property
    def tick(self) -> int:
        """The last one taken in; where it has just begun, the one before that."""
        return max(self._next - 1, 0)

    @property
    def late(self) -> int | None:
        """By how many ticks it is behind; None where that is all that there is."""
        if not self.behind:
            return 0
        return self._log[-1][0] - self.tick if self._past else None

    @property
    def fog(self) -> Fog:
        """What follows from the ticks taken in."""
        return self._listener.fog

    def _begin(self, k: int) -> None:
        """Begin with tick k, knowing nothing of what was before."""
        self._next = self.since = k
        self._past.clear()
        self._was = Status.ALIVE
        self._listener = self._new_listener()

    def step(self) -> None:
        """Take in the next tick."""
        if not self._waiting:
            first = self._log[0][0]
            if self._next < first:  # forgotten before it was taken in
                self._begin(first)
            self._waiting.extend(islice(self._log, self._next - first, self._next - first + PAST))
        self._next, packed = self._waiting.popleft()
        self._next += 1
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
            self._listener = self._new_listener()
            self.since = 0  # a new mind: what it knows, which is nothing, is known
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
        listener = Listener(self._footprint, self._area, inbox, self._scenario.step)
        keep_outside(listener.fog, self._patrolled)
        return listener


class Followers:
    """Those that are wanted, each as long as it is. make: a new one, at the beginning of what is remembered."""

    def __init__(self, make: Callable[[Layer], Follower]) -> None:
        self._make = make
        self._all: dict[Layer, Follower] = {}
        self._asked: dict[Layer, float] = {}
        self._shown: frozenset[Layer] = frozenset()

    @property
    def behind(self) -> bool:
        """Whether some of them have ticks to take in."""
        return any(follower.behind for follower in self._all.values())

    def ask(self, layer: Layer, now_s: float) -> Follower:
        """The one for a fog, which is wanted at this time (s, of any clock)."""
        if layer not in self._all:
            self._all[layer] = self._make(layer)
        self._asked[layer] = now_s
        return self._all[layer]

    def keep(self, layers: Collection[Layer], now_s: float) -> None:
        """See `monitor.source.Source`; all of them are followed."""
        self._shown = frozenset(layers)
        for layer in layers:
            self.ask(layer, now_s)

    def since(self, layer: Layer) -> int:
        """See `monitor.source.Source`; 0 of one that is not followed."""
        return self._all[layer].since if layer in self._all else 0

    def tick(self, layer: Layer) -> int | None:
        """See `monitor.source.Source`; None of one that is not followed."""
        return self._all[layer].tick if layer in self._all else None

    def drop(self, now_s: float) -> None:
        """Nobody has shown some of them for long: each would cost all that is sent in every tick."""
        for layer in [layer for layer, asked in self._asked.items() if now_s > asked + KEPT_S]:
            if layer not in self._shown:
                del self._all[layer], self._asked[layer]

    def begin_anew(self) -> None:
        """What was remembered is gone."""
        self._all = {layer: self._make(layer) for layer in self._all}

    def catch_up(self, over: Callable[[], bool]) -> None:
        """Take in ticks until there are no more, or until it is over; who is served now is the last next time."""
        for layer in list(self._all):
            follower = self._all[layer] = self._all.pop(layer)
            while follower.behind:
                follower.step()
                if over():
                    return
