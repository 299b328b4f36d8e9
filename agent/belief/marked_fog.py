"""A fog that many looks of one tick are noted in at once, and that is counted only when somebody asks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agent.belief.kernels.look import stalest
from patrol.ground.fog import NEVER, Box, Fog
from patrol.ground.footprint import View


class MarkedFog(Fog):
    """As `patrol.ground.fog.Fog`, for looks that make points fresh; keeps no counts from look to look."""

    def __init__(self, patrolled: NDArray[np.bool_]) -> None:
        super().__init__(patrolled)
        self._at = int(np.argmax(self.patrolled))
        self._least = NEVER

    def fork(self) -> MarkedFog:
        """An independent fog of the same points, now as fresh as this one."""
        other = super().fork()
        assert isinstance(other, MarkedFog)
        return other

    def observe(self, view: View, tick: int) -> Box | None:
        """Take in one robot's footprint, seen at any tick.

        Args:
            view: The footprint; a look with it leaves no age.
            tick: At which it was observed.

        Returns:
            The box of the footprint's window on the terrain; None where it is off the terrain.
        """
        rows, cols = view.mask.shape
        top, left = max(0, view.row0), max(0, view.col0)
        part = slice(top, max(top, view.row0 + rows)), slice(left, max(left, view.col0 + cols))
        grid, tracked = self.last_seen[part], self.patrolled[part]
        if not grid.size:
            return None
        row, col = top - view.row0, left - view.col0
        seen = (view.mask[row : row + grid.shape[0], col : col + grid.shape[1]] & tracked) != 0
        grid[seen] = np.maximum(grid[seen], tick)
        return top, top + grid.shape[0] - 1, left, left + grid.shape[1] - 1

    def mfow(self, tick: int) -> int:
        """The age of the stalest patrolled point (MFoW), in ticks.

        Args:
            tick: Now.
        """
        seen = self.last_seen
        if seen.item(self._at) != self._least:
            self._at = int(stalest(seen.reshape(-1), self.patrolled.reshape(-1), self._least, self._at))
            self._least = seen.item(self._at)
        return tick - max(self._least, 0)

    def stalest(self) -> tuple[int, int]:
        """One of the points that nobody has seen for longest: the same as before while it is one of them.

        Returns:
            Its row and column.
        """
        self.mfow(0)
        row, col = divmod(self._at, self.last_seen.shape[1])
        return row, col

    def mean(self, tick: int) -> float:
        """The patrolled points' mean age, in ticks.

        Args:
            tick: Now.
        """
        counted = self.last_seen[self.patrolled.view(np.bool_)]
        return tick - int(np.maximum(counted, 0).sum(dtype=np.int64)) / self.points

    @property
    def seen(self) -> int:
        """How many patrolled points have been seen at least once."""
        return int(np.count_nonzero((self.last_seen != NEVER) & (self.patrolled != 0)))
