"""The wave: Lee's paths round obstacles (paper, "The wave")."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agent.routes.ground import Ground
from agent.routes.kernels.bends import follow
from agent.routes.kernels.bends_by_rows import estimate, take_over
from agent.routes.kernels.lengths import read, spread
from agent.routes.kernels.ties import decide
from agent.routes.kernels.wave import (
    ALL_WAYS,
    BESIDE,
    BEYOND,
    DONE,
    FULL,
    NOW,
    SEEN,
    lay,
    settle,
    show,
)
from agent.routes.path_window import Lengths, PathWindow, Place
from patrol.ground.kernels.footprint import cast

LONGEST = 2**26
"""Longest path that fits a cell, in hundredths of a point."""

MOST_POINTS = 2**28
"""Points of the largest window whose indices fit an entry."""

MANY_POINTS = 2**17
"""Points below which it is not worth while to find first bends row by row; run by run is as fast."""

MOST_LOOKED_AT = 3
"""Points of a box for each whose bend is not known, above which run by run is faster."""

SHORT = 16
"""Points for each change of direction along rows, and for each stretch that is gone over, below which run by run is
faster."""

ROOM = 2**12
"""Entries for which a new wave has room; it makes more as needed."""

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
        self._lists = np.zeros((5, ROOM), dtype=np.uint32)
        self._mark = np.zeros(8, dtype=np.int64)
        self._near: Lengths | None = None
        self._laid: Box | None = None
        self._followed = 0

    def _begin(self) -> None:
        self._laid = None

    def lengths_from(self, ground: Ground, row: int, col: int, starts: Sequence[Place], limit: int) -> Lengths:
        """As `PathWindow.lengths_from`, by one wave from all starts at once."""
        self._place(ground, row, col)
        rows, cols = self.state.shape
        inside = sorted({(r - self.row0 - 1, c - self.col0 - 1) for r, c in starts})
        begin = np.array([r * cols + c for r, c in inside if self._holds(r, c)], dtype=np.int64)
        limit = min(limit, LONGEST)
        while not spread(self.state, 0, 0, self._cell, cols, self._lists, begin, limit, 0, rows, 0, cols):
            self._make_room()
        show(self._cell, self.state, self.length, 1, limit, 0, rows, 0, cols)
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
        """As `PathWindow.extend`."""
        limit = min(limit, LONGEST)
        if self._laid is not None and limit <= self._mark[DONE]:
            return
        box, cols = self._lay(limit), self.state.shape[1]
        settle(self._cell, self._lists, self._mark, cols, limit)
        decide(self._cell, self._lists, self._mark, cols, limit)
        if not self._mark[FULL]:
            self._find_bends(limit, box)
        if self._mark[FULL]:
            self._make_room()
            self._laid = None
            self.extend(limit)
        else:
            show(self._cell, self.state, self.length, 5, limit, *box)

    def _find_bends(self, limit: int, box: Box) -> None:
        """Find the first bends of all settled paths, row by row or run by run."""
        cols, bend = self.state.shape[1], self.bend.reshape(-1)
        start, most = self.start_row * cols + self.start_col, self._worth(limit, box)
        if most == 0 or not take_over(self._cell, bend, self._mark, start, cols, limit, *box, most):
            follow(self._cell, bend, self._lists, self._mark, start, cols, limit)
            self._followed = limit

    def _worth(self, limit: int, box: Box) -> int:
        """The stretches of rows to go over at most to find bends row by row; 0 to go run by run at once.

        Row by row looks at all of the box; run by run goes along all paths that were not followed yet.
        """
        top, bottom, left, right = box
        looked_at = (bottom - top) * (right - left)
        if looked_at < MANY_POINTS:  # not worth an estimate
            return 0
        points, changes = estimate(self._cell, self.state.shape[1], self._followed, limit, *box)
        filled = points >= MANY_POINTS and MOST_LOOKED_AT * points >= looked_at
        return points // SHORT if filled and SHORT * changes <= points else 0

    def _lay(self, limit: int) -> Box:
        """Make the cells ready that paths up to a length may come by; returns a box around them."""
        rows, cols = self.state.shape
        # Runs end up to a diagonal step beyond the limit, and ask for the points beside their last one.
        reach = limit // 100 + 4
        top, bottom = max(0, self.start_row - reach), min(rows, self.start_row + reach + 1)
        left, right = max(0, self.start_col - reach), min(cols, self.start_col + reach + 1)
        box = top, bottom, left, right
        laid = self._laid
        if laid is not None and laid[0] <= top and bottom <= laid[1] and laid[2] <= left and right <= laid[3]:
            return box
        # All of the box is in range of this look, its corners too, unless the window's span ends before.
        cast(self.state, self.start_row, self.start_col, float(min(self.span, 2 * reach)), self._sight, 0, 0)
        if laid is None:
            lay(self.state, self._sight, self._cell, *box)
            self._start()
        else:
            lay(self.state, self._sight, self._cell, top, laid[0], left, right)
            lay(self.state, self._sight, self._cell, laid[1], bottom, left, right)
            lay(self.state, self._sight, self._cell, laid[0], laid[1], left, laid[2])
            lay(self.state, self._sight, self._cell, laid[0], laid[1], laid[3], right)
        self._laid = box
        return box

    def _around(self, one: Place, other: Place, apart: int) -> Box:
        """The part of the window whose points have rows, and columns, no farther than this from two places together.

        It is two points larger on each side, because the outermost points of a box count as blocked.
        """
        (rows, cols), (up, across) = self.state.shape, (one[0] + other[0], one[1] + other[1])
        top, left = max(0, (up - apart) // 2 - 2), max(0, (across - apart) // 2 - 2)
        return top, min(rows, (up + apart) // 2 + 4), left, min(cols, (across + apart) // 2 + 4)

    def _start(self) -> None:
        """Let paths begin at the start."""
        start = self.start_row * self.state.shape[1] + self.start_col
        self._cell[start] = self._cell[start] & SEEN | BESIDE
        self.bend.reshape(-1)[start] = start
        self._mark[:] = 0
        self._mark[NOW] = self._mark[BEYOND] = 1
        self._followed = 0
        self._lists[0, 0] = self._lists[4, 0] = start * 16 + ALL_WAYS

    def _make_room(self) -> None:
        """Make room for more entries; those at hand are lost."""
        self._lists = np.zeros((5, 4 * self._lists.shape[1]), dtype=np.uint32)
