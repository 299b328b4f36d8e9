"""The wave: Lee's paths round obstacles (paper, "The wave")."""

from __future__ import annotations

import numpy as np

from agent.kernels.wave import BEGINNING, HEMMED, QUEUED, advance
from agent.paths.window import Window
from patrol.kernels.footprint import cast


class Wave(Window):
    """Shortest 8-connected paths; straight steps count 1, diagonal ones 1.41, and none cuts a corner."""

    def __init__(self, height: int, width: int, span: int) -> None:
        super().__init__(height, width, span)
        self._sight = np.zeros_like(self.state)
        self._straight = np.zeros(self.state.size, dtype=np.int64)
        self._diagonal = np.zeros(self.state.size, dtype=np.int64)
        self._place = np.zeros(4, dtype=np.int64)
        self._start = 0

    def _begin(self) -> None:
        cast(self.state, self.start_row, self.start_col, float(self.span), self._sight, 0, 0)
        self._start = self.start_row * self.state.shape[1] + self.start_col
        start = (self.start_row, self.start_col)
        self.state[start] = (self.state[start] & HEMMED) | QUEUED
        self.length[start] = 0
        self._straight[0] = self._start * 16 + BEGINNING
        self._place[:] = (0, 1, 0, 0)

    def extend(self, limit: int) -> None:
        """Settle every path of at most ``limit`` hundredths of a point."""
        advance(
            self.state.reshape(-1),
            self._sight.reshape(-1),
            self.length.reshape(-1),
            self.bend.reshape(-1),
            self._straight,
            self._diagonal,
            self._place,
            self._start,
            self.state.shape[1],
            limit,
        )
