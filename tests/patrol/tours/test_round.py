from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from patrol.ground.fields import StaticFields, compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.tours.round import ARRAYS, SLACK, Round, lay_out
from patrol.tours.search import find_tour
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
