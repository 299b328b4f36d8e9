"""Looks aside, against views that are added up one by one."""

import math

import numpy as np
import pytest

from patrol.ground.fields import compute_fields
from patrol.ground.footprint import Footprint
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose
from patrol.tours.cover import HEADINGS
from patrol.tours.looks import SPACING, with_looks
from patrol.tours.round import Tour, lay_out, places_of, places_with_looks
from patrol.tours.search import find_tour
from tests.patrol.ground.masks import on_terrain
from tests.patrol.tours.test_search import building
from tests.present import present

RANGE_M = 4.0


def seen(terrain: Terrain, footprint: Footprint, places: list[int], headings: list[float]) -> BoolGrid:
    views = [
        footprint.visible(Pose(*terrain.centre(*divmod(place, terrain.width)), heading))
        for place, heading in zip(places, headings, strict=True)
    ]
    return np.asarray(np.logical_or.reduce([on_terrain(view, terrain.shape) for view in views]), dtype=np.bool_)


def tour_in(terrain: Terrain, angle: float) -> tuple[Tour, BoolGrid, Footprint]:
    fields = compute_fields(terrain, 0.3, RANGE_M, True, [Pose(1.0, 1.0, 0.0)])
    disc, sector = footprint_of(terrain, RANGE_M), footprint_of(terrain, RANGE_M, angle)
    tour = present(find_tour(terrain, fields.reach, fields.patrolled, fields.proxy, disc))
    return with_looks(tour, terrain, fields.reach, fields.patrolled, sector), fields.reach, sector


@pytest.mark.parametrize("angle", [60.0, 120.0, 240.0])
@pytest.mark.parametrize("seed", range(3))
def test_looks_show_all_that_a_robot_sees_that_turns_everywhere(seed: int, angle: float) -> None:
    terrain = building(seed)
    tour, reach, sector = tour_in(terrain, angle)
    places, _, headings, _ = places_with_looks(terrain, reach, tour, max(SPACING * RANGE_M, terrain.point))
    everywhere = [place for place in places.tolist() for _ in HEADINGS]
    turning = seen(terrain, sector, everywhere, [*HEADINGS] * len(places))
    fields = compute_fields(terrain, 0.3, RANGE_M, True, [Pose(1.0, 1.0, 0.0)])
    missed = fields.patrolled & turning & ~seen(terrain, sector, places.tolist(), headings.tolist())
    assert not missed.any()


def test_a_narrow_sensor_looks_aside_more_often() -> None:
    tours = [tour_in(building(1), angle)[0] for angle in (60.0, 120.0, 240.0)]
    looks = [len(tour.looks) for tour in tours]
    assert looks[0] > looks[1] > looks[2]
    assert tours[0].turned > tours[2].turned
    assert all(0.0 <= at_m < tour.length_m for tour in tours for at_m, _ in tour.looks)


def test_a_tour_without_looks_has_the_headings_of_its_legs() -> None:
    terrain = building(2)
    tour, reach, _ = tour_in(terrain, 120.0)
    places, along, headings, length_m = places_of(terrain, reach, tour, 1.0)
    assert length_m == pytest.approx(tour.length_m)
    assert len(places) == len(along) == len(headings)
    (x, y), (to_x, to_y) = tour.way[0], tour.way[1]
    assert headings[0] == math.atan2(to_y - y, to_x - x)


@pytest.mark.parametrize("seed", range(3))
def test_each_point_of_a_round_is_seen_from_its_place_in_its_heading(seed: int) -> None:
    terrain = building(seed)
    tour, reach, sector = tour_in(terrain, 90.0)
    fields = compute_fields(terrain, 0.3, RANGE_M, True, [Pose(1.0, 1.0, 0.0)])
    laid_out = lay_out(terrain, reach, fields.patrolled, fields.proxy, sector, tour)
    assert sorted(laid_out.points.tolist()) == np.flatnonzero(fields.patrolled).tolist()
    by_place = 0
    for point, stand, number in zip(laid_out.points, laid_out.stands, laid_out.place_of, strict=True):
        if stand == laid_out.places[number]:
            pose = Pose(*terrain.centre(*divmod(int(stand), terrain.width)), float(laid_out.headings[number]))
            assert sector.visible(pose).shows(*divmod(int(point), terrain.width))
            by_place += 1
    assert by_place > 0.9 * len(laid_out.points)
    facing = laid_out.headings[laid_out.place_of]
    for begin, end in zip(laid_out.begins[:-1].tolist(), laid_out.begins[1:].tolist(), strict=True):
        assert max(abs(math.remainder(heading - facing[begin], math.tau)) for heading in facing[begin:end]) <= 0.4
