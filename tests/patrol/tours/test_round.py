from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from patrol.ground.fields import StaticFields, compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.tours.round import ARRAYS, SLACK, STRETCH, Round, Tour, lay_out
from patrol.tours.search import find_tour
from tests.patrol.ground.lengths import lengths_along
from tests.patrol.ground.masks import on_terrain
from tests.patrol.tours.test_search import building

RANGE_M = 4.0


def round_in(terrain: Terrain) -> tuple[Round, StaticFields]:
    fields = compute_fields(terrain, 0.3, RANGE_M, True, [Pose(1.0, 1.0, 0.0)])
    footprint = footprint_of(terrain, RANGE_M)
    tour = find_tour(terrain, fields.reach, fields.patrolled, fields.proxy, footprint)
    assert tour is not None
    return lay_out(terrain, fields.reach, fields.patrolled, fields.proxy, footprint, tour), fields


@pytest.mark.parametrize("seed", range(6))
def test_places_go_round_in_order_and_every_patrolled_point_is_seen_from_where_it_says(seed: int) -> None:
    terrain = building(seed)
    laid_out, fields = round_in(terrain)
    footprint = footprint_of(terrain, RANGE_M)
    assert (np.diff(laid_out.along) > 0.0).all()
    assert 0.0 <= laid_out.along[0] < laid_out.along[-1] < laid_out.length_m
    assert (np.diff(laid_out.place_of) >= 0).all()
    assert fields.reach.reshape(-1)[laid_out.places].all()
    assert sorted(laid_out.points.tolist()) == np.flatnonzero(fields.patrolled).tolist()
    for point, stand in zip(laid_out.points.tolist(), laid_out.stands.tolist(), strict=True):
        row, col = divmod(point, terrain.width)
        assert fields.reach.flat[stand]
        view = footprint.visible(Pose(*terrain.centre(*divmod(stand, terrain.width)), 0.0))
        assert view.mask[row - view.row0, col - view.col0]


@pytest.mark.parametrize("seed", range(6))
def test_points_belong_to_a_stop_that_sees_them_from_around(seed: int) -> None:
    terrain = building(seed)
    laid_out, _ = round_in(terrain)
    footprint = footprint_of(terrain, RANGE_M)
    places = [divmod(int(place), terrain.width) for place in laid_out.places]
    views = [footprint.visible(Pose(*terrain.centre(*place), 0.0)) for place in places]
    seen = np.array([on_terrain(view, terrain.shape) for view in views])
    along, slack_m = laid_out.along.tolist(), SLACK * RANGE_M
    stops = np.unique(laid_out.place_of).tolist()

    def is_sure(stop: int, row: int, col: int) -> bool:
        before = min(at for at in range(len(places)) if along[at] >= along[stop] - slack_m)
        after = min([at for at in range(len(places)) if along[at] >= along[stop] + slack_m] or [len(places) - 1])
        return bool(seen[[before, stop, after], row, col].all())

    for point, place in zip(laid_out.points.tolist(), laid_out.place_of.tolist(), strict=True):
        row, col = divmod(point, terrain.width)
        seeing = [stop for stop in stops if seen[stop, row, col]]
        if seeing:
            sure = [stop for stop in seeing if is_sure(stop, row, col)]
            off = {stop: (places[stop][0] - row) ** 2 + (places[stop][1] - col) ** 2 for stop in seeing}
            assert place == (min(sure) if sure else min(seeing, key=lambda stop: off[stop]))
        else:
            assert not seen[:, row, col].any()
    assert len(stops) < len(places) / 2


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    laid_out, _ = round_in(building(2))
    laid_out.save(tmp_path / "round")
    again = Round.load(tmp_path / "round")
    assert again.length_m == laid_out.length_m
    for name in ARRAYS:
        assert np.array_equal(getattr(again, name), getattr(laid_out, name))


@pytest.mark.parametrize("seed", range(3))
def test_stations_are_short_stretches_that_share_out_all_points(seed: int) -> None:
    terrain = building(seed)
    laid_out, fields = round_in(terrain)
    assert (laid_out.begins[0], laid_out.begins[-1]) == (0, len(laid_out.points))
    assert (np.diff(laid_out.begins) > 0).all()
    longest_m = STRETCH * RANGE_M
    heads = []
    for number, (begin, end) in enumerate(pairwise(laid_out.begins.tolist())):
        stops = np.unique(laid_out.place_of[begin:end])
        along = laid_out.along[stops]
        assert along[-1] - along[0] <= longest_m
        assert laid_out.spots[number] == laid_out.places[stops[len(stops) // 2]]
        assert (laid_out.around.flat[laid_out.points[begin:end]] == number).all()
        heads.append(along[0])
    assert (np.diff(heads) > longest_m).all(), "no two could be one"
    assert np.count_nonzero(laid_out.around >= 0) == np.count_nonzero(fields.patrolled)


@pytest.mark.parametrize("seed", range(3))
def test_stations_are_as_far_apart_as_the_ways_between_them(seed: int) -> None:
    """Longer ways than four ranges are those through other stations."""
    terrain = building(seed)
    laid_out, fields = round_in(terrain)
    apart_m = []
    for spot in laid_out.spots.tolist():
        lengths = lengths_along(fields.reach, [divmod(spot, terrain.width)], 2**30)[1:-1, 1:-1]
        apart_m.append(lengths.reshape(-1)[laid_out.spots] * (terrain.point / 100.0))
    exact_m = np.array(apart_m)
    through_m = np.where(exact_m <= 4.0 * RANGE_M, exact_m, np.inf)
    for by in range(len(through_m)):
        through_m = np.minimum(through_m, through_m[:, by : by + 1] + through_m[by])
    np.testing.assert_allclose(laid_out.apart_m, through_m)
    assert (laid_out.apart_m >= exact_m - 1e-9).all()


def test_places_are_at_most_a_fiftieth_of_the_range_apart_and_lengths_add_up(tmp_path: Path) -> None:
    """A square tour of 8 m on points of 0.1 m, with a sensor of 10 m: places 0.2 m apart."""
    terrain = Terrain("hall", np.ones((60, 60), dtype=np.bool_), 0.1)
    every = np.ones(terrain.shape, dtype=np.bool_)
    proxy = np.full(terrain.shape, -1, dtype=np.int32)
    corners = ((2.05, 2.05), (4.05, 2.05), (4.05, 4.05), (2.05, 4.05))
    laid_out = lay_out(terrain, every, every, proxy, footprint_of(terrain, 10.0), Tour(8.0, corners))
    assert laid_out.length_m == pytest.approx(8.0)
    np.testing.assert_allclose(laid_out.along, 0.2 * np.arange(40))
    places = [terrain.centre(*divmod(place, terrain.width)) for place in laid_out.places.tolist()]
    assert [places[at] for at in (0, 10, 20, 30)] == [pytest.approx(corner) for corner in corners]
    assert np.array_equal(np.sort(laid_out.points), np.arange(3600))
    laid_out.save(tmp_path)
    again = Round.load(tmp_path)
    for name in ARRAYS:
        assert np.array_equal(getattr(again, name), getattr(laid_out, name))
