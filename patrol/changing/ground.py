"""Ground some of whose points are closed for now: the points that a sensor sees, and those that events of a run close.

A robot that stands before a closed door sees the points up to it, and that the door's own points are blocked:

    . . . . # . .        R robot      . in sight
    . R . . x           x closed     the x beside a point in sight are its *face*, which the robot sees blocked
    . . . . x           blank: neither seen nor known
    . . . . # . .

The world shows a robot the faces, and the robot's own view of the ground without the points that it believes blocked
ends at the same points. So both use the code here.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import Footprint, View
from patrol.ground.terrain import BoolGrid, Terrain, frozen_grid
from patrol.journal.records import CLOSED, OPENED, STAYS_OPEN
from patrol.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Iterable

    from patrol.journal.records import Event


Parts = Mapping[str, NDArray[np.int64]]
"""The points of a terrain that close and open together, by the part's name, as ascending flat indices."""


class ChangingTerrain(Terrain):
    """A terrain of which points close and open: they stop bodies and sight while they are closed."""

    base: Terrain  # the terrain with nothing closed

    def __init__(self, base: Terrain) -> None:
        """Begin with nothing closed."""
        super().__init__(base.name, base.passable, base.point, base.origin, base.keep_out, base.source)
        vars(self)["base"] = base

    def close(self, closed: BoolGrid) -> None:
        """Close some points, and open all others."""
        vars(self)["passable"] = frozen_grid(self.base.passable & ~closed)
        # They are cached properties of the grid that has just changed.
        for derived in ("free", "blocked", "room"):
            vars(self).pop(derived, None)


class ChangingFootprint(Footprint):
    """A sensor on ground of which points close and open.

    `closed`, bool (height, width), is True on points that are closed now.
    """

    terrain: ChangingTerrain  # the ground as it is now
    changes = True

    def __init__(self, make: Callable[[Terrain], Footprint], terrain: Terrain) -> None:
        """Begin with nothing closed; `make` is called again whenever the ground changes."""
        self._make = make
        self.terrain = ChangingTerrain(terrain)
        self.closed: BoolGrid = np.zeros(terrain.shape, dtype=np.bool_)
        self._now = now = make(self.terrain)
        self.range_m, self.radius, self.line_of_sight = now.range_m, now.radius, now.line_of_sight
        self.all_round, self.leaves_age = now.all_round, now.leaves_age

    def visible(self, pose: Pose) -> View:
        """The points seen from a pose, as doors are closed now."""
        return self._now.visible(pose)

    def close(self, closed: BoolGrid) -> None:
        """Close some points, and open all others; `closed` is copied."""
        # Making the sensor anew costs far more than the comparison.
        if np.array_equal(closed, self.closed):
            return
        self.closed = closed.copy()
        self.terrain.close(closed)
        self._now = self._make(self.terrain)


def faces(view: View, closed: BoolGrid) -> NDArray[np.int64]:
    """Return the closed points that a view shows to be closed, as ascending flat indices.

    Those are the ones in it, or beside a point in it, diagonally too.

    For example, in a row of four points with the last one closed, a view of the first three shows the face 3.
    """
    box = view.box(closed.shape)
    if box is None:
        return np.zeros(0, dtype=np.int64)
    first, last, left, right = box
    near = closed[first : last + 1, left : right + 1]
    if not near.any():
        return np.zeros(0, dtype=np.int64)
    # By one point on each side, so that the eight neighbours need no checks of bounds.
    visible = np.pad(
        view.mask[first - view.row0 : last + 1 - view.row0, left - view.col0 : right + 1 - view.col0] != 0, 1
    )
    across = visible[:, :-2] | visible[:, 1:-1] | visible[:, 2:]
    rows, cols = np.nonzero(near & (across[:-2] | across[1:-1] | across[2:]))
    return np.asarray((rows + first) * closed.shape[1] + cols + left, dtype=np.int64)


WAITING, WAITS, IN_IT = "waiting", " waits to close: ", " in it"
"""The kind of the event of a part that waits until bodies are clear of it, and what stands before and after the robots
that are in the way."""


def part_of(event: Event) -> str:
    """Return the name of the part of the ground that an event closes or opens; empty for any other event."""
    if event.kind in (CLOSED, OPENED, STAYS_OPEN):
        return event.detail
    name, waits, _ = event.detail.partition(WAITS)
    return name if waits and event.kind == WAITING else ""


def with_closed(terrain: Terrain, parts: Iterable[NDArray[np.int64]]) -> Terrain:
    """Return the ground with some parts closed, given by their points."""
    passable = terrain.passable.copy()
    for points in parts:
        passable.reshape(-1)[points] = False
    return Terrain(terrain.name, passable, terrain.point, terrain.origin)


class ClosedPoints:
    """The points that are closed, event by event.

    `grid`, bool (height, width), is True on points that are closed now. `names` are the parts that are closed,
    `waiting` those that wait until bodies are clear of them.
    """

    def __init__(self, points: Parts, terrain: Terrain) -> None:
        """Begin with nothing closed."""
        self.points = points
        self.names: set[str] = set()
        self.waiting: set[str] = set()
        self.grid: BoolGrid = np.zeros(terrain.shape, dtype=np.bool_)

    def take(self, event: Event) -> bool:
        """Take in an event of a part; return False for an event about anything else."""
        if (name := part_of(event)) not in self.points:
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

    def __init__(self, points: Parts, terrain: Terrain, events: Iterable[Event] = ()) -> None:
        """Take in the events so far."""
        self.now = ClosedPoints(points, terrain)
        self._states: list[tuple[int, frozenset[str], frozenset[str]]] = [(0, frozenset(), frozenset())]
        self._grid: tuple[frozenset[str], BoolGrid] = frozenset(), self.now.grid
        self._shown: tuple[Footprint, frozenset[str]] | None = None
        self.take(events)

    def take(self, events: Iterable[Event]) -> None:
        """Take in events that follow on those so far."""
        for event in events:
            if self.now.take(event):
                self._states.append((event.k, frozenset(self.now.names), frozenset(self.now.waiting)))

    def show(self, k: int, footprint: Footprint) -> None:
        """Close on a sensor's ground the parts that are closed in a tick.

        Nothing else may close that ground.
        """
        shown = footprint, self.names(k)
        if isinstance(footprint, ChangingFootprint) and shown != self._shown:
            footprint.close(self.grid(k))
            self._shown = shown

    def at(self, k: int) -> tuple[frozenset[str], frozenset[str]]:
        """Return the parts that are closed in a tick, and those that wait until bodies are clear of them."""
        # The last state of several in one tick: robots see what its last event left.
        _, closed, waiting = self._states[bisect_right(self._states, k, key=itemgetter(0)) - 1]
        return closed, waiting

    def names(self, k: int) -> frozenset[str]:
        """Return the parts that are closed in a tick."""
        return self.at(k)[0]

    def grid(self, k: int) -> BoolGrid:
        """Return the points that are closed in a tick, bool (height, width)."""
        names = self.names(k)
        if names != self._grid[0]:
            self._grid = names, _mark_points(self.now.points, names, self.now.grid.shape)
        return self._grid[1]


def _mark_points(points: Parts, names: Iterable[str], shape: tuple[int, ...]) -> BoolGrid:
    """Return a grid of the points of some parts."""
    grid = np.zeros(shape, dtype=np.bool_)
    for name in names:
        grid.reshape(-1)[points[name]] = True
    return grid
