"""The time that slow zones cost on the shortest ways to a place.

Ways count metres, so they lead through slow zones. For example, 20 m of a way through a zone of 0.2 m/s take a robot of
1 m/s 80 s more than 20 m elsewhere. Of several shortest ways the slowest counts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import FAR
from agent.routes.path_window import DIAGONAL

if TYPE_CHECKING:
    from collections.abc import Set

    from patrol.zones.ground import SpeedLimits

_STRAIGHT = 100
"""Length of the shortest step, in hundredths of a point."""


class SlowWays:
    """The time lost in slow zones on the ways of one body to one place, for the zones that were in force last."""

    def __init__(self, lengths: NDArray[np.float32], point: float, speed: float, limits: SpeedLimits) -> None:
        """Compute nothing yet.

        `lengths` are those of the ways to the place, in m, infinity where none leads; `point` is the side of a point,
        m.
        """
        self._lengths = lengths
        self._point = point
        self._speed = speed
        self._limits = limits
        self._in_force: Set[str] = frozenset()
        self._delays: NDArray[np.float64] | None = None

    def delay_s(self, start: tuple[int, int], in_force: Set[str]) -> float:
        """Return how much longer the way from a point (row, col) takes than at top speed; 0 where none leads."""
        if in_force != self._in_force:
            self._in_force, slower = in_force, self._limits.delays(self._speed, in_force)
            self._delays = None if slower is None else _delays(self._lengths, self._point, slower)
        return 0.0 if self._delays is None else self._delays.item(start)


def _delays(lengths: NDArray[np.float32], point: float, slower: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the delay on the slowest of the shortest ways from each point, float64 (h, w), s.

    Every step is at least one point long. So the points whose ways are from k to less than k + 1 points long go on to
    some whose ways are shorter than k points, and all of them are computed at once.

    Lengths are in m, infinity where no way leads; `slower` is how many s each metre takes longer, by point.
    """
    height, width = lengths.shape
    is_finite = np.isfinite(lengths)
    length = np.full((height + 2, width + 2), FAR, dtype=np.int64)
    length[1:-1, 1:-1][is_finite] = np.rint(lengths[is_finite] * (100.0 / point))
    per_step = np.pad(slower * (0.01 * point), 1).ravel()
    delays = np.zeros(length.size)
    near, steps = _list_neighbours(width + 2)
    flat = length.ravel()
    points = np.flatnonzero(flat < FAR)
    points = points[np.argsort(flat[points], kind="stable")]
    ends = np.flatnonzero(np.diff(flat[points] // _STRAIGHT)) + 1
    for here in np.split(points, ends):
        ahead = here + near
        is_next = flat[ahead] == flat[here] - steps
        delays[here] = np.where(is_next, delays[ahead] + steps * per_step[here], 0.0).max(axis=0)
    return delays.reshape(length.shape)[1:-1, 1:-1]


def _list_neighbours(width: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the flat offsets of a point's eight neighbours and the lengths of the steps there.

    Both are int64 (8, 1), the lengths in hundredths of a point; the width is that of the grid.
    """
    around = [(up, across) for up in (-1, 0, 1) for across in (-1, 0, 1) if up or across]
    near = [[up * width + across] for up, across in around]
    return np.array(near), np.array([[DIAGONAL if up and across else _STRAIGHT] for up, across in around])
