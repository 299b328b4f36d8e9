"""The ground of the moving intruder: points about a metre apart, the moves between them, and where it may enter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid

POINT_M = 1.0
"""Distance of the points at least, m."""

MOST_POINTS = 10_000
"""Points of the ground at most, about: of larger ground the distance is larger."""

MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))
"""Rows and columns from a square to its neighbours, the straight moves first."""

OPPOSITE = (1, 0, 3, 2, 7, 6, 5, 4)
"""The number of the move back, by that of the move."""

Points = NDArray[np.int64]
"""int64 (points,)"""
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class IntruderGround:
    """Points on which the intruder moves, one in each square of a grid that has open ground; arrays are by point."""

    rows: Points  # of the terrain
    cols: Points  # likewise
    neighbours: NDArray[np.int32]  # (points, 8), where a move in each direction of `MOVES` leads to; -1 for none
    squares: Points  # flat index of each point's square, in the grid with one more square on each side
    shape: tuple[int, int]  # rows and columns of that grid
    point_m: float  # length of a straight move
    entries: Flags  # where the intruder may enter
    depths_m: NDArray[np.float64]  # length of the shortest way from an entry; infinite where no way leads
    wanted: Flags | None = None  # where it wants to stay, however deep; None where the depth decides


def ground_of(
    free: BoolGrid,
    point_m: float,
    enters: BoolGrid | None = None,
    wants: BoolGrid | None = None,
    apart_m: float = POINT_M,
) -> IntruderGround:
    """Lay points over the patrolled ground, one in each square, the nearest to its centre.

    `point_m` is the side of the terrain's points, and `apart_m` that of the squares at least. Without `enters` the
    intruder may enter at the edge of the ground; without `wants` the depth decides where it wants to stay.
    """
    smallest = math.ceil(math.sqrt(np.count_nonzero(free) / MOST_POINTS))
    side = max(math.ceil(apart_m / point_m - 1e-6), smallest, 1)
    number, rows, cols = _number_points(free, side)
    neighbours = np.full((len(rows), len(MOVES)), -1, dtype=np.int32)
    padded = np.pad(number, 1, constant_values=-1)
    for k, back in ((k, back) for k, back in enumerate(OPPOSITE) if k < back):
        down, right = MOVES[k]
        beside = padded[rows // side + 1 + down, cols // side + 1 + right]
        here = np.flatnonzero(beside >= 0)
        here = here[_is_clear(free, rows[here], cols[here], rows[beside[here]], cols[beside[here]])]
        neighbours[here, k], neighbours[beside[here], back] = beside[here], here
    apart_m = side * point_m
    squares_in = rows // side, cols // side
    entries = (_edge_squares(number) if enters is None else _marked_squares(enters & free, side))[squares_in]
    squares = (rows // side + 1) * padded.shape[1] + cols // side + 1
    depths_m = _entry_distances(neighbours, apart_m, entries)
    wanted = None if wants is None else _marked_squares(wants & free, side)[squares_in]
    return IntruderGround(rows, cols, neighbours, squares, padded.shape, apart_m, entries, depths_m, wanted)


def _marked_squares(marks: BoolGrid, side: int) -> Flags:
    """Return the squares that hold a mark."""
    squares = np.zeros((-(-marks.shape[0] // side), -(-marks.shape[1] // side)), dtype=np.bool_)
    rows, cols = np.nonzero(marks)
    squares[rows // side, cols // side] = True
    return squares


def _number_points(free: BoolGrid, side: int) -> tuple[NDArray[np.int32], Points, Points]:
    """Return the number of the point in each square, -1 for none, and the points' rows and columns."""
    within = np.full((-(-free.shape[0] // side), -(-free.shape[1] // side)), -1, dtype=np.int64)
    middle = (side - 1) / 2.0
    by_distance = sorted(np.ndindex(side, side), key=lambda place: (place[0] - middle) ** 2 + (place[1] - middle) ** 2)
    for row, col in by_distance:
        opened = free[row::side, col::side]
        squares = within[: opened.shape[0], : opened.shape[1]]
        squares[opened & (squares < 0)] = row * side + col
    number = np.full(within.shape, -1, dtype=np.int32)
    with_point = np.nonzero(within >= 0)
    number[with_point] = np.arange(len(with_point[0]))
    down, right = np.divmod(within[with_point], side)
    return number, with_point[0] * side + down, with_point[1] * side + right


def _is_clear(free: BoolGrid, rows: Points, cols: Points, to_rows: Points, to_cols: Points) -> Flags:
    """Return where the straight line between two points is open.

    Where it runs between two points of the terrain, one of them must be: it may pass the corner of a wall, but not
    between two corners that touch.
    """
    down, right = to_rows - rows, to_cols - cols
    steps = 2 * int(max(np.abs(down).max(initial=0), np.abs(right).max(initial=0), 1))
    clear = np.ones(len(rows), dtype=np.bool_)
    for share in np.arange(steps + 1) / steps:
        sides = (
            free[
                np.rint(rows + share * down + aside * right).astype(int),
                np.rint(cols + share * right - aside * down).astype(int),
            ]
            for aside in (-1e-6, 1e-6)
        )
        clear &= np.logical_or(*sides)
    return clear


def _edge_squares(number: NDArray[np.int32]) -> Flags:
    """Return the squares on the terrain's edge.

    Where there are none, because a wall surrounds it, return the first and the last with a point in each row and
    column.
    """
    is_ground = number >= 0
    edge = is_ground.copy()
    edge[1:-1, 1:-1] = False
    if edge.any():
        return edge
    for grid, marks in ((is_ground, edge), (is_ground.T, edge.T)):
        lines = np.flatnonzero(grid.any(axis=1))
        marks[lines, grid[lines].argmax(axis=1)] = True
        marks[lines, grid.shape[1] - 1 - grid[lines, ::-1].argmax(axis=1)] = True
    return edge


def _entry_distances(neighbours: NDArray[np.int32], apart_m: float, entries: Flags) -> NDArray[np.float64]:
    """Return the length of the shortest way from an entry to each point, m."""
    lengths_m = apart_m * np.array([1.0] * 4 + [math.sqrt(2.0)] * 4)
    # The last one is that of the neighbours that are not there, which have the number -1.
    depths_m = np.append(np.where(entries, 0.0, np.inf), np.inf)
    while True:
        nearer_m: NDArray[np.float64] = np.minimum(depths_m[:-1], (depths_m[neighbours] + lengths_m).min(axis=1))
        if np.array_equal(nearer_m, depths_m[:-1]):
            return nearer_m
        depths_m[:-1] = nearer_m
