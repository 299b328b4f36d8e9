"""The believed fog after dilatation, brought up to date where it is read (paper, "dilatation")."""

from __future__ import annotations

import copy

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from agent.belief.posts import Posts
from agent.kernels.changes import NOTHING, POST, SIDE, WIDEST, boxes_due, note_freshest, take_in
from agent.kernels.dilate import FRAME, LONG, dilate_all
from patrol.ground.fog import AGELESS, Box, Fog
from patrol.ground.terrain import BoolGrid


class Dilated:
    """Staleness, spread over the ground of one robot.

    A tick's looks only note which blocks of points they may change. A block is computed when it is read, once for all
    looks since the last read; a block that is not read costs nothing.
    """

    def __init__(self, fog: Fog, ground: BoolGrid, posts: Posts, reach: int, *, square: bool = False) -> None:
        """Start with a fog in which nothing has been seen; `reach` is the window's half-width in points.

        Staleness spreads over the points of `ground`. With `square` the window is a square, as in the paper, which
        staleness fills through walls too.
        """
        self._fog = fog
        self._gap = posts.gap
        self._reach = reach
        self._reach_in_blocks = -(-reach // SIDE)
        self._ground = np.ascontiguousarray(ground).astype(np.uint8)
        # Multiplied: a post that is no ground stays 0.
        self._ground[posts.rows[:, 2], posts.rows[:, 3]] *= POST
        self._passable = np.ones_like(self._ground) if square else self._ground
        self._carried = np.zeros(ground.shape, dtype=np.int32)
        self._grid: NDArray[np.int32] = np.where(ground, np.int32(0), np.int32(AGELESS))
        rows, cols = (-(-size // SIDE) for size in ground.shape)
        margins = tuple((0, -size % SIDE) for size in ground.shape)
        blocks = (rows, SIDE, cols, SIDE)
        any_ground = np.pad(ground, margins).reshape(blocks).any(axis=(1, 3))
        passable = np.pad(self._passable, margins, constant_values=1).reshape(blocks).all(axis=(1, 3))
        around = min(self._reach_in_blocks, LONG // SIDE)  # what a longer reach takes is the same everywhere
        near = sliding_window_view(np.pad(passable, around, constant_values=True), (2 * around + 1, 2 * around + 1))
        self._clear = near.all(axis=(2, 3)).astype(np.uint8)
        block = posts.rows[:, 2] // SIDE * cols + posts.rows[:, 3] // SIDE
        in_block = np.bincount(block, minlength=rows * cols)
        self._posts_by_block = np.ascontiguousarray(posts.rows[np.argsort(block, kind="stable")])
        self._block_ends = np.concatenate(([0], in_block.cumsum()))
        self._outdated = np.full((rows, cols), NOTHING, dtype=np.int32)
        self._freshest = np.where(any_ground, np.int32(0), np.int32(-1))
        self._due = np.zeros((rows, cols), dtype=np.uint8)
        self._boxes = np.zeros((rows * cols, 4), dtype=np.int64)
        side = WIDEST + 2 * min(reach, LONG) + 2 * FRAME
        self._scratch = np.zeros(3 * side * side, dtype=np.uint16)

    def fork(self, fog: Fog) -> Dilated:
        """Return a copy for another fog, which is now as fresh as this one's."""
        fork = copy.copy(self)
        fork._fog = fog
        fork._carried, fork._grid = self._carried.copy(), self._grid.copy()
        fork._outdated, fork._due = self._outdated.copy(), self._due.copy()
        # The scratch and all that never changes is shared.
        fork._freshest = self._freshest.copy()
        return fork

    def changed(self, looks: list[Box]) -> None:
        """Take in the changes of the fog by a tick's looks."""
        if not looks:
            return
        grids = (self._fog.last_seen, self._ground, self._carried, self._posts_by_block, self._block_ends)
        book = (self._outdated, self._freshest, self._due)
        take_in(*grids, *book, np.array(looks, dtype=np.int64), self._gap, self._reach_in_blocks)

    def within(self, box: Box, tick: int) -> NDArray[np.int32]:
        """Return each point's last-seen tick after dilatation, int32 (h, w), up to date in a box.

        Each call returns the same array. The box may reach beyond the ground. Points that are not ground are always
        `AGELESS`; other points outside the box may be out of date.
        """
        rows, cols = self._find_blocks(box)
        if rows[0] <= rows[1] and cols[0] <= cols[1]:
            height, width = self._ground.shape
            count = boxes_due(self._due, self._clear, height, width, *rows, *cols, self._reach, self._boxes)
            if count == 0:
                return self._grid
            boxes = self._boxes[:count]
            grids = (self._carried, self._ground, self._passable, self._grid)
            dilate_all(*grids, boxes, self._reach, tick, self._scratch)
            if self._passable is not self._ground:
                np.copyto(self._grid, AGELESS, where=self._ground == 0)
            note_freshest(self._ground, self._grid, self._freshest, boxes)
        return self._grid

    def _find_blocks(self, box: Box) -> tuple[tuple[int, int], tuple[int, int]]:
        """First and last row and first and last column of the blocks that a box of points touches."""
        rows, cols = self._due.shape
        top, bottom, left, right = box
        return (
            (max(0, top // SIDE), min(rows - 1, bottom // SIDE)),
            (max(0, left // SIDE), min(cols - 1, right // SIDE)),
        )
