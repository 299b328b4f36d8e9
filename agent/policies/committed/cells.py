"""Paths laid over a box of the ground that is no larger than they ask for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.routes.kernels.lengths import claimed, spread
from agent.routes.kernels.wave import BLOCKED, SETTLED, STATUS

if TYPE_CHECKING:
    from agent.routes.ground import Ground
    from agent.routes.path_window import PathWindow

Box = tuple[int, int, int, int]
"""First and end row, first and end column of the terrain; ends are exclusive."""

ROOM = 2**12
"""Entries for which a new wave has room; it makes more as needed."""

FIRST_REACH = 64
"""How many rows and columns away claimed ground is looked for at first."""

WORTH_A_BOX = 2
"""A box has to be so many times as small as the terrain to be tried before it."""


class Cells(NamedTuple):
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


NO_CELLS = Cells(np.zeros((0, 0), dtype=np.uint32), 0, 0, 0)
"""Of robots that nobody has laid paths for."""


def around(points: Sequence[tuple[int, int]], reach: int, shape: tuple[int, int]) -> Box:
    """The box that holds all points within some rows and columns of others.

    Args:
        points: Rows and columns of the others.
        reach: Rows and columns.
        shape: Of the terrain.
    """
    rows, cols = zip(*points, strict=True)
    top, left = max(0, min(rows) - reach), max(0, min(cols) - reach)
    return top, min(shape[0], max(rows) + reach + 1), left, min(shape[1], max(cols) + reach + 1)


class Layer:
    """Lays paths; keeps its working memory."""

    def __init__(self) -> None:
        self._lists = np.zeros((2, ROOM), dtype=np.uint32)
        self._reach = FIRST_REACH

    def lay(self, ground: Ground, starts: Sequence[tuple[int, int]], box: Box, limit: int) -> Cells:
        """Lay the paths from the nearest of several starts.

        Args:
            ground: What they lead over.
            starts: Open points (row, col) of the terrain; those outside of the box are left out.
            box: Paths that leave it are not known.
            limit: The longest path, in hundredths of a point; at most 2**26.
        """
        top, bottom, left, right = box
        rows, cols = bottom - top + 2, right - left + 2
        cell, window = np.empty((rows, cols), dtype=np.uint32), (0, rows, 0, cols)
        inside = sorted({(row, col) for row, col in starts if top <= row < bottom and left <= col < right})
        begin = np.array([(row - top + 1) * cols + col - left + 1 for row, col in inside], dtype=np.int64)
        while not spread(ground.state, top, left, cell.reshape(-1), cols, self._lists, begin, limit, *window):
            self._make_room()
        return Cells(cell, top - 1, left - 1, limit)

    def claimed(self, ground: Ground, start: tuple[int, int], rivals: NDArray[np.int64], lead: int, limit: int) -> int:
        """The longest path to a point to which no rival has a path that is shorter by more than a lead.

        What lies on a path to a claimed point is claimed itself. So a box that reaches twice as far as the longest of
        these paths holds every path that decides a claim. A box that turns out to be smaller than that is doubled.

        Args:
            ground: What all paths lead over.
            start: An open point (row, col) of the terrain.
            rivals: int64 (n, 2), the points on which rivals stand; those off the terrain are left out.
            lead: In hundredths of a point; at most 2**26.
            limit: The longest path that counts, in hundredths of a point; at most 2**26.

        Returns:
            Its length in hundredths of a point.
        """
        rows, cols = ground.terrain.shape
        whole, reach = (0, rows, 0, cols), self._reach
        while True:
            box = around([start], reach, (rows, cols))
            if WORTH_A_BOX * (box[1] - box[0]) * (box[3] - box[2]) > rows * cols:
                box = whole
            longest = self._claimed_in(box, ground, start, rivals, lead, limit)
            if box == whole or 2 * longest <= 100 * reach:
                self._reach = 3 * longest // 100 + 1  # claimed ground may grow until it is measured again
                return longest
            reach *= 2

    def _claimed_in(
        self, box: Box, ground: Ground, start: tuple[int, int], rivals: NDArray[np.int64], lead: int, limit: int
    ) -> int:
        """The same if nothing were open but a box."""
        top, bottom, left, right = box
        rows, cols = bottom - top + 2, right - left + 2
        cell, origin = np.empty(rows * cols, dtype=np.uint32), (top, left)
        up, across = rivals[:, 0] - top, rivals[:, 1] - left
        inside = (up >= 0) & (up < rows - 2) & (across >= 0) & (across < cols - 2)
        others = (up[inside] + 1) * cols + across[inside] + 1
        begin = (start[0] - top + 1) * cols + start[1] - left + 1
        asked = begin, others, lead, limit
        while (longest := int(claimed(ground.state, *origin, cell, cols, self._lists, *asked))) < 0:
            self._make_room()
        return longest

    def _make_room(self) -> None:
        """Make room for more entries."""
        self._lists = np.zeros((2, 4 * self._lists.shape[1]), dtype=np.uint32)


def cells_of(paths: PathWindow, ground: NDArray[np.uint8] | None, box: Box, limit: int) -> Cells:
    """The settled paths of a window over a box.

    Args:
        paths: The window.
        ground: uint8, what is open now and what blocked, where paths lead over both; the window then holds all of it.
        box: Of the terrain.
        limit: The longest path, in hundredths of a point.
    """
    (rows, cols), (top, bottom, left, right) = paths.state.shape, box
    first_row, first_col = max(0, top - paths.row0), max(0, left - paths.col0)
    part = slice(first_row, min(rows, bottom - paths.row0)), slice(first_col, min(cols, right - paths.col0))
    known = paths.state[part] & STATUS == SETTLED
    if ground is not None:
        known &= ground[part] & STATUS != BLOCKED
    cell = np.where(known, paths.length[part].astype(np.uint32) << 1 | 1, 0).astype(np.uint32)
    return Cells(cell, paths.row0 + first_row, paths.col0 + first_col, limit)
