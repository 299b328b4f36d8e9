"""The fog of war: how long ago each patrolled point was last seen (paper, "Formal Criteria")."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import View
from patrol.kernels.fog import keep_tracked, observe, observe_each, stalest_row

NEVER = -1
"""``last_seen`` of a point that no robot has seen yet; its age counts from tick 0."""

AGELESS = 2**31 - 1
"""Last-seen tick of a point that has no age, in what robots believe and in its dilatation."""

Box = tuple[int, int, int, int]
"""First row, last row, first column, last column (inclusive)."""


class Looks:
    """Looks of a sensor that leaves nothing of a point's age, side by side: fogs take in some of them at once."""

    def __init__(self, looks: Sequence[tuple[int, View]]) -> None:
        """Put looks side by side: the tick and the footprint of each, at least one, and all of one sensor."""
        self.views = [view for _, view in looks]
        places = np.array([(view.row0, view.col0, tick) for tick, view in looks], dtype=np.int64)
        self.rows, self.cols, self.ticks = np.ascontiguousarray(places.T)
        self._masks: dict[int, NDArray[np.uint8]] = {}

    def masks_on(self, patrolled: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the looks' masks, uint8 (looks, m, m), of patrolled points alone; computed once for each ground."""
        if id(patrolled) not in self._masks:
            masks = self._masks[id(patrolled)] = np.stack([view.mask for view in self.views])
            keep_tracked(masks, patrolled, self.rows, self.cols)
        return self._masks[id(patrolled)]


class Fog:
    """Last-seen ticks of the points of a patrolled area, with MFoW, mean and the number of points seen.

    A look costs its footprint, not the map: what it changes is added to a sum, and for each row of points a tick is
    kept before which none of them was last seen. The MFoW is found when it is asked for, in the rows that might hold
    the stalest point. All ages are in ticks.
    """

    def __init__(self, patrolled: NDArray[np.bool_]) -> None:
        """Start with every point unseen; there must be at least one patrolled point."""
        self.patrolled = np.ascontiguousarray(patrolled).view(np.uint8)
        self.points = int(np.count_nonzero(patrolled))
        if self.points == 0:
            raise ValueError("a fog needs at least one patrolled point")
        self.last_seen: NDArray[np.int32] = np.full(patrolled.shape, NEVER, dtype=np.int32)
        # A bound below all ticks: the first search finds the true one of each row that matters.
        self._oldest: NDArray[np.int32] = np.full(patrolled.shape[0], NEVER, dtype=np.int32)
        self._totals: tuple[int, int] | None = (0, 0)
        self._stalest = (0, 0)

    @classmethod
    def resumed(cls, patrolled: NDArray[np.bool_], last_seen: NDArray[np.int32]) -> Fog:
        """Make a fog that goes on from a copy of another one's last-seen ticks; both have the same points."""
        fog = cls(patrolled)
        fog.last_seen = np.array(last_seen, dtype=np.int32, order="C")
        # They are counted when first asked for: most of these fogs are never asked.
        fog._totals = None
        return fog

    def fork(self) -> Fog:
        """An independent fog of the same points, now as fresh as this one."""
        fork = copy.copy(self)
        fork.last_seen = self.last_seen.copy()
        fork._oldest = self._oldest.copy()
        return fork

    def observe(self, view: View, tick: int) -> None:
        """Take in one robot's footprint."""
        window = view.row0, view.col0, tick
        gained, first = observe(self.last_seen, self.patrolled, view.mask, view.quality, *window)
        if self._totals is not None:
            self._totals = self._totals[0] + gained, self._totals[1] + first

    def observe_each(self, looks: Looks, chosen: NDArray[np.uint8]) -> None:
        """Take in those of many footprints for which `chosen`, uint8, is not 0.

        The mean's terms are counted when it is asked for.
        """
        places = looks.rows, looks.cols, looks.ticks
        observe_each(self.last_seen, looks.masks_on(self.patrolled), *places, chosen)
        self._totals = None

    def mfow(self, tick: int) -> int:
        """Return the age of the stalest patrolled point (MFoW) at a tick, in ticks.

        For example, 6 at tick 10 if the stalest point was last seen at tick 4, and 10 if it was never seen.
        """
        row = stalest_row(self.last_seen, self.patrolled, self._oldest)
        return tick - max(self._oldest.item(row), 0)

    def stalest(self) -> tuple[int, int]:
        """Return the (row, col) of a patrolled point that was last seen longest ago.

        It is the same one as before while that is still among them.
        """
        row = stalest_row(self.last_seen, self.patrolled, self._oldest)
        oldest = self._oldest[row]
        # The same point as long as it is one of the stalest, so that what follows it does not jump between equals.
        if self.patrolled[self._stalest] == 0 or self.last_seen[self._stalest] != oldest:
            is_stalest = (self.last_seen[row] == oldest) & (self.patrolled[row] != 0)
            self._stalest = row, int(is_stalest.argmax())
        return self._stalest

    def mean(self, tick: int) -> float:
        """Return the patrolled points' mean age at a tick, in ticks.

        For example, at tick 10, two points last seen at tick 4 and never have the mean age 8.
        """
        return tick - self._count_seen()[0] / self.points

    def age(self, tick: int) -> NDArray[np.int32]:
        """Return the age of every point at a tick, in ticks, int32 (h, w).

        Points outside the patrolled area read as never seen.
        """
        return np.int32(tick) - np.maximum(self.last_seen, np.int32(0))

    @property
    def seen(self) -> int:
        """Number of patrolled points that have been seen at least once."""
        return self._count_seen()[1]

    def _count_seen(self) -> tuple[int, int]:
        """The sum of the points' last-seen ticks, and how many have been seen."""
        if self._totals is None:
            counted = self.last_seen[self.patrolled.view(np.bool_)]
            total = int(np.maximum(counted, 0).sum(dtype=np.int64))
            self._totals = total, int(np.count_nonzero(counted != NEVER))
        return self._totals
