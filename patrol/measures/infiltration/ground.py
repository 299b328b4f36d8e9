"""The ground of the moving intruder: points about a metre apart, the moves between them, and where it may enter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid

POINT_M = 1.0
"""Distance of the points at least, m."""

MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))
"""Rows and columns from a cell to its neighbours, the straight moves first."""

Points = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class IntruderGround:
    """Points on which the intruder moves.

    Attributes:
        rows: int64 (points,), of the terrain.
        cols: int64 (points,), likewise.
        neighbours: int32 (points, 8), the points that a move in each direction of `MOVES` leads to; -1 for none.
        point_m: Length of a straight move, m.
        entries: bool (points,), where the intruder may enter.
        depths_m: float64 (points,), length of the shortest way from an entry; infinite where no way leads.
    """

    rows: Points
    cols: Points
    neighbours: NDArray[np.int32]
    point_m: float
    entries: Flags
    depths_m: NDArray[np.float64]


def ground_of(free: BoolGrid, point_m: float, apart_m: float = POINT_M) -> IntruderGround:
    """Lay points over the open ground, one in each square of `apart_m`, the nearest to its centre.

    Args:
        free: bool (h, w), the ground that is patrolled.
        point_m: Side of its points, m.
        apart_m: Side of the squares at least, m.
    """
    side = max(math.ceil(apart_m / point_m - 1e-6), 1)
    number, rows, cols = _cells(free, side)
    neighbours = np.full((len(rows), len(MOVES)), -1, dtype=np.int32)
    padded = np.pad(number, 1, constant_values=-1)
    for k, (down, right) in enumerate(MOVES):
        other = padded[rows // side + 1 + down, cols // side + 1 + right]
        linked = other >= 0
        linked[linked] = _clear(free, rows[linked], cols[linked], rows[other[linked]], cols[other[linked]])
        neighbours[linked, k] = other[linked]
    apart_m = side * point_m
    entries = _edge(number)[rows // side, cols // side]
    return IntruderGround(rows, cols, neighbours, apart_m, entries, _depths(neighbours, apart_m, entries))


def _cells(free: BoolGrid, side: int) -> tuple[NDArray[np.int32], Points, Points]:
    """Return the number of the point in each square, -1 for none, and the points' rows and columns."""
    rows, cols = np.nonzero(free)
    middle = (side - 1) / 2.0
    off = (rows % side - middle) ** 2 + (cols % side - middle) ** 2
    height, width = -(-free.shape[0] // side), -(-free.shape[1] // side)
    cell = rows // side * width + cols // side
    order = np.lexsort((off, cell))
    first = np.append(True, np.diff(cell[order]) > 0)
    rows, cols = rows[order][first], cols[order][first]
    number = np.full((height, width), -1, dtype=np.int32)
    number[rows // side, cols // side] = np.arange(len(rows))
    return number, rows, cols


def _clear(free: BoolGrid, rows: Points, cols: Points, to_rows: Points, to_cols: Points) -> Flags:
    """Return where the straight line between two points is open."""
    steps = 2 * int(max(np.abs(to_rows - rows).max(initial=0), np.abs(to_cols - cols).max(initial=0), 1))
    clear = np.ones(len(rows), dtype=np.bool_)
    for share in np.arange(steps + 1) / steps:
        at = np.rint(rows + share * (to_rows - rows)).astype(int), np.rint(cols + share * (to_cols - cols)).astype(int)
        clear &= free[at]
    return clear


def _edge(number: NDArray[np.int32]) -> Flags:
    """Return the squares on the terrain's edge; where there are none, because a wall surrounds it, those that are the
    first or the last with a point in their row or column.
    """
    there = number >= 0
    edge = there.copy()
    edge[1:-1, 1:-1] = False
    if edge.any():
        return edge
    for grid, marks in ((there, edge), (there.T, edge.T)):
        lines = np.flatnonzero(grid.any(axis=1))
        marks[lines, grid[lines].argmax(axis=1)] = True
        marks[lines, grid.shape[1] - 1 - grid[lines, ::-1].argmax(axis=1)] = True
    return edge


def _depths(neighbours: NDArray[np.int32], apart_m: float, entries: Flags) -> NDArray[np.float64]:
    linked = neighbours >= 0
    here, move = np.nonzero(linked)
    lengths = np.where(move < 4, apart_m, math.sqrt(2.0) * apart_m)
    graph = sparse.csr_array((lengths, (here, neighbours[linked])), shape=(len(entries), len(entries)))
    if not entries.any():
        return np.full(len(entries), np.inf)
    return np.asarray(dijkstra(graph, indices=np.flatnonzero(entries), min_only=True))
