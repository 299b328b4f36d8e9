"""The intruder's points on maps made by hand."""

import numpy as np
import pytest

from experiments.intruders.ground import IntruderGround, ground_of
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
MOST_POINTS = 10_000


def drawn(*lines: str) -> np.ndarray:
    """Open ground is a dot."""
    return np.array([[sign == "." for sign in line] for line in lines])


def moves(ground: IntruderGround) -> set[tuple[int, int]]:
    return {(u, int(v)) for u, row in enumerate(ground.neighbours) for v in row if v >= 0}


def test_on_open_ground_it_enters_at_the_edge() -> None:
    ground = ground_of(np.ones((5, 5), dtype=np.bool_), 1.0)
    assert np.count_nonzero(~ground.entries) == 9
    assert ground.depths_m.reshape(5, 5)[2].tolist() == [0.0, 1.0, 2.0, 1.0, 0.0]


def test_within_walls_it_enters_at_the_outermost_points() -> None:
    ground = ground_of(drawn("#####", "#...#", "#...#", "#...#", "#####"), 1.0)
    assert np.count_nonzero(~ground.entries) == 1
    assert ground.depths_m.max() == 1.0


def test_nothing_leads_through_a_wall_that_is_thinner_than_a_square() -> None:
    """Squares of four points; a wall of one point between the second and the third column of squares."""
    free = np.ones((8, 16), dtype=np.bool_)
    free[:, 8] = False
    ground = ground_of(free, 0.25)
    left = ground.cols < 8
    assert not {(u, v) for u, v in moves(ground) if left[u] != left[v]}
    assert len(ground.rows) == 8


def test_a_closed_room_cannot_be_entered() -> None:
    ground = ground_of(drawn("......", ".####.", ".#..#.", ".####.", "......"), 1.0)
    closed = np.isinf(ground.depths_m)
    assert list(zip(ground.rows[closed].tolist(), ground.cols[closed].tolist(), strict=True)) == [(2, 2), (2, 3)]


@pytest.mark.parametrize("top", [0, 1])
@pytest.mark.parametrize("left", [0, 1])
def test_it_passes_a_corner_but_not_between_two_that_touch(top: int, left: int) -> None:
    free = np.zeros((3, 3), dtype=np.bool_)
    free[top : top + 2, left : left + 2] = drawn(".#", "..")
    assert (0, 2) in moves(ground_of(free, 1.0))
    free[top : top + 2, left : left + 2] = drawn(".#", "#.")
    assert not moves(ground_of(free, 1.0))


def test_entries_and_targets_are_the_squares_that_hold_some() -> None:
    mark = np.zeros((8, 8), dtype=np.bool_)
    mark[5, 5] = True
    ground = ground_of(np.ones((8, 8), dtype=np.bool_), 0.25, mark, mark.T)
    assert ground.entries.tolist() == [False, False, False, True]
    assert present(ground.wanted).tolist() == [False, False, False, True]
    assert ground.depths_m == pytest.approx([2.0**0.5, 1.0, 1.0, 0.0])


def test_larger_ground_has_larger_squares() -> None:
    ground = ground_of(np.ones((400, 300), dtype=np.bool_), 1.0)
    assert ground.point_m == 4.0
    assert len(ground.rows) == 7500 <= MOST_POINTS


def test_neighbours_are_in_the_order_of_the_moves() -> None:
    """Up, down, left, right, and the diagonals from the upper left to the lower right; rows come one after another."""
    ground = ground_of(np.ones((3, 4), dtype=np.bool_), 1.0)
    assert ground.neighbours[5].tolist() == [1, 9, 4, 6, 0, 2, 8, 10]
    assert ground.neighbours[0].tolist() == [-1, 4, -1, 1, -1, -1, -1, 5]
    assert ground.neighbours[11].tolist() == [7, -1, 10, -1, 6, -1, -1, -1]
