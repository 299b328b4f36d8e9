"""A patrol as it can be watched: which points each robot sees in each tick, and where it is.

Points are those of the intruder's ground. What is in view is written as bits, so that many moments can be compared, and
footprints that occur again are kept once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.ground import IntruderGround
from patrol.ground.footprint import View

Place = tuple[float, float]
"""x and y, m."""

WORD = 64
"""Bits of a word."""


@dataclass(frozen=True, eq=False)
class Watch:
    """All that can be seen of a run."""

    ground: IntruderGround
    step: float  # length of a tick, s
    words: NDArray[np.uint64]  # (ticks, words), a bit for each point, set where some robot sees it
    places: NDArray[np.float32]  # (ticks, robots, 2), x and y in m; infinite where a robot takes no part
    looks: NDArray[np.int32]  # (ticks, robots), the number of each robot's footprint; 0 where it sees nothing
    first: NDArray[np.int64]  # (footprints + 1,), where each footprint begins in `points`
    points: NDArray[np.int32]  # the points of all footprints

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.words)

    @property
    def size(self) -> int:
        """Number of points."""
        return len(self.ground.rows)

    def seen(self, first: int, last: int) -> NDArray[np.uint8]:
        """Return 1 for each point that is seen in a tick, else 0: (last - first, points), without tick `last`."""
        return self.unpacked(self.words[first:last])

    def unpacked(self, words: NDArray[np.uint64]) -> NDArray[np.uint8]:
        """Return 1 for each point that some words say is seen, else 0: (n, points) for (n, words)."""
        return np.unpackbits(words.view(np.uint8), axis=1, count=self.size, bitorder="little")

    def ever_seen(self) -> NDArray[np.bool_]:
        """Return which points are seen in some tick, bool (points,)."""
        words = np.bitwise_or.reduce(self.words, axis=0)
        return np.unpackbits(words.view(np.uint8), count=self.size, bitorder="little").view(np.bool_)

    def ticks_of(self, seconds: float) -> int:
        """Return the whole ticks nearest to a time, at least one."""
        return max(round(seconds / self.step), 1)


class PointNumbers:
    """The numbers of some points of a terrain, to find those in view."""

    def __init__(self, height: int, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> None:
        """Number the points in their order, on a terrain of so many rows."""
        self._numbers = np.argsort(rows, kind="stable").astype(np.int32)
        self._rows, self._cols = rows[self._numbers], cols[self._numbers]
        self._first = np.searchsorted(self._rows, np.arange(height + 1)).tolist()

    def in_view(self, view: View) -> NDArray[np.int32]:
        """Return the numbers of the points in a view."""
        tall, wide = view.mask.shape
        last = len(self._first) - 1
        band = slice(self._first[min(max(view.row0, 0), last)], self._first[min(max(view.row0 + tall, 0), last)])
        cols = self._cols[band] - view.col0
        near = np.flatnonzero((cols >= 0) & (cols < wide))
        visible = view.mask[self._rows[band][near] - view.row0, cols[near]] != 0
        return np.asarray(self._numbers[band][near[visible]])


class WatchLog:
    """Writes down what can be seen of a run, tick by tick."""

    def __init__(self, ground: IntruderGround, height: int, step: float, ticks: int, robots: int) -> None:
        """Begin with nothing seen; there are `ticks` at most, and `robots` with those that join later."""
        self._ground = ground
        self._step = step
        self._numbers = PointNumbers(height, ground.rows, ground.cols)
        self._words = np.zeros((ticks, -(-len(ground.rows) // WORD)), dtype=np.uint64)
        self._places = np.full((ticks, robots, 2), np.inf, dtype=np.float32)
        self._looks = np.zeros((ticks, robots), dtype=np.int32)
        self._known: dict[bytes, int] = {b"": 0}
        self._bits = np.zeros(self._words.shape[1] * WORD, dtype=np.bool_)
        self._ticks = 0

    def look(self, k: int, robots: Iterable[tuple[int, Place, View]]) -> None:
        """Write down a tick: each robot that takes part by its number in the roster from 0, its place and its view."""
        self._ticks = k + 1
        self._bits[:] = False
        for robot, spot, view in robots:
            points = self._numbers.in_view(view)
            self._places[k, robot] = spot
            self._looks[k, robot] = self._known.setdefault(points.tobytes(), len(self._known))
            self._bits[points] = True
        self._words[k] = np.packbits(self._bits, bitorder="little").view(np.uint64)

    def watch(self) -> Watch:
        """Return all ticks so far."""
        footprints = [np.frombuffer(points, dtype=np.int32) for points in self._known]
        first = np.cumsum([0, *map(len, footprints)], dtype=np.int64)
        recorded = slice(self._ticks)
        return Watch(
            self._ground,
            self._step,
            self._words[recorded],
            self._places[recorded],
            self._looks[recorded],
            first,
            np.concatenate(footprints),
        )
