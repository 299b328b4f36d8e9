"""The points of a run's closures, and which of them are closed or wait to close by the journal's events."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.closures.ground import ChangingFootprint
from patrol.closures.spec import ClosureSpec, closure_points
from patrol.ground.terrain import Terrain
from patrol.journal.records import CLOSED, OPENED, STAYS_OPEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import BoolGrid
    from patrol.journal.records import Event

WAITING, WAITS, IN_IT = "waiting", " waits to close: ", " in it"
"""The kind of the event of a closure that waits until bodies are clear of it, and what stands before and after the
robots that are in the way."""


def closure_of(event: Event) -> str:
    """Return the name of the closure that an event is about; empty for any other event."""
    if event.kind in (CLOSED, OPENED, STAYS_OPEN):
        return event.detail
    name, waits, _ = event.detail.partition(WAITS)
    return name if waits and event.kind == WAITING else ""


def with_closed(terrain: Terrain, closures: Sequence[ClosureSpec]) -> Terrain:
    """Return the ground with some closures closed."""
    passable = terrain.passable.copy()
    for closure in closures:
        passable.reshape(-1)[closure_points(closure, terrain)] = False
    return Terrain(terrain.name, passable, terrain.point, terrain.origin)


class ClosedPoints:
    """The points that are closed, event by event.

    `grid`, bool (height, width), is True on points that are closed now, and `points` has the flat indices of each
    closure by name. `names` are the closures that are closed, `waiting` those that wait until bodies are clear of them.
    """

    def __init__(self, closures: Sequence[ClosureSpec], terrain: Terrain) -> None:
        """Begin with nothing closed."""
        self.points = {closure.name: closure_points(closure, terrain) for closure in closures}
        self.names: set[str] = set()
        self.waiting: set[str] = set()
        self.grid: BoolGrid = np.zeros(terrain.shape, dtype=np.bool_)

    def take(self, event: Event) -> bool:
        """Take in an event of a closure; return False for an event about anything else."""
        if (name := closure_of(event)) not in self.points:
            return False
        if event.kind == WAITING:
            self.waiting.add(name)
            return True
        self.waiting.discard(name)
        if event.kind == CLOSED:
            self.names.add(name)
        else:
            self.names.discard(name)
        self.grid = _mark_points(self.points, self.names, self.grid.shape)
        return True


class Closings:
    """The points that are closed at any tick of a run so far; `now` is the state after the last event."""

    def __init__(self, closures: Sequence[ClosureSpec], terrain: Terrain, events: Iterable[Event] = ()) -> None:
        """Take in the events so far."""
        self.now = ClosedPoints(closures, terrain)
        self._ticks: list[int] = [0]
        self._names: list[frozenset[str]] = [frozenset()]
        self._waiting: list[frozenset[str]] = [frozenset()]
        self._grid: tuple[frozenset[str], BoolGrid] = frozenset(), self.now.grid
        self._shown: tuple[Footprint, frozenset[str]] | None = None
        self.take(events)

    def take(self, events: Iterable[Event]) -> None:
        """Take in events that follow on those so far."""
        for event in events:
            if self.now.take(event):
                self._ticks.append(event.k)
                self._names.append(frozenset(self.now.names))
                self._waiting.append(frozenset(self.now.waiting))

    def show(self, k: int, footprint: Footprint) -> None:
        """Close on a sensor's ground the closures of a tick.

        Nothing else may close that ground.
        """
        shown = footprint, self.names(k)
        if isinstance(footprint, ChangingFootprint) and shown != self._shown:
            footprint.close(self.grid(k))
            self._shown = shown

    def at(self, k: int) -> tuple[frozenset[str], frozenset[str]]:
        """Return the closures that are closed in a tick, and those that wait until bodies are clear of them."""
        index = bisect_right(self._ticks, k) - 1
        return self._names[index], self._waiting[index]

    def names(self, k: int) -> frozenset[str]:
        """Return the closures that are closed in a tick."""
        return self.at(k)[0]

    def grid(self, k: int) -> BoolGrid:
        """Return the points that are closed in a tick, bool (height, width)."""
        names = self.names(k)
        if names != self._grid[0]:
            self._grid = names, _mark_points(self.now.points, names, self.now.grid.shape)
        return self._grid[1]


def _mark_points(points: Mapping[str, NDArray[np.int64]], names: Iterable[str], shape: tuple[int, ...]) -> BoolGrid:
    """Return a grid of the points of some closures."""
    grid = np.zeros(shape, dtype=np.bool_)
    for name in names:
        grid.reshape(-1)[points[name]] = True
    return grid
