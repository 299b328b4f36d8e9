"""The kernels of observations, against plain loops."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.kernels.surroundings import count_free, fill_features, fill_heard, fill_window, sum_ages

SHAPE = 19, 27
Grids = tuple[NDArray[np.int32], NDArray[np.bool_], NDArray[np.bool_]]


@pytest.fixture(name="ground")
def ground_of(rng: np.random.Generator) -> Grids:
    seen = rng.integers(-1, 90, SHAPE).astype(np.int32)
    return seen, rng.random(SHAPE) < 0.7, rng.random(SHAPE) < 0.8


@pytest.fixture(name="rng")
def generator() -> np.random.Generator:
    return np.random.default_rng(5)


def sector_of(across: float, up: float) -> int:
    return round(math.degrees(math.atan2(up, across)) / 45.0) % 8


PLACES = [(9, 13), (0, 0), (18, 26), (-3, 5), (7, 40)]


@pytest.mark.parametrize(("row", "col"), PLACES)
def test_ages_are_summed_by_the_sector_in_which_their_point_lies(ground: Grids, row: int, col: int) -> None:
    seen, patrolled, _ = ground
    tick, half = 100, 4
    expected = np.zeros((8, 4), dtype=np.int64)
    for r, c in zip(*np.nonzero(patrolled), strict=True):
        if (r, c) != (row, col):
            is_near = max(abs(r - row), abs(c - col)) <= half
            expected[sector_of(c - col, r - row), 0 if is_near else 2] += tick - max(int(seen[r, c]), 0)
            expected[sector_of(c - col, r - row), 1 if is_near else 3] += 1
    sums = np.full((8, 4), -1, dtype=np.int64)
    sum_ages(seen, patrolled, row, col, half, tick, sums)
    np.testing.assert_array_equal(sums, expected)


@pytest.mark.parametrize(("row", "col"), PLACES)
def test_the_window_is_cut_out_of_the_ground_and_zero_beyond_it(ground: Grids, row: int, col: int) -> None:
    seen, patrolled, is_open = ground
    window = np.full((2, 7, 7), np.nan, dtype=np.float32)
    fill_window(seen, patrolled, is_open, row, col, 100, 50, window)
    for up in range(-3, 4):
        for across in range(-3, 4):
            r, c = row + up, col + across
            inside = 0 <= r < SHAPE[0] and 0 <= c < SHAPE[1]
            age = (100 - max(int(seen[r, c]), 0)) / 50 if inside and patrolled[r, c] else 0.0
            assert window[0, up + 3, across + 3] == np.float32(age)
            assert window[1, up + 3, across + 3] == float(inside and is_open[r, c])


def test_a_ray_counts_to_the_first_point_that_is_closed_or_off_the_ground() -> None:
    is_open = np.ones((5, 6), dtype=np.bool_)
    is_open[2, 4] = False
    rays = np.array([[[0, 1], [0, 2], [0, 3]], [[1, 0], [2, 0], [3, 0]], [[-1, -1], [-1, -1], [-1, -1]]])
    ways = np.zeros(3, dtype=np.int64)
    count_free(is_open, 2, 1, rays, ways)
    assert ways.tolist() == [2, 2, 3]


def test_features_are_mean_ages_free_ways_nearness_and_the_heading(rng: np.random.Generator) -> None:
    sums = rng.integers(0, 500, (8, 4))
    sums[3] = 0
    ways = rng.integers(0, 11, 8)
    places = rng.uniform(-12, 12, (20, 2))
    heading, x, y, half = 0.7, 0.5, -0.3, 10.0
    features = np.full((8, 5), np.nan, dtype=np.float32)
    fill_features(sums, 60, ways, 10, places, x, y, half, math.cos(heading), math.sin(heading), features)
    for s in range(8):
        near, far = (sums[s, k] / (max(int(sums[s, k + 1]), 1) * 60) for k in (0, 2))
        away = [math.hypot(a - x, b - y) for a, b in places.tolist() if sector_of(a - x, b - y) == s]
        nearness = max([1.0 - min(away, default=half) / half, 0.0])
        ahead = math.cos(heading - math.radians(45 * s))
        assert features[s].tolist() == pytest.approx([near, far, ways[s] / 10, nearness, ahead], abs=1e-6)


def test_the_nearest_robots_come_first_and_the_rest_is_zero() -> None:
    places, ticks = np.array([[9.0, 1.0], [2.0, 1.0], [1.0, -200.0]]), np.array([10, 18, 20])
    heard = np.full((4, 4), np.nan, dtype=np.float32)
    fill_heard(places, ticks.copy(), 1.0, 1.0, 100.0, 20, 10.0, heard)
    expected = [[1.0, 0.01, 0.0, 0.2], [1.0, 0.08, 0.0, 1.0], [1.0, 0.0, -1.0, 0.0], [0.0] * 4]
    assert heard.ravel().tolist() == pytest.approx(np.array(expected).ravel().tolist(), abs=1e-7)
    fill_heard(places, ticks, 1.0, 1.0, 100.0, 20, 10.0, heard[:1])
    assert heard[0].tolist() == pytest.approx(expected[0], abs=1e-7)
