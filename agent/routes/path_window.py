"""The result of every path method: state, length and first bend of the paths, over a window of the ground."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import FAR, SETTLED, STATUS
from agent.routes.ground import Ground

DIAGONAL = 141
"""The length of the longest step of a path from point to point."""

Place = tuple[int, int]
Aside = tuple[float, float]
CENTRE: Aside = (0.0, 0.0)
"""The robot is in the centre of its point."""

Lengths = NDArray[np.int32]


class PathWindow(ABC):
    """Paths from one start, up to a growing length.

    The window holds everything within ``span`` points of the start, and a blocked frame. Its arrays are reused from one
    start to the next, and minds that never think at the same time may share them.

    Paths are known where the two low bits of `state` are `agent.kernels.wave.SETTLED`. There `length` is in
    hundredths of a point, and `bend` is a flat index into the window: of the path's first bend, or of the point itself
    where the path has none. `row0` and `col0` are the row and column of the terrain's point under element (0, 0).
    `aside` is rows and columns from the start to the robot, in points; straight paths are measured from the robot.
    `key` is that of the draws between equally long paths.
    """

    def __init__(self, height: int, width: int, span: int) -> None:
        """Allocate the window, for a terrain of height and width in points."""
        self.span = span
        rows, cols = min(height, 2 * span + 1) + 2, min(width, 2 * span + 1) + 2
        self.state = np.zeros((rows, cols), dtype=np.uint8)
        self.length = np.zeros((rows, cols), dtype=np.int32)
        self.bend = np.zeros((rows, cols), dtype=np.int32)
        self.row0 = self.col0 = self.start_row = self.start_col = 0
        self.aside, self.key = CENTRE, 0

    def begin(self, ground: Ground, row: int, col: int, aside: Aside = CENTRE, key: int = 0) -> None:
        """Start from an open element of the ground, (row, col) of `Ground.state`."""
        self._place_window(ground, row, col)
        self.start_row, self.start_col = row - self.row0 - 1, col - self.col0 - 1
        self.aside, self.key = aside, key
        self._prepare_memory()

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """Return the path lengths from the nearest of several starts, int32 (m, n) in hundredths of a point.

        They are `FAR` where the path is longer than the limit or does not exist. The window lies around (row, col) of
        `Ground.state`; starts, elements of it too, are left out where they are outside the window. Results of earlier
        calls of `begin` and `extend` are lost.
        """
        nearest = np.full(self.state.shape, FAR, dtype=np.int32)
        self.aside = CENTRE
        for start_row, start_col in starts:
            self._place_window(ground, row, col)
            self.start_row, self.start_col = start_row - self.row0 - 1, start_col - self.col0 - 1
            if self._holds_point(self.start_row, self.start_col):
                self._prepare_memory()
                self.extend(limit)
                np.minimum(nearest, np.where(self.state & STATUS == SETTLED, self.length, FAR), out=nearest)
        return nearest

    def _place_window(self, ground: Ground, row: int, col: int) -> None:
        """Lay the window around (row, col) of the ground's state, with all paths unknown."""
        self._find_window(ground, row, col)
        rows, cols = self.state.shape
        top, left = self.row0 + 1, self.col0 + 1
        self.state[1:-1, 1:-1] = ground.state[top + 1 : top + rows - 1, left + 1 : left + cols - 1]

    def _find_window(self, ground: Ground, row: int, col: int) -> None:
        """Find where the window around (row, col) of the ground's state lies."""
        rows, cols = self.state.shape
        top = min(max(0, row - 1 - self.span), ground.state.shape[0] - rows)
        left = min(max(0, col - 1 - self.span), ground.state.shape[1] - cols)
        self.row0, self.col0 = top - 1, left - 1

    def _holds_point(self, row: int, col: int) -> bool:
        rows, cols = self.state.shape
        return 0 < row < rows - 1 and 0 < col < cols - 1

    @abstractmethod
    def _prepare_memory(self) -> None:
        """Prepare the method's own working memory."""

    @abstractmethod
    def extend(self, limit: int) -> None:
        """Settle every path up to a length in hundredths of a point, at most 100 * span.

        Settled paths stay so: a length no larger than an earlier one since `begin` changes nothing.
        """
