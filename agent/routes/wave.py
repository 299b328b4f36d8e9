"""The wave: Lee's paths round obstacles (paper, "The wave")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agent.routes.ground import Ground
from agent.routes.kernels.bends import follow
from agent.routes.kernels.lengths import spread
from agent.routes.kernels.ties import decide
from agent.routes.kernels.wave import ALL_WAYS, BESIDE, BEYOND, FULL, NOW, SEEN, SETTLED, STATUS, lay, settle, show
from agent.routes.path_window import FAR, Lengths, PathWindow, Place
from patrol.ground.kernels.footprint import cast

MOST = 2**26
"""Longest path that fits a cell, in hundredths of a point."""

ROOM = 2**12
"""Entries that the lists of a new wave hold; they grow as needed."""


class Wave(PathWindow):
    """Shortest 8-connected paths: straight steps count 1, diagonal ones 1.41 points, and no path cuts a corner."""

    def __init__(self, height: int, width: int, span: int) -> None:
        super().__init__(height, width, span)
        self._sight = np.zeros_like(self.state)
        self._cell = np.zeros(self.state.size, dtype=np.uint32)
        self._lists = np.zeros((5, ROOM), dtype=np.uint32)
        self._mark = np.zeros(7, dtype=np.int64)
        self._laid = -1

    def _begin(self) -> None:
        self._mark[:] = 0
        self._laid = -1

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """As `PathWindow.lengths_from`, by one wave from all starts at once."""
        self._place(ground, row, col)
        inside = [(r - self.row0 - 1, c - self.col0 - 1) for r, c in starts]
        rows, cols = self.state.shape
        held = np.array([r * cols + c for r, c in sorted(set(inside)) if self._holds(r, c)], dtype=np.int64)
        limit = min(limit, MOST)
        while not spread(self.state, self._cell, self._lists, held, limit):
            self._grow()
        show(self._cell, self.state, self.length, 1, limit, 0, rows, 0, cols)
        return np.where(self.state & STATUS == SETTLED, self.length, FAR)

    def extend(self, limit: int) -> None:
        """Settle every path up to ``limit`` hundredths of a point."""
        limit = min(limit, MOST)
        rows, cols = self.state.shape
        start = self.start_row * cols + self.start_col
        if self._laid < 0:
            cast(self.state, self.start_row, self.start_col, float(self.span), self._sight, 0, 0)
            lay(self.state, self._sight, self._cell, 0, rows, 0, cols)
            self._laid = 1
            self._cell[start] = self._cell[start] & SEEN | BESIDE
            self.bend.reshape(-1)[start] = start
            self._lists[0, 0] = start * 16 + ALL_WAYS
            self._lists[4, 0] = start * 16 + ALL_WAYS
            self._mark[NOW] = self._mark[BEYOND] = 1
        arrays = (self._cell, self._lists, self._mark)
        settle(*arrays, cols, limit)
        decide(*arrays, cols, limit)
        follow(self._cell, self.bend.reshape(-1), self._lists, self._mark, start, cols, limit)
        if self._mark[FULL]:
            self._grow()
            self._begin()
            self.extend(limit)
            return
        show(self._cell, self.state, self.length, 5, limit, 0, rows, 0, cols)

    def _grow(self) -> None:
        """Make room for more entries; what the lists held is lost."""
        self._lists = np.zeros((5, 4 * self._lists.shape[1]), dtype=np.uint32)
