"""Straight paths: the line to every patrolled point, and to nothing else."""

import math

import numpy as np
import pytest

from agent.kernels.wave import FAR, SETTLED, STATUS
from agent.routes.ground import Ground
from agent.routes.straight import Straight
from patrol.ground.terrain import Terrain

HEIGHT, WIDTH, SPAN = 30, 40, 9


@pytest.mark.parametrize("limit", [250, 100 * SPAN])
def test_lengths_equal_their_formula_wherever_the_window_lies(limit: int) -> None:
    drawn = np.random.default_rng(5)
    patrolled = drawn.random((HEIGHT, WIDTH)) < 0.8
    reach = patrolled & (drawn.random((HEIGHT, WIDTH)) < 0.7)
    ground = Ground(Terrain("t", patrolled, 0.5), reach)
    window = Straight(HEIGHT, WIDTH, SPAN, patrolled)
    # One start after the other, so that what one leaves must not be left to the next.
    for start in [(0, 0), (HEIGHT - 1, WIDTH - 1), (15, 20), (4, 37), (15, 21)]:
        window.begin(ground, start[0] + 1, start[1] + 1)
        window.extend(limit)
        expected = {}
        for row, col in zip(*np.nonzero(patrolled), strict=True):
            length = round(100 * math.dist(start, (row, col)))
            if length <= limit and max(abs(row - start[0]), abs(col - start[1])) <= SPAN:
                expected[int(row), int(col)] = length
        settled = np.argwhere(window.state & STATUS == SETTLED).tolist()
        found = {(row + window.row0, col + window.col0): int(window.length[row, col]) for row, col in settled}
        assert found == expected


def test_a_span_beyond_the_terrain_takes_no_more_memory() -> None:
    everywhere = np.ones((HEIGHT, WIDTH), dtype=np.bool_)
    window, ground = Straight(HEIGHT, WIDTH, 10**7, everywhere), Ground(Terrain("t", everywhere, 1.0), everywhere)
    rows, cols = np.indices((HEIGHT, WIDTH))
    for row, col in ((0, 0), (HEIGHT - 1, WIDTH - 1), (0, WIDTH - 1)):
        window.begin(ground, row + 1, col + 1)
        window.extend(10**6)
        assert np.array_equal(window.length[1:-1, 1:-1], np.rint(100.0 * np.hypot(rows - row, cols - col)))


def test_lengths_from_several_starts_are_those_of_the_nearest() -> None:
    rng = np.random.default_rng(4)
    passable = rng.random((40, 50)) < 0.9
    starts = [(5, 6), (30, 40), (20, 20)]
    for row, col in starts:
        passable[row - 1, col - 1] = True
    ground, window = Ground(Terrain("t", passable, 0.5), passable), Straight(40, 50, 60, passable)
    together = window.lengths_from(ground, 20, 20, starts, 6000)
    alone = [window.lengths_from(ground, 20, 20, [start], 6000) for start in starts]
    assert np.array_equal(together, np.minimum.reduce(alone))
    assert together.min() == 0
    assert (window.lengths_from(ground, 20, 20, [], 6000) == FAR).all()
