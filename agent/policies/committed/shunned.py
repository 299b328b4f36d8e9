"""Places that a robot has given up and leaves out for a while, for longer each time in a row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHUNNED_S = 60.0
"""How long a robot leaves out a target's surroundings, s; doubled each time that it gives them up again."""

LONGEST_SHUNNED_S = 960.0
"""Upper bound of the same, s; also how long a robot remembers that it left them out."""

MOST_SHUNNED = 64
"""Places that are left out at a time, or remembered."""

NONE: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)

Point = tuple[int, int]


class Shunned:
    """What one robot leaves out.

    Attributes:
        places: Row and column of each place, the tick until which it is left out, and for how many ticks.
    """

    def __init__(self, around: int, step: float) -> None:
        """Leave nothing out.

        Args:
            around: Squared radius of a place's surroundings, in points.
            step: s per tick.
        """
        self.places: list[tuple[int, int, int, int]] = []
        self._around = around
        self._least, self._most = (round(bound / step) for bound in (SHUNNED_S, LONGEST_SHUNNED_S))

    def add(self, tick: int, point: Point) -> None:
        """Leave a point and its surroundings out.

        Args:
            tick: Now.
            point: Row and column of the terrain.
        """
        before = max((one[3] for one in self.places if self._is_beside(one, point)), default=0)
        spell = min(max(2 * before, self._least), self._most)
        self.forgive(point)
        self.places = [*self.places, (*point, tick + spell, spell)][-MOST_SHUNNED:]

    def forgive(self, point: Point) -> None:
        """Forget what is around a point.

        Args:
            point: Row and column of the terrain.
        """
        self.places = [one for one in self.places if not self._is_beside(one, point)]

    def forget(self, tick: int) -> None:
        """Forget what was left out long ago; who gives a place up again before long is to leave it out for longer.

        Args:
            tick: Now.
        """
        self.places = [one for one in self.places if tick < one[2] + self._most]

    def now(self, tick: int) -> NDArray[np.int64]:
        """What is left out at a tick.

        Args:
            tick: Now.

        Returns:
            int64 (n, 3), row, column and squared radius in points.
        """
        if not self.places:
            return NONE
        rows = [(row, col, self._around) for row, col, until, _ in self.places if tick < until]
        return np.array(rows, dtype=np.int64).reshape(-1, 3)

    def _is_beside(self, shunned: tuple[int, int, int, int], point: Point) -> bool:
        """Whether a point belongs to the surroundings of one that was given up."""
        return (shunned[0] - point[0]) ** 2 + (shunned[1] - point[1]) ** 2 <= self._around
