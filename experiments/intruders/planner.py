"""Plans an intruder's way in: the way and the stay on which it expects to be detected least."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.ground import IntruderGround
from experiments.intruders.predictors import Chances
from experiments.kernels.way_in import least_detection

OUTSIDE, DONE = -1, -2
"""Entries of a way where the intruder has not yet entered, and where its stay is over."""

SURE = 1.0 - 1e-6
"""Greatest chance of being seen that an intruder believes in, so that it prefers the shorter of two bad ways."""

HASTE = 1e-4
"""Cost of a tick on the ground besides that of being seen, so that of equally safe ways the shortest is taken."""

LEVELS = 1 << 16
"""Chances that are told apart."""

MOST_PARTS = 4
"""Instants of a tick at most, so far as they are for a speed that is nearer to the one asked for."""

LONGEST = 1.5
"""Points that the intruder could pass in an instant at most."""

OFF = 0.1
"""Share by which a move may be too fast, and its speed be off where that saves instants."""

ROUNDING = 1e-6
"""Rounding error of a number of instants."""

Way = NDArray[np.int32]
"""int32 (ticks,), the point at each tick's end, or `OUTSIDE` or `DONE`."""


class Planner:
    """Plans ways over a ground. It keeps its working memory, so it is not for several threads.

    A straight move takes whole instants, so its speed `straight_m_s` may differ a little from the one asked for.
    """

    def __init__(self, ground: IntruderGround, step: float, speed: float, stay_s: float) -> None:
        self._ground = ground
        self._parts, self._straight, self._diagonal = _tick_instants(ground.point_m / (speed * step))
        self.straight_m_s = ground.point_m * self._parts / (self._straight * step)
        self.stay = max(round(stay_s / step), 1)
        count = math.prod(ground.shape)
        self._bars = np.full((8, count), np.inf, dtype=np.float32)
        for k in range(len(self._bars)):
            # From the neighbour in direction k the intruder comes in by a move in the opposite one.
            self._bars[k, ground.squares[ground.neighbours[:, k] >= 0]] = 0.0
        self._outside = np.full(count, np.inf, dtype=np.float32)
        self._outside[ground.squares[ground.entries]] = 0.0
        self._point = np.full(count, -1, dtype=np.int32)
        self._point[ground.squares] = np.arange(len(ground.squares))
        self._risk = self._reached = np.zeros((0, count), dtype=np.float32)

    def plan(self, chances: Chances, start: int, goal: int) -> Way | None:
        """Return the best way to a goal with the stay there, or None where no way ends in time.

        From `OUTSIDE` the intruder enters where and when it wants.
        """
        ticks = len(chances)
        if len(self._risk) < ticks:
            self._risk = np.empty((ticks, self._bars.shape[1]), dtype=np.float32)
            self._reached = np.empty((ticks * self._parts + 1, self._bars.shape[1]), dtype=np.float32)
        way = np.empty(ticks, dtype=np.int32)
        cost = least_detection(
            chances,
            _instant_costs(self._parts),
            self._ground.squares,
            self._ground.shape[1],
            self._parts,
            self._bars,
            self._outside,
            self._straight,
            self._diagonal,
            start,
            goal,
            self.stay,
            self._risk,
            self._reached,
            way,
        )
        return np.where(way >= 0, self._point[way], way) if math.isfinite(cost) else None


def sightings(chances: Chances, way: Way) -> float:
    """Return how often the intruder expects to be seen on a way, by the same cost as in its plans."""
    ticks = np.flatnonzero(way >= 0)
    return -float(np.log1p(-np.minimum(chances[ticks, way[ticks]], SURE)).sum())


def _tick_instants(ticks: float) -> tuple[int, int, int]:
    """Return the instants of a tick, of a straight move and of a diagonal one, given the ticks of a straight move."""
    fewest = max(math.ceil(1.0 / (ticks * LONGEST) - ROUNDING), 1)
    choices = []
    for parts in range(fewest, max(fewest, MOST_PARTS) + 1):
        straight, diagonal = (
            max(math.ceil((1.0 - OFF) * length * ticks * parts - ROUNDING), 1) for length in (1.0, math.sqrt(2.0))
        )
        off = abs(straight / (ticks * parts) - 1.0)
        choices.append((max(off, OFF), parts, straight, diagonal))
    return min(choices)[1:]


@cache
def _instant_costs(parts: int) -> NDArray[np.float32]:
    """Return the cost of an instant by the level of the chance of being seen, float32 (`LEVELS`,)."""
    chances = (min(level / (LEVELS - 1), SURE) for level in range(LEVELS))
    return np.array([(HASTE - math.log(1.0 - chance)) / parts for chance in chances], dtype=np.float32)
