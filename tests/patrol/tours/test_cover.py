"""The choice of places that see some ground, against views that are looked at point by point."""

import math

import numpy as np
import pytest

from patrol.ground.footprint import Footprint
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose
from patrol.tours.cover import Looks, Views, candidate_spacing, choose, complete, lattice, needed
from tests.patrol.ground.masks import on_terrain
from tests.patrol.tours.test_search import building

RANGE_M = 3.0


def seen_from(terrain: Terrain, footprint: Footprint, place: int) -> BoolGrid:
    x, y = terrain.centre(*divmod(place, terrain.width))
    return on_terrain(footprint.visible(Pose(x, y, 0.0)), terrain.shape)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return building(4)


@pytest.fixture(scope="module")
def footprint(terrain: Terrain) -> Footprint:
    return footprint_of(terrain, RANGE_M)


@pytest.mark.parametrize("every", [1, 2, 3])
@pytest.mark.parametrize("place", [0, 39, 29 * 40, 29 * 40 + 39, 7 * 40 + 20, 15 * 40 + 1])
def test_a_thinned_window_holds_every_so_many_points_of_the_view(
    terrain: Terrain, footprint: Footprint, place: int, every: int
) -> None:
    rows, cols, mask = Looks(terrain, footprint).window(place, every)
    thinned = np.zeros((-(-terrain.height // every), -(-terrain.width // every)), dtype=np.bool_)
    assert thinned[rows, cols].shape == mask.shape
    thinned[rows, cols] = mask
    assert np.array_equal(thinned, seen_from(terrain, footprint, place)[::every, ::every])


def test_what_is_seen_is_counted_and_taken_back(terrain: Terrain, footprint: Footprint) -> None:
    ground = terrain.passable.copy()
    ground[:, :5] = False
    views = Views(Looks(terrain, footprint), ground, 1)
    one, two = 7 * 40 + 12, 7 * 40 + 15
    of_one, of_two = (seen_from(terrain, footprint, place) & ground for place in (one, two))
    assert views.gain(one) == np.count_nonzero(of_one)
    views.add(one)
    assert views.gain(one) == 0
    assert views.gain(two) == np.count_nonzero(of_two & ~of_one) > 0
    views.add(two)
    assert np.array_equal(views.count, of_one.astype(np.int32) + of_two)
    assert not views.take(one)
    assert np.array_equal(views.count, of_two)
    views.add(two)
    assert views.take(two)
    assert views.unseen() == np.flatnonzero(ground & ~of_two)[0]
    views.clear()
    assert views.unseen() == np.flatnonzero(ground)[0]
    views.forget(int(np.flatnonzero(ground)[0]))
    assert views.unseen() == np.flatnonzero(ground)[1]


def test_of_a_thinned_grid_the_first_unseen_point_is_one_of_the_whole_grid(
    terrain: Terrain, footprint: Footprint
) -> None:
    ground = np.zeros(terrain.shape, dtype=np.bool_)
    ground[6:9, 9:13] = True
    views = Views(Looks(terrain, footprint), ground, 3)
    assert views.unseen() == 6 * 40 + 9
    views.forget(6 * 40 + 9)
    assert views.unseen() == 6 * 40 + 12
    views.forget(7 * 40 + 13)
    assert views.unseen() is None


@pytest.mark.parametrize("spacing", [1.0, 2.5, 4.0])
def test_a_lattice_has_the_nearest_point_to_the_middle_of_each_square(terrain: Terrain, spacing: float) -> None:
    part = terrain.passable
    best: dict[tuple[int, int], tuple[float, int]] = {}
    for place in np.flatnonzero(part).tolist():
        row, col = divmod(place, terrain.width)
        square = int(row / spacing), int(col / spacing)
        off = (row - (square[0] + 0.5) * spacing) ** 2 + (col - (square[1] + 0.5) * spacing) ** 2
        best[square] = min(best.get(square, (math.inf, 0)), (off, place))
    assert lattice(part, spacing) == [place for _, (_, place) in sorted(best.items())]


def test_places_are_chosen_greedily_and_those_that_see_nothing_alone_left_out(
    terrain: Terrain, footprint: Footprint
) -> None:
    candidates = lattice(terrain.passable, 3.0)
    seen = {place: seen_from(terrain, footprint, place) & terrain.passable for place in candidates}
    unseen = terrain.passable.copy()
    expected = []
    while True:
        gains = {place: np.count_nonzero(seen[place] & unseen) for place in candidates}
        best = min(candidates, key=lambda place: (-gains[place], place))
        if not gains[best]:
            break
        expected.append(best)
        unseen &= ~seen[best]
    views = Views(Looks(terrain, footprint), terrain.passable, 1)
    chosen = choose(candidates, views)
    assert chosen == expected
    remaining = needed(chosen, views)
    covered = np.logical_or.reduce([seen[place] for place in remaining])
    assert np.array_equal(covered, np.logical_or.reduce([seen[place] for place in chosen]))
    for place in remaining:
        assert not np.array_equal(covered, np.logical_or.reduce([seen[other] for other in remaining if other != place]))


def test_what_no_candidate_sees_is_seen_from_itself_or_its_post() -> None:
    """The last point is too far from its post, so it is left out."""
    terrain = Terrain("field", np.ones((30, 40), dtype=np.bool_), 0.5)
    ground, part = np.zeros(terrain.shape, dtype=np.bool_), terrain.passable.copy()
    ground[3, 3] = ground[25, 35] = ground[25, 36] = ground[29, 20] = True
    part[25:, 20:] = False
    proxy = np.full(terrain.shape, -1, dtype=np.int32)
    proxy[25, 35] = proxy[25, 36] = 24 * 40 + 35
    proxy[29, 20] = 3 * 40 + 30
    views = Views(Looks(terrain, footprint_of(terrain, RANGE_M)), ground, 1)
    assert complete(views, part, proxy) == [3 * 40 + 3, 24 * 40 + 35]
    assert views.unseen() is None
    assert not views.ground[29, 20]


@pytest.mark.parametrize(
    ("points", "range_m", "spacing"),
    [
        (100, 5.0, 4.0),  # two fifths of ten points
        (100, 1.0, 1.0),  # at least a point
        (216_000, 5.0, 6.0),  # 6000 squares of 36 points
    ],
)
def test_candidates_are_two_fifths_of_the_range_apart_and_6000_at_most(
    points: int, range_m: float, spacing: float
) -> None:
    part = np.zeros((500, 500), dtype=np.bool_)
    part.flat[:points] = True
    footprint = footprint_of(Terrain("field", np.ones((500, 500), dtype=np.bool_), 0.5), range_m)
    assert candidate_spacing(part, footprint) == pytest.approx(spacing)
