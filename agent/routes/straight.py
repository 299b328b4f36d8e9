"""Straight paths, for terrains without obstacles (paper, scenario 1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agent.kernels.straight import open_up, rays
from agent.kernels.wave import OPEN
from agent.routes.ground import Ground
from agent.routes.path_window import PathWindow


class Straight(PathWindow):
    """The path to every patrolled point is the straight line to it.

    It runs through obstacles, and leads also to points on which no body fits. Other points have no path: an obstacle
    has no age, so it must not pull.
    """

    def __init__(self, height: int, width: int, span: int, patrolled: NDArray[np.bool_]) -> None:
        """Allocate the window."""
        super().__init__(height, width, span)
        self._patrolled = patrolled
        self._open = np.where(patrolled, np.uint8(OPEN), np.uint8(0))
        # No path bends.
        self.bend = np.arange(self.state.size, dtype=np.int32).reshape(self.state.shape)

    def _place_window(self, ground: Ground, row: int, col: int) -> None:
        """Lay the window as any other, with the patrolled points open."""
        self._find_window(ground, row, col)
        open_up(ground.state, self._open, self.state, self.row0 + 1, self.col0 + 1)

    def _prepare_memory(self) -> None:
        """Nothing is kept between calls: a longer limit overwrites."""

    def extend(self, limit: int) -> None:
        """Settle every path up to ``limit`` hundredths of a point."""
        span = min(self.span, -(-limit // 100))
        rays(self.state, self.length, self.start_row, self.start_col, *self.aside, span, limit)
