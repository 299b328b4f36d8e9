"""Straight paths, for terrains without obstacles (paper, scenario 1)."""

from __future__ import annotations

from agent.routes.kernels.straight import rays
from agent.routes.kernels.wave import OPEN
from agent.routes.path_window import Window


class Straight(Window):
    """The path to every point is the line to it, whatever lies between, and whether or not a body fits there."""

    def _begin(self) -> None:
        """Open every point. Nothing is kept between calls: a longer limit simply overwrites."""
        self.state[1:-1, 1:-1] |= OPEN

    def extend(self, limit: int) -> None:
        """Settle every path of at most ``limit`` hundredths of a point."""
        span = min(self.span, -(-limit // 100))
        rays(self.state, self.length, self.bend, self.start_row, self.start_col, span, limit)
