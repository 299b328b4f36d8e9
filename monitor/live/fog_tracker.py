"""The fogs that follow from positions heard in a running fleet, by a robot or an ideal listener, computed on demand."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from itertools import islice
from typing import TYPE_CHECKING, Final

from monitor.observation.listener import NO_ROBOT, BeliefFollower, Listener
from patrol.journal import unpack
from patrol.journal.records import TickRecord

if TYPE_CHECKING:
    from monitor.observation.source import Layer
    from patrol.ground.fog import Fog

HEARD: Final = "heard"
"""The layer of an ideal listener, which hears every position that is sent."""

PAST = 256
"""Ticks whose frames are kept for late deliveries."""

KEPT_S = 10.0
"""Time for which a fog that no page shows is kept up to date, s of wall time."""

Log = deque[tuple[int, bytes]]


class FogTracker:
    """Computes one fog from a log of packed ticks, which grows at its end and may lose its beginning.

    `since` is the tick from which on the fog is known.
    """

    def __init__(self, number: int, make: Callable[[int], Listener], log: Log, since: int) -> None:
        """Start without knowledge.

        `number` is the robot whose belief it is; `NO_ROBOT` for a listener that hears every frame that is sent. `make`
        gives its listener, and `log` has (k, packed record) for each tick from `since` on.
        """
        self._number = number
        self._make = make
        self._log = log
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._begin_at(since)

    @property
    def behind(self) -> bool:
        """True if the log has ticks that are not processed yet."""
        return bool(self._log) and self._next <= self._log[-1][0]

    @property
    def tick(self) -> int:
        """The last tick processed; after a new start, the one before the first."""
        return max(self._next - 1, 0)

    @property
    def late(self) -> int | None:
        """The number of ticks by which it is behind; None before the first."""
        if not self.behind:
            return 0
        return self._log[-1][0] - self.tick if self._begun else None

    @property
    def fog(self) -> Fog:
        """The fog after `tick`."""
        return self._beliefs.listeners[self._number].fog

    def _begin_at(self, k: int) -> None:
        """Start at tick k without knowledge."""
        self._next, self._begun = k, False
        self._beliefs = BeliefFollower([self._number], self._new_listener, PAST)
        self.since = k

    def step(self) -> None:
        """Process the next tick."""
        if not self._waiting:
            first = self._log[0][0]
            if self._next < first:  # the log has dropped it unprocessed
                self._begin_at(first)
            self._waiting.extend(islice(self._log, self._next - first, self._next - first + PAST))
        self._next, packed = self._waiting.popleft()
        self._next += 1
        record = unpack(packed)
        if not isinstance(record, TickRecord):
            return
        self._begun = True
        self._beliefs.tick(record)
        if self._number == NO_ROBOT:
            self._beliefs.listeners[NO_ROBOT].hear(record.k, [frame for _, frame in record.frames])

    def _new_listener(self, number: int) -> Listener:
        self.since = 0  # a new mind starts without knowledge, so its fog is known completely
        return self._make(number)


class FogTrackers:
    """The trackers of all fogs in demand."""

    def __init__(self, make: Callable[[Layer], FogTracker]) -> None:
        """Start without trackers; `make` returns one that starts at the beginning of the log."""
        self._make = make
        self._by_layer: dict[Layer, FogTracker] = {}
        self._used: dict[Layer, float] = {}
        self._shown: frozenset[Layer] = frozenset()

    @property
    def behind(self) -> bool:
        """True if some tracker has unprocessed ticks."""
        return any(tracker.behind for tracker in self._by_layer.values())

    def track(self, layer: Layer, now_s: float) -> FogTracker:
        """Return the tracker of a fog; made when there is none."""
        if layer not in self._by_layer:
            self._by_layer[layer] = self._make(layer)
        self._used[layer] = now_s
        return self._by_layer[layer]

    def set_shown(self, layers: Collection[Layer], now_s: float) -> None:
        """Set which fogs pages show."""
        self._shown = frozenset(layers)
        for layer in layers:
            self.track(layer, now_s)

    def since(self, layer: Layer) -> int:
        """See `monitor.observation.source.Source`; 0 without a tracker."""
        return self._by_layer[layer].since if layer in self._by_layer else 0

    def tick(self, layer: Layer) -> int | None:
        """See `monitor.observation.source.Source`; None without a tracker."""
        return self._by_layer[layer].tick if layer in self._by_layer else None

    def drop(self, now_s: float) -> None:
        """Drop trackers that were not in demand for `KEPT_S`; each would process every frame of every tick."""
        for layer in [layer for layer, used in self._used.items() if now_s > used + KEPT_S]:
            if layer not in self._shown:
                del self._by_layer[layer], self._used[layer]

    def restart(self) -> None:
        """Replace all trackers by new ones, after the log was cleared."""
        self._by_layer = {layer: self._make(layer) for layer in self._by_layer}

    def catch_up(self, over: Callable[[], bool]) -> None:
        """Process ticks until none is left or `over` says to stop.

        The tracker that is served first now is served last next time.
        """
        for layer in list(self._by_layer):
            # A dict keeps its order, so one that is taken out and put back is last.
            tracker = self._by_layer[layer] = self._by_layer.pop(layer)
            while tracker.behind:
                tracker.step()
                if over():
                    return
