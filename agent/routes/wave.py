"""The wave: Lee's paths round obstacles (paper, "The wave")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agent.routes.ground import Ground
from agent.routes.kernels.wave import BEGINNING, HEMMED, QUEUED, SETTLED, STATUS, advance
from agent.routes.path_window import FAR, Lengths, PathWindow, Place
from patrol.ground.kernels.footprint import cast


class Wave(PathWindow):
    """Shortest 8-connected paths: straight steps count 1, diagonal ones 1.41 points, and no path cuts a corner."""

    def __init__(self, height: int, width: int, span: int) -> None:
        super().__init__(height, width, span)
        self._sight = np.zeros_like(self.state)
        self._straight = np.zeros(self.state.size, dtype=np.int64)
        self._diagonal = np.zeros(self.state.size, dtype=np.int64)
        self._marks = np.zeros(4, dtype=np.int64)
        self._start = 0

    def _begin(self) -> None:
        cast(self.state, self.start_row, self.start_col, float(self.span), self._sight, 0, 0)
        self._queue([(self.start_row, self.start_col)])

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """As `PathWindow.lengths_from`, by one wave from all starts at once."""
        self._place(ground, row, col)
        inside = [(r - self.row0 - 1, c - self.col0 - 1) for r, c in starts]
        self._sight[:] = 0
        self._queue([start for start in sorted(set(inside)) if self._holds(*start)])
        self.extend(limit)
        return np.where(self.state & STATUS == SETTLED, self.length, FAR)

    def _queue(self, starts: Sequence[Place]) -> None:
        for index, (row, col) in enumerate(starts):
            self._start = row * self.state.shape[1] + col
            self.state[row, col] = (self.state[row, col] & HEMMED) | QUEUED
            self.length[row, col] = 0
            self._straight[index] = self._start * 16 + BEGINNING
        self._marks[:] = (0, len(starts), 0, 0)

    def extend(self, limit: int) -> None:
        """Settle every path up to ``limit`` hundredths of a point."""
        advance(
            self.state.reshape(-1),
            self._sight.reshape(-1),
            self.length.reshape(-1),
            self.bend.reshape(-1),
            self._straight,
            self._diagonal,
            self._marks,
            self._start,
            self.state.shape[1],
            limit,
        )
