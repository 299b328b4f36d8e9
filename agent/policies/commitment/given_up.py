"""Places that a robot has given up and leaves out for a while, for longer each time in a row."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEFT_OUT_S = 20.0
"""Time for which a robot leaves out a target's surroundings, s; doubled each time that it gives them up again."""

LONGEST_S = 960.0
"""Upper bound of the same, s; also how long a robot remembers that it left them out."""

AROUND_RADII = 2.0
"""Radius of a place's surroundings, in radii of the robot."""

MOST_PLACES = 64
"""Places that are left out at a time, or remembered."""

NONE: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)

Point = tuple[int, int]
"""Row and column of the terrain."""


class GivenUp:
    """The places that one robot leaves out."""

    def __init__(self, radius: float, point: float, step: float) -> None:
        # Row, column, the tick until which it is left out, and for how many ticks.
        self.places: list[tuple[int, int, int, int]] = []
        self._around = math.ceil((AROUND_RADII * max(radius, point) / point) ** 2)
        self._least, self._most = (round(bound / step) for bound in (LEFT_OUT_S, LONGEST_S))

    def add(self, tick: int, point: Point) -> None:
        """Leave a point and its surroundings out from now on."""
        remembered = [place for place in self.places if tick < place[2] + self._most]
        before = max((place[3] for place in remembered if self._is_beside(place, point)), default=0)
        spell = min(max(2 * before, self._least), self._most)
        others = [place for place in remembered if not self._is_beside(place, point)]
        self.places = [*others, (*point, tick + spell, spell)][-MOST_PLACES:]

    def forgive(self, point: Point) -> None:
        """Forget what is around a point."""
        self.places = [place for place in self.places if not self._is_beside(place, point)]

    def clear(self) -> None:
        """Forget everything."""
        self.places = []

    def now(self, tick: int) -> NDArray[np.int64]:
        """Return what is left out at a tick: int64 (n, 3), row, column and squared radius in points."""
        rows = [(row, col, self._around) for row, col, until, _ in self.places if tick < until]
        return np.array(rows, dtype=np.int64).reshape(-1, 3) if rows else NONE

    def covers(self, tick: int, stands: NDArray[np.int64], width: int) -> NDArray[np.bool_]:
        """Return which of some flat indices lie within what is left out at a tick; ``width`` is that of the terrain."""
        rows, cols = stands // width, stands % width
        out = np.zeros(stands.shape, dtype=np.bool_)
        for row, col, squared in self.now(tick).tolist():
            out |= (rows - row) ** 2 + (cols - col) ** 2 <= squared
        return out

    def _is_beside(self, place: tuple[int, int, int, int], point: Point) -> bool:
        """Return True if a point belongs to the surroundings of one that was given up."""
        return (place[0] - point[0]) ** 2 + (place[1] - point[1]) ** 2 <= self._around
