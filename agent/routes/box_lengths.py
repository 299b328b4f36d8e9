"""Path lengths over a box of the ground that is no larger than they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.routes.kernels.lengths import spread

if TYPE_CHECKING:
    from agent.routes.ground import Ground

Box = tuple[int, int, int, int]
"""First and end row, first and end column of the terrain; ends are exclusive."""

ROOM = 2**12
"""Entries for which a new wave has room; it makes more as needed."""


class BoxLengths(NamedTuple):
    """The lengths of paths over a box.

    Attributes:
        cell: uint32 (m, n), as of `agent.routes.kernels.lengths`: 0 on blocked points, otherwise twice the length of
            the path, in hundredths of a point, and perhaps 1; framed by one blocked point on every side.
        row0: Row of the terrain under row 0.
        col0: Column of the terrain under column 0.
        limit: The longest path that is sure to be right, in hundredths of a point.
    """

    cell: NDArray[np.uint32]
    row0: int
    col0: int
    limit: int

    def length(self, row: int, col: int) -> int:
        """The length of the path to a point (row, col) of the terrain that one leads to, in hundredths of a point."""
        return int(self.cell[row - self.row0, col - self.col0]) >> 1


NO_LENGTHS = BoxLengths(np.zeros((0, 0), dtype=np.uint32), 0, 0, 0)
"""Of paths that were not laid."""


def box_around(point: tuple[int, int], reach: int, shape: tuple[int, int]) -> Box:
    """Return the box that holds all points within some rows and columns of another.

    Args:
        point: Row and column of the other.
        reach: Rows and columns.
        shape: Of the terrain.
    """
    row, col = point
    return max(0, row - reach), min(shape[0], row + reach + 1), max(0, col - reach), min(shape[1], col + reach + 1)


class BoxWave:
    """Lays paths over boxes; keeps its working memory."""

    def __init__(self) -> None:
        self._lists = np.zeros((2, ROOM), dtype=np.uint32)

    def lengths(self, ground: Ground, starts: Sequence[tuple[int, int]], box: Box, limit: int) -> BoxLengths:
        """Lay the paths from the nearest of several starts.

        Args:
            ground: What they lead over.
            starts: Open points (row, col) of the terrain, within the box.
            box: Paths that leave it are not known.
            limit: The longest path, in hundredths of a point; at most 2**26.
        """
        top, bottom, left, right = box
        rows, cols = bottom - top + 2, right - left + 2
        cell, window = np.empty((rows, cols), dtype=np.uint32), (0, rows, 0, cols)
        begin = np.array([(row - top + 1) * cols + col - left + 1 for row, col in sorted(set(starts))], dtype=np.int64)
        while not spread(ground.state, top, left, cell.reshape(-1), cols, self._lists, begin, limit, *window):
            self._lists = np.zeros((2, 4 * self._lists.shape[1]), dtype=np.uint32)
        return BoxLengths(cell, top - 1, left - 1, limit)
