"""The wave: Lee's paths round obstacles (paper, "The wave"), over a box of the ground or around one robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.kernels.wave import DIAGONAL_LAST, DRAWN, FIRST_BENDS, framed_box, settle, settle_box
from agent.routes.ground import BoxPaths, Ground
from agent.routes.path_window import Lengths, PathWindow, Place
from patrol.kernels.footprint import cast
from patrol.scenario.policies import Ties

LONGEST = 2**26
"""Longest path that fits an entry, in hundredths of a point."""

MOST_POINTS = 2**28
"""Points of the largest window whose indices fit an entry."""

NEXT_TO = 1.5
"""How far a look reaches to the eight neighbours, and no farther, in points."""

Box = tuple[int, int, int, int]
"""First and end row, first and end column of the terrain; ends are exclusive."""

NO_SIGHT: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
FOUND = {None: FIRST_BENDS, "diagonal": FIRST_BENDS, "straight": DIAGONAL_LAST, "drawn": DRAWN}


def box_around(point: tuple[int, int], reach: int, shape: tuple[int, int]) -> Box:
    """Return the box that holds all points within `reach` rows and columns of a point (row, col)."""
    return box_between(point, point, 2 * reach, shape)


def box_between(first: tuple[int, int], second: tuple[int, int], steps: int, shape: tuple[int, int]) -> Box:
    """Return the box that holds two points and all paths between them of at most so many steps.

    For example, from column 10 to column 20 in 14 steps: columns 8 to 22. The terrain's edge cuts it off.
    """
    bounds = []
    for from_line, to_line, size in zip(first, second, shape, strict=True):
        total = from_line + to_line
        bounds += [
            max(0, min(from_line, to_line, (total - steps + 1) // 2)),
            min(size, max(from_line, to_line, (total + steps) // 2) + 1),
        ]
    top, bottom, left, right = bounds
    return top, bottom, left, right


def paths_in(
    ground: Ground,
    starts: Sequence[Place] | NDArray[np.int64],
    box: Box,
    limit: int,
    *,
    bends: bool = False,
    goal: Place | None = None,
) -> BoxPaths:
    """Find the paths from the nearest of several starts, over a box of the ground.

    Starts are open points (row, col) of the terrain; those outside of the box do not count. `limit` is in hundredths of
    a point, at most `LONGEST`. Paths that leave the box are not known. `bends` takes a single start. With a goal,
    an open point within the box, only the path to it is sure to be found.
    """
    top, bottom, left, right = box
    rows, cols = bottom - top + 2, right - left + 2
    if rows * cols > MOST_POINTS:
        raise ValueError(f"a box of {rows * cols} points is larger than {MOST_POINTS}")
    state, sight = framed_box(ground.state, top, bottom, left, right), NO_SIGHT
    begins = np.array(starts, dtype=np.int64).reshape(-1, 2) - (top - 1, left - 1)
    if bends:
        sight, (row, col) = np.zeros((rows, cols), np.uint8), begins[0].tolist()
        # A look reaches as far as the terrain is long.
        cast(state, row, col, float(max(ground.terrain.shape)), sight, 0, 0)
    end = -1 if goal is None else (goal[0] - top + 1) * cols + goal[1] - left + 1
    length, bend = settle_box(state, sight, begins, limit, end)
    return BoxPaths(length, bend, top - 1, left - 1, limit)


class Wave(PathWindow):
    """Shortest 8-connected paths: straight steps count 1, diagonal ones 1.41 points, and no path cuts a corner."""

    def __init__(self, height: int, width: int, span: int, ties: Ties | None = None) -> None:
        """Allocate the window.

        With ties, `bend` holds each path's first step, one of eight (paper, "The wave"), in place of its first bend: of
        equally long paths the one that `ties` names.
        """
        super().__init__(height, width, span)
        self._ties = ties
        if self.state.size > MOST_POINTS:
            raise ValueError(f"a window of {self.state.size} points is larger than {MOST_POINTS}")
        self._sight = np.zeros_like(self.state)
        self._settled = -1

    def _prepare_memory(self) -> None:
        self._settled = -1

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """Find lengths as `PathWindow.lengths_from`, by one wave from all starts at once."""
        self._find_window(ground, row, col)
        rows, cols = self.state.shape
        box = self.row0 + 1, self.row0 + rows - 1, self.col0 + 1, self.col0 + cols - 1
        points = [(row - 1, col - 1) for row, col in starts]
        return paths_in(ground, points, box, min(limit, LONGEST)).length

    def extend(self, limit: int) -> None:
        """Settle paths as `PathWindow.extend`; a larger limit than before takes another wave."""
        limit = min(limit, LONGEST)
        if limit <= self._settled:
            return
        self._settled = limit
        rows, cols = self.state.shape
        reach = limit // 100
        top, bottom = max(0, self.start_row - reach), min(rows, self.start_row + reach + 1)
        left, right = max(0, self.start_col - reach), min(cols, self.start_col + reach + 1)
        # As far as a straight path within the limit: a diagonal step counts 1.41, but is 0.3 % longer. Where only the
        # start's neighbours are in sight, the first bend of every path is its first step.
        look = min(self.span, 1.003 * limit / 100) if self._ties is None else NEXT_TO
        cast(self.state, self.start_row, self.start_col, look, self._sight, 0, 0)
        grids, box = (self.state, self._sight, self.length, self.bend), (top, bottom, left, right)
        start = np.array([self.start_row * cols + self.start_col])
        settle(*grids, start, limit, *box, FOUND[self._ties], self.key, self.row0, self.col0, -1)
