"""Routes: lengths against Dijkstra's algorithm, and ways that bend where the wave's do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.kernels.wave import FAR, SETTLED, STATUS
from agent.routes.ground import Ground
from agent.routes.routes import Routes, Way
from agent.routes.wave import Wave, paths_in
from patrol.ground.terrain import Terrain
from tests.patrol.ground.test_ways import dijkstra

# Not the product's own, so that a wrong one there is noticed.
LONGEST = 2**26

POINT = 0.5
Grid = np.ndarray
seeds = st.integers(0, 2**32 - 1)


def grid_of(seed: int) -> tuple[Grid, tuple[int, int]]:
    """A small random grid and an open point on it."""
    rng = np.random.default_rng(seed)
    height, width = (int(size) for size in rng.integers(2, 14, 2))
    is_open = rng.random((height, width)) < rng.choice([0.5, 0.7, 0.9])
    row, col = int(rng.integers(height)), int(rng.integers(width))
    is_open[row, col] = True
    return is_open, (row, col)


def routes_of(is_open: Grid) -> tuple[Ground, Routes]:
    ground = Ground(Terrain("t", is_open, POINT), is_open)
    return ground, Routes(ground)


def centre(row: int, col: int) -> tuple[float, float]:
    return (col + 0.5) * POINT, (row + 0.5) * POINT


@settings(max_examples=80)
@given(seed=seeds, within=st.floats(0.0, 8.0))
def test_lengths_are_those_of_the_shortest_ways_and_within_leaves_out_what_is_farther(seed: int, within: float) -> None:
    is_open, (row, col) = grid_of(seed)
    _, routes = routes_of(is_open)
    hundredths = dijkstra(is_open, (row, col))
    expected = np.where(hundredths <= round(100.0 * within / POINT), hundredths * POINT / 100.0, np.inf)
    assert routes.lengths(centre(row, col), within) == pytest.approx(expected, rel=1e-12)
    assert routes.lengths(centre(row, col)) == pytest.approx(hundredths * POINT / 100.0, rel=1e-12)


@settings(max_examples=40)
@given(seed=seeds)
def test_lengths_lead_round_what_is_in_the_way_now(seed: int) -> None:
    is_open, (row, col) = grid_of(seed)
    ground, routes = routes_of(is_open)
    free = routes.lengths(centre(row, col))
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 6.0, 2)
    ground.begin([(float(x), float(y), 1.2)])
    left = ground.open_now.copy()
    if left[row, col]:
        assert routes.lengths(centre(row, col)) == pytest.approx(dijkstra(left, (row, col)) * POINT / 100.0, rel=1e-12)
    ground.begin([])
    assert np.array_equal(routes.lengths(centre(row, col)), free)


def test_from_within_what_is_closed_the_ground_is_as_it_is_without_it() -> None:
    is_open = np.ones((40, 40), dtype=np.bool_)
    is_open[20, 5:] = False
    ground, routes = routes_of(is_open)
    ground.begin([(10.0, 5.0, 3.0)])
    assert not ground.open_now[10, 20]
    assert routes.lengths((10.25, 5.25)) == pytest.approx(dijkstra(is_open, (10, 20)) * POINT / 100.0, rel=1e-12)
    # Others go round it still.
    round_it = dijkstra(ground.open_now.copy(), (2, 2)) * POINT / 100.0
    assert routes.lengths((1.25, 1.25)) == pytest.approx(round_it, rel=1e-12)
    assert np.isinf(round_it[10, 20])


@pytest.mark.parametrize("place", [(9.0, 3.0), (-4.0, 3.0), (1e9, -1e9)])
def test_no_way_leads_from_a_place_off_the_ground(place: tuple[float, float]) -> None:
    is_open = np.ones((20, 24), dtype=np.bool_)
    is_open[:, 14:] = False
    _, routes = routes_of(is_open)
    found = routes.lengths(place)
    assert found.shape == is_open.shape
    assert np.isinf(found).all()


def test_lengths_belong_to_whoever_asked() -> None:
    _, routes = routes_of(np.ones((10, 10), dtype=np.bool_))
    first = routes.lengths((1.0, 1.0))
    kept = first.copy()
    routes.lengths((4.0, 4.0))
    assert np.array_equal(first, kept)
    first[:] = 0.0
    assert np.array_equal(routes.lengths((1.0, 1.0)), kept)


@settings(max_examples=60)
@given(seed=seeds)
def test_a_way_bends_where_the_waves_path_does(seed: int) -> None:
    is_open, (row, col) = grid_of(seed)
    ground, routes = routes_of(is_open)
    wave = Wave(is_open.shape[0], is_open.shape[1], max(is_open.shape))
    wave.begin(ground, row + 1, col + 1)
    wave.extend(LONGEST)
    settled = np.argwhere(wave.state & STATUS == SETTLED)
    for r, c in settled[:: max(1, len(settled) // 5)]:
        target = int(r) + wave.row0 + 1, int(c) + wave.col0 + 1
        way = routes.way((row + 1, col + 1), target)
        assert way.place == ground.centre(*target)
        if target == (row + 1, col + 1):
            assert way == Way(way.place, way.place, way.length)
            continue
        bend_row, bend_col = divmod(int(wave.bend[r, c]), wave.state.shape[1])
        assert way.bend == ground.centre(bend_row + wave.row0 + 1, bend_col + wave.col0 + 1)
        assert routes.way((row + 1, col + 1), target, expected=150) == way
        assert routes.way((row + 1, col + 1), target, expected=LONGEST) == way


@settings(max_examples=30)
@given(seed=seeds, density=st.sampled_from([1.0, 0.97, 0.8]))
def test_an_expected_length_saves_work_and_changes_no_way(seed: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    is_open = rng.random((90, 70)) < density
    row, col = int(rng.integers(90)), int(rng.integers(70))
    is_open[row, col] = True
    _, routes = routes_of(is_open)
    for r, c in rng.permutation(np.argwhere(is_open))[:12]:
        start, target = (row + 1, col + 1), (int(r) + 1, int(c) + 1)
        way = routes.way(start, target)
        exact = round(100.0 * way.length / POINT)
        for expected in (exact, exact + 130, exact + 2000):
            assert routes.way(start, target, expected=expected) == way


@settings(max_examples=60)
@given(seed=seeds)
def test_a_way_to_what_cannot_be_reached_leads_to_the_nearest_that_can(seed: int) -> None:
    is_open, (row, col) = grid_of(seed)
    ground, routes = routes_of(is_open)
    reached = np.argwhere(np.isfinite(dijkstra(is_open, (row, col))))
    for r, c in np.argwhere(np.isinf(dijkstra(is_open, (row, col))))[::7]:
        way = routes.way((row + 1, col + 1), (int(r) + 1, int(c) + 1), expected=100)
        there = ground.terrain.point_at(*way.place)
        assert np.isfinite(dijkstra(is_open, (row, col))[there])
        nearest = np.sqrt(((reached - (r, c)) ** 2).sum(axis=1)).min()
        assert math.dist(there, (r, c)) == pytest.approx(nearest)


@settings(max_examples=60)
@given(seed=seeds, expected=st.sampled_from([None, 100, 900]))
def test_a_way_within_a_limit_is_that_of_the_wave_over_all_ground(seed: int, expected: int | None) -> None:
    is_open, (row, col) = grid_of(seed)
    ground, routes = routes_of(is_open)
    whole = paths_in(ground, [(row, col)], (0, is_open.shape[0], 0, is_open.shape[1]), LONGEST, bends=True)
    for r, c in np.argwhere(is_open)[::3].tolist():
        target, length = (r + 1, c + 1), whole.length_to(r, c)
        bend = divmod(int(whole.bend[target]), whole.bend.shape[1])
        for limit in (length - 1, length, length + 1, LONGEST):
            way = routes.way_within((row + 1, col + 1), target, limit, expected)
            if length == FAR or limit < length:
                assert way is None
            else:
                assert way == Way(ground.centre(*target), ground.centre(*bend), length * POINT / 100.0)
    assert routes.way_within((row + 1, col + 1), (row + 1, col + 1), 0) == Way(centre(row, col), centre(row, col), 0.0)


def test_a_way_to_a_place_beyond_the_terrain_leads_to_the_nearest_place() -> None:
    ground, routes = routes_of(np.ones((8, 9), dtype=np.bool_))
    assert routes.way((2, 2), (2, 30)) == Way(ground.centre(2, 9), ground.centre(2, 9), 7 * POINT)
    assert routes.way((2, 2), (-9, 2)) == Way(ground.centre(1, 2), ground.centre(1, 2), POINT)
    assert routes.way_within((2, 2), (2, 30), LONGEST) is None


def test_a_way_sets_out_from_a_closed_place() -> None:
    is_open = np.ones((8, 9), dtype=np.bool_)
    is_open[1, 1] = False
    ground, routes = routes_of(is_open)
    assert routes.way((2, 2), (2, 6)).place == ground.centre(2, 6)


def test_a_way_bends_at_a_corner() -> None:
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[10, :15] = False
    ground, routes = routes_of(passable)
    target = 16, 3
    way = routes.way((6, 3), target)
    assert way.place == ground.centre(*target)
    row, col = ground.terrain.point_at(*way.bend)
    assert row in (9, 10)
    assert col == 15
    assert routes.way((6, 3), (6, 12)) == Way(ground.centre(6, 12), ground.centre(6, 12), 9.0 * ground.terrain.point)


@pytest.mark.parametrize("closed", [(), [(8, 20)], [(4, 9), (11, 31)]])
def test_a_way_over_open_ground_is_the_wave_s(closed: list[tuple[int, int]]) -> None:
    is_open = np.ones((14, 40), dtype=np.bool_)
    for place in closed:
        is_open[place] = False
    ground, routes = routes_of(is_open)
    wave = Wave(14, 40, 40)
    for start in ((1, 1), (7, 3), (14, 40)):
        wave.begin(ground, *start)
        wave.extend(LONGEST)
        for row, col in np.argwhere(is_open)[::3] + 1:
            at = int(row) - 1 - wave.row0, int(col) - 1 - wave.col0
            bend_row, bend_col = divmod(int(wave.bend[at]), wave.state.shape[1])
            bend = ground.centre(bend_row + wave.row0 + 1, bend_col + wave.col0 + 1)
            length = float(wave.length[at]) * POINT / 100.0
            assert routes.way(start, (int(row), int(col))) == Way(ground.centre(int(row), int(col)), bend, length)


def test_a_way_heeds_what_was_closed_whatever_length_is_expected() -> None:
    is_open = np.ones((14, 40), dtype=np.bool_)
    ground, routes = routes_of(is_open)
    start, target = (7, 3), (7, 30)
    before = routes.way(start, target)
    assert before == routes.way(start, target, expected=100) == routes.way(start, target, expected=10_000)
    assert before.bend == before.place
    ground.close([(*ground.centre(7, 15), 2.0 * POINT)])
    around = [routes.way(start, target, expected) for expected in (None, 100, 10_000)]
    assert around[0].length > before.length
    assert around[0].bend != around[0].place
    assert around[1:] == around[:1] * 2
