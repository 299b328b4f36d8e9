import math
from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import patrol.tours.search
from patrol.ground.fields import StaticFields, compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.kernels.tour import shorten
from patrol.pose import Pose
from patrol.tours.round import Tour
from patrol.tours.search import find_tour
from tests.patrol.ground.masks import on_terrain


def tour_of(terrain: Terrain, range_m: float, x: float, y: float) -> tuple[Tour, StaticFields]:
    """The tour of a body of 0.3 m that starts at a place, and its fields."""
    fields = compute_fields(terrain, 0.3, range_m, True, [Pose(x, y, 0.0)])
    tour = find_tour(terrain, fields.reach, fields.patrolled, fields.proxy, footprint_of(terrain, range_m))
    assert tour is not None
    return tour, fields


def building(seed: int) -> Terrain:
    """A room of 20 x 15 m in points of 0.5 m with some blocks in it."""
    free = np.ones((30, 40), dtype=np.bool_)
    draw = np.random.default_rng(seed)
    for _ in range(6):
        row, col = draw.integers(4, 28), draw.integers(4, 36)
        free[row : row + draw.integers(1, 8), col : col + draw.integers(1, 8)] = False
    return Terrain("building", free, 0.5)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("range_m", [2.0, 4.0, 9.0])
def test_from_the_tour_all_patrolled_ground_is_seen(seed: int, range_m: float) -> None:
    terrain = building(seed)
    tour, fields = tour_of(terrain, range_m, 1.0, 1.0)
    stops = []
    for a, b in pairwise([*tour.way, tour.way[0]]):
        parts = max(math.ceil(math.dist(a, b) / 0.1), 1)
        stops += [(a[0] + (b[0] - a[0]) * i / parts, a[1] + (b[1] - a[1]) * i / parts) for i in range(parts)]
    assert all(fields.reach[terrain.point_at(*stop)] for stop in stops)
    footprint = footprint_of(terrain, range_m)
    seen = [on_terrain(footprint.visible(Pose(*stop, 0.0)), terrain.shape) for stop in set(stops)]
    assert not (fields.patrolled & ~np.logical_or.reduce(seen)).any()
    assert tour.length_m == pytest.approx(sum(math.dist(a, b) for a, b in pairwise([*tour.way, tour.way[0]])))


def test_ground_seen_from_one_place_needs_no_way_and_a_corridor_is_driven_up_and_down() -> None:
    tour, _ = tour_of(Terrain("room", np.ones((10, 10), dtype=np.bool_), 0.5), 10.0, 2.0, 2.0)
    assert (tour.length_m, len(tour.way)) == (0.0, 1)
    tour, _ = tour_of(Terrain("corridor", np.ones((3, 100), dtype=np.bool_), 0.5), 3.0, 2.0, 0.75)
    assert 2 * (50.0 - 2 * 3.0) <= tour.length_m <= 2 * 50.0


def test_ground_that_is_too_large_has_no_tour(monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = building(1)
    fields = compute_fields(terrain, 0.3, 2.0, True, [Pose(1.0, 1.0, 0.0)])
    monkeypatch.setattr(patrol.tours.search, "MOST_PLACES", 2)
    footprint = footprint_of(terrain, 2.0)
    assert find_tour(terrain, fields.reach, fields.patrolled, fields.proxy, footprint) is None


def test_the_tour_is_the_same_each_time() -> None:
    assert tour_of(building(3), 4.0, 1.0, 1.0)[0] == tour_of(building(3), 4.0, 1.0, 1.0)[0]


def test_open_ground_needs_no_more_than_strips_of_the_sensors_width() -> None:
    terrain = Terrain("field", np.ones((80, 120), dtype=np.bool_), 0.5)
    tour, _ = tour_of(terrain, 5.0, 2.0, 2.0)
    assert 0.8 * 60.0 * 40.0 / 10.0 <= tour.length_m <= 1.6 * 60.0 * 40.0 / 10.0


@given(st.integers(1, 7), st.integers(0, 10**6))
@settings(max_examples=60)
def test_a_tour_stays_a_tour_and_gets_no_longer(n: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    at = draw.integers(0, 1000, (n, 2))
    far = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)).astype(np.int32)

    def length(order: tuple[int, ...]) -> int:
        return sum(int(far[order[i - 1], order[i]]) for i in range(n))

    tour = np.arange(n, dtype=np.int64)
    found = shorten(far, tour)
    assert sorted(tour.tolist()) == list(range(n))
    assert found == length(tuple(tour.tolist())) <= length(tuple(range(n)))
    best = min(length((0, *rest)) for rest in permutations(range(1, n)))
    assert found <= 1.25 * best + n
