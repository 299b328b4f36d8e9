"""The fog of war: how long ago each patrolled point was last seen (paper, "Formal Criteria")."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from patrol.ground.footprint import View
from patrol.ground.kernels.fog import find, observe

NEVER = -1
"""``last_seen`` of a point that nobody has seen yet; its age counts from tick 0."""

Box = tuple[int, int, int, int]
"""First row, last row, first column, last column (inclusive)."""


class Fog:
    """Last-seen ticks of the points of a patrolled area, with MFoW and mean in constant time.

    The cost of an observation depends on its footprint, not on the map: a histogram of last-seen ticks follows each
    change, and its oldest bin that is not empty is the MFoW. All ages are in ticks.
    """

    def __init__(self, patrolled: NDArray[np.bool_]) -> None:
        """Start with every point unseen.

        Args:
            patrolled: bool (h, w), the points that count; there must be at least one.
        """
        self.patrolled = np.ascontiguousarray(patrolled).view(np.uint8)
        self.points = int(np.count_nonzero(patrolled))
        if self.points == 0:
            raise ValueError("a fog needs at least one patrolled point")
        self.last_seen: NDArray[np.int32] = np.full(patrolled.shape, NEVER, dtype=np.int32)
        self._histogram = np.zeros(1024, dtype=np.int64)
        self._histogram[0] = self.points
        self._oldest = 0
        self._sum = 0
        self._box = np.zeros(4, dtype=np.int64)
        self._stalest = (0, 0)
        self._stalest_of = NEVER

    @classmethod
    def resumed(cls, patrolled: NDArray[np.bool_], last_seen: NDArray[np.int32]) -> Fog:
        """A fog that goes on from a copy of another one's last-seen ticks.

        Args:
            patrolled: bool (h, w), the same as of the other fog.
            last_seen: int32 (h, w), of the other fog.

        Returns:
            An independent fog.
        """
        fog = cls(patrolled)
        fog.last_seen = np.array(last_seen, dtype=np.int32, order="C")
        counted = fog.last_seen[fog.patrolled.view(np.bool_)]
        fog._histogram = np.bincount(counted + 1, minlength=1024).astype(np.int64)
        fog._sum = int(np.maximum(counted, 0).sum(dtype=np.int64))
        return fog

    def fork(self) -> Fog:
        """An independent fog of the same points, now as fresh as this one."""
        other = copy.copy(self)
        other.last_seen = self.last_seen.copy()
        other._histogram = self._histogram.copy()
        other._box = self._box.copy()
        return other

    def observe(self, view: View, tick: int) -> Box | None:
        """Take in one robot's footprint.

        Args:
            view: The footprint.
            tick: At which it was observed.

        Returns:
            The box of the points that changed, or None when none did.
        """
        if tick + 2 > self._histogram.size:
            grown = np.zeros(2 * (tick + 2), dtype=np.int64)
            grown[: self._histogram.size] = self._histogram
            self._histogram = grown
        state = (self.last_seen, self.patrolled, self._histogram)
        self._sum += observe(*state, view.mask, view.quality, view.row0, view.col0, tick, self._box)
        first_row, last_row, first_col, last_col = self._box.tolist()
        return (first_row, last_row, first_col, last_col) if first_row <= last_row else None

    def mfow(self, tick: int) -> int:
        """The age of the stalest patrolled point (MFoW), in ticks.

        Args:
            tick: Now.
        """
        while self._histogram.item(self._oldest) == 0:
            self._oldest += 1
        return tick - max(self._oldest - 1, 0)

    def stalest(self) -> tuple[int, int]:
        """One of the points that nobody has seen for longest: the same as before while it is one of them.

        Returns:
            Its row and column.
        """
        self.mfow(0)
        oldest = self._oldest - 1
        if self.patrolled[self._stalest] == 0 or self.last_seen[self._stalest] != oldest:
            # Last-seen ticks only grow, so no point before the last one found has this tick again.
            width = self.last_seen.shape[1]
            begin = self._stalest[0] * width + self._stalest[1] if oldest == self._stalest_of else 0
            self._stalest = divmod(find(self.last_seen, self.patrolled, oldest, begin), width)
            self._stalest_of = oldest
        return self._stalest

    def mean(self, tick: int) -> float:
        """The patrolled points' mean age, in ticks.

        Args:
            tick: Now.
        """
        return tick - self._sum / self.points

    def age(self, tick: int) -> NDArray[np.int32]:
        """The age of every point, in ticks.

        Args:
            tick: Now.

        Returns:
            int32 (h, w); points outside the patrolled area read as never seen.
        """
        return np.int32(tick) - np.maximum(self.last_seen, np.int32(0))

    @property
    def seen(self) -> int:
        """How many patrolled points have been seen at least once."""
        return self.points - int(self._histogram[0])
