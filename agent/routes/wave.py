"""The wave: Lee's paths round obstacles (paper, "The wave")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agent.routes.ground import Ground
from agent.routes.kernels.lengths import read, show, spread
from agent.routes.kernels.wave import settle
from agent.routes.path_window import Lengths, PathWindow, Place
from patrol.ground.kernels.footprint import cast

LONGEST = 2**26
"""Longest path that fits a cell, in hundredths of a point."""

MOST_POINTS = 2**28
"""Points of the largest window whose indices fit an entry."""

ROOM = 2**12
"""Entries for which a new wave has room, a power of two; it makes more as needed."""

Box = tuple[int, int, int, int]
"""First row, end row, first column and end column; ends are exclusive."""


class Wave(PathWindow):
    """Shortest 8-connected paths: straight steps count 1, diagonal ones 1.41 points, and no path cuts a corner."""

    def __init__(self, height: int, width: int, span: int) -> None:
        super().__init__(height, width, span)
        if self.state.size > MOST_POINTS:
            raise ValueError(f"a window of {self.state.size} points is larger than {MOST_POINTS}")
        self._sight = np.zeros_like(self.state)
        self._cell = np.zeros(self.state.size, dtype=np.uint32)
        self._lists = np.zeros((2, ROOM), dtype=np.uint32)
        self._queues = np.zeros((2, ROOM), dtype=np.uint64)
        self._near: Lengths | None = None
        self._settled = -1

    def _begin(self) -> None:
        self._settled = -1

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """As `PathWindow.lengths_from`, by one wave from all starts at once."""
        self._place(ground, row, col)
        rows, cols = self.state.shape
        inside = sorted({(r - self.row0 - 1, c - self.col0 - 1) for r, c in starts})
        begin = np.array([r * cols + c for r, c in inside if self._holds(r, c)], dtype=np.int64)
        limit = min(limit, LONGEST)
        while not spread(self.state, 0, 0, self._cell, cols, self._lists, begin, limit, 0, rows, 0, cols):
            self._make_room()
        show(self._cell, self.state, self.length, limit, 0, rows, 0, cols)
        return self.length.copy()

    def nearness(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int, reach: int) -> Lengths:
        """As `PathWindow.nearness`, by one wave that goes only where paths to these points can lead."""
        self._lie(ground, row, col)
        middle, cols = (row - self.row0 - 1, col - self.col0 - 1), self.state.shape[1]
        if self._near is None:
            self._near = np.empty_like(self.length)
        limit = min(limit, LONGEST)
        # A point on such a path is no farther from the path's ends together than this, in rows or columns.
        apart = (limit + reach) // 100 + 1
        box = part = self._around(middle, middle, 2 * (reach // 100 + 1))
        begin = []
        for start_row, start_col in starts:
            place = start_row - self.row0 - 1, start_col - self.col0 - 1
            if self._holds(*place) and max(abs(place[0] - middle[0]), abs(place[1] - middle[1])) <= apart:
                begin.append(place[0] * cols + place[1])
                led = self._around(place, middle, apart)
                box = min(box[0], led[0]), max(box[1], led[1]), min(box[2], led[2]), max(box[3], led[3])
        origin, starting = (self.row0 + 1, self.col0 + 1), np.array(sorted(set(begin)), dtype=np.int64)
        while not spread(ground.state, *origin, self._cell, cols, self._lists, starting, limit, *box):
            self._make_room()
        read(self._cell, self._near, limit, *part)
        return self._near

    def extend(self, limit: int) -> None:
        """As `PathWindow.extend`; a larger limit than before takes another wave."""
        limit = min(limit, LONGEST)
        if limit <= self._settled:
            return
        self._settled = limit
        rows, cols = self.state.shape
        reach = limit // 100
        top, bottom = max(0, self.start_row - reach), min(rows, self.start_row + reach + 1)
        left, right = max(0, self.start_col - reach), min(cols, self.start_col + reach + 1)
        # All of the box is in range of this look, its corners too, unless the window's span ends before.
        cast(self.state, self.start_row, self.start_col, float(min(self.span, 2 * reach)), self._sight, 0, 0)
        grids, box = (self.state, self._sight, self.length, self.bend), (top, bottom, left, right)
        while not settle(*grids, self._queues, self.start_row, self.start_col, limit, *box):
            self._queues = np.zeros((2, 4 * self._queues.shape[1]), dtype=np.uint64)

    def _around(self, one: Place, other: Place, apart: int) -> Box:
        """The part of the window whose points have rows, and columns, no farther than this from two places together.

        It is two points larger on each side, because the outermost points of a box count as blocked.
        """
        (rows, cols), (up, across) = self.state.shape, (one[0] + other[0], one[1] + other[1])
        top, left = max(0, (up - apart) // 2 - 2), max(0, (across - apart) // 2 - 2)
        return top, min(rows, (up + apart) // 2 + 4), left, min(cols, (across + apart) // 2 + 4)

    def _make_room(self) -> None:
        """Make room for more entries; those at hand are lost."""
        self._lists = np.zeros((2, 4 * self._lists.shape[1]), dtype=np.uint32)
