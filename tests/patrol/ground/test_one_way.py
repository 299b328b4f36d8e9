from __future__ import annotations

import math

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.ground.fields import compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import ALL_WAYS, Terrain
from patrol.ground.ways import with_direction
from patrol.pose import Pose
from patrol.starts import starting_part
from patrol.tours.search import find_tour
from patrol.zones.ground import with_zones
from patrol.zones.spec import ZoneSpec
from tests.ring import LOWER, UPPER, ring, zone


def test_steps_into_out_of_and_within_a_zone() -> None:
    points = np.zeros((1, 4), dtype=np.bool_)
    points[0, 1:3] = True
    bits = with_direction(ALL_WAYS, points, 0)
    west = 1 << 4
    assert [bool(bits[0, col] & west) for col in range(4)] == [False, True, True, True]
    assert not bits[0, 0]  # a step ahead into the zone, and one off the grid
    assert with_direction(bits, points, 180)[0, 1] & (west | 1) == west | 1


@pytest.mark.parametrize(
    ("zones", "leads"),
    [
        ((zone("aisle", LOWER, 0), zone("back", UPPER, 0)), "no way leads back from"),
        ((zone("aisle", LOWER, 180), zone("back", UPPER, 180)), "no way leads to"),
        ((zone("whole", [[0, 0], [20, 0], [20, 10], [0, 10]], 90),), "no way leads"),
    ],
)
def test_ground_from_which_no_way_leads_back_is_refused(zones: tuple[dict[str, object], ...], leads: str) -> None:
    with pytest.raises(BadInput, match=rf"^zones: one_way: {leads} .* m² around \(.*\) of ring") as caught:
        compute_fields(ring(*zones), 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)])
    assert "\n" not in str(caught.value)


def niche() -> tuple[Terrain, Terrain]:
    """A room with a niche, without and with a one-way zone from it."""
    passable = np.ones((21, 40), dtype=np.bool_)
    passable[:, 25:] = False
    passable[9:12, 25:27] = True
    before_it = ZoneSpec.model_validate(zone("niche", [[10, 3.5], [14, 3.5], [14, 7], [10, 7]], 0))
    room = Terrain("room", passable, 0.5)
    return room, with_zones(room, [before_it])


def test_a_start_in_ground_that_is_left_out_is_refused() -> None:
    _, terrain = niche()
    refused = r"robots\.starts: one-way zones leave no way back to \(12\.75, 5\.25\), or none"
    with pytest.raises(BadInput, match=refused):
        compute_fields(terrain, 0.3, 4.0, True, [Pose(12.75, 5.25, 0.0)])
    drawn = starting_part(terrain, 0.3)
    assert drawn.any()
    assert not drawn[:, 25:].any()


def test_a_large_zone_over_everything_is_refused_at_once() -> None:
    terrain = Terrain("hall", np.ones((300, 300), dtype=np.bool_), 0.5)
    over = ZoneSpec.model_validate(zone("over", [[0, 0], [150, 0], [150, 150], [0, 150]], 0))
    with pytest.raises(BadInput, match="no way leads"):
        compute_fields(with_zones(terrain, [over]), 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)])


def test_a_niche_that_is_open_against_the_zone_is_left_out() -> None:
    both_ways, one_way = (compute_fields(terrain, 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)]).reach for terrain in niche())
    assert np.argwhere(both_ways & ~one_way).tolist() == [[10, 24], [10, 25]]


def test_ground_with_ways_back_is_found_once_for_starts_and_fields() -> None:
    terrain = ring(zone("aisle", LOWER, 0))
    part = starting_part(terrain, 0.3)
    assert starting_part(terrain, 0.3, Pose(3.0, 5.0, 0.0)) is part
    compute_fields(terrain, 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)])
    assert [found is part for found in terrain.with_ways_back.values()] == [True]


@pytest.mark.parametrize(("one_way", "turns"), [(0, 1.0), (180, -1.0)])
def test_the_tour_goes_round_as_the_corridor_says(one_way: int, turns: float) -> None:
    terrain = ring(zone("aisle", LOWER, one_way))
    fields = compute_fields(terrain, 0.3, 3.0, True, [Pose(3.0, 5.0, 0.0)])
    tour = find_tour(terrain, fields.reach, fields.patrolled, fields.proxy, footprint_of(terrain, 3.0))
    assert tour is not None
    legs = list(zip(tour.way, (*tour.way[1:], tour.way[0]), strict=True))
    assert tour.length_m == pytest.approx(sum(math.dist(*leg) for leg in legs))
    area = 0.5 * sum(x * to_y - to_x * y for (x, y), (to_x, to_y) in legs)
    assert turns * area > 0.0
    both = ring(zone("aisle", LOWER, one_way), zone("back", UPPER, 180 - one_way))
    assert find_tour(both, fields.reach, fields.patrolled, fields.proxy, footprint_of(both, 3.0)) == tour
