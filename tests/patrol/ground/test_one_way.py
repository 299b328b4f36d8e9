"""Steps against one-way zones, ways that take none of them, and the ground from which ways lead back."""

from __future__ import annotations

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.fields import compute_fields
from patrol.ground.kernels.one_way import FAR
from patrol.ground.one_way import STEPS, first_bend, lengths_along, unit, way_along, with_direction
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.ground.tour.search import find_tour
from patrol.ground.zones import with_zones
from patrol.pose import Pose
from patrol.scenario.zones import ZoneSpec
from patrol.starts import starting_part
from tests.ring import LOWER, UPPER, ring, zone

NO_STEPS = np.zeros((0, 0), dtype=np.uint8)
seeds = st.integers(0, 2**32 - 1)


def dijkstra(reach: BoolGrid, zones: list[tuple[BoolGrid, int]], start: tuple[int, int]) -> NDArray[np.float64]:
    """Lengths of the ways from a point, in hundredths of a point, by the definition of a step against a zone."""
    lengths = np.full(reach.shape, np.inf)
    lengths[start] = 0
    heap = [(0, *start)]
    while heap:
        length, row, col = heapq.heappop(heap)
        for up, across in STEPS:
            to = row + up, col + across
            inside = 0 <= to[0] < reach.shape[0] and 0 <= to[1] < reach.shape[1]
            if not inside or not (reach[to] and reach[row, to[1]] and reach[to[0], col]):
                continue
            directions = [unit(degrees) for points, degrees in zones if points[row, col] or points[to]]
            if any(across * x + up * y < -1e-9 for x, y in directions):
                continue
            away = length + (141 if up and across else 100)
            if away < lengths[to]:
                lengths[to] = away
                heapq.heappush(heap, (away, *to))
    return lengths


def drawn(seed: int) -> tuple[BoolGrid, list[tuple[BoolGrid, int]], NDArray[np.uint8], tuple[int, int]]:
    """A small random ground with up to two one-way zones, its steps against them, and an open point."""
    rng = np.random.default_rng(seed)
    reach = rng.random(tuple(rng.integers(2, 14, 2))) < rng.choice([0.6, 0.9, 1.0])
    start = int(rng.integers(reach.shape[0])), int(rng.integers(reach.shape[1]))
    reach[start] = True
    zones, against = [], NO_STEPS
    for _ in range(int(rng.integers(1, 3))):
        points = np.zeros(reach.shape, dtype=np.bool_)
        row, col = rng.integers(reach.shape[0]), rng.integers(reach.shape[1])
        points[row : row + rng.integers(1, 6), col : col + rng.integers(1, 6)] = True
        zones.append((points, int(rng.integers(8)) * 45))
        against = with_direction(against, *zones[-1])
    return reach, zones, against, start


@given(seeds)
@settings(max_examples=60)
def test_lengths_are_those_of_dijkstra_and_back_they_are_turned_round(seed: int) -> None:
    reach, zones, against, start = drawn(seed)
    expected = dijkstra(reach, zones, start)
    lengths = lengths_along(reach, against, [start], FAR)
    assert np.array_equal(np.where(lengths < FAR, lengths, np.inf)[1:-1, 1:-1], expected)
    back = lengths_along(reach, against, [start], FAR, back=True)[1:-1, 1:-1]
    for row, col in np.argwhere(reach)[:: max(1, int(reach.sum()) // 8)].tolist():
        there = dijkstra(reach, zones, (row, col))[start]
        assert (math.inf if back[row, col] == FAR else back[row, col]) == there


@given(seeds)
@settings(max_examples=60)
def test_from_the_nearest_of_several_points_and_up_to_a_limit(seed: int) -> None:
    reach, zones, against, start = drawn(seed)
    other = divmod(int(np.flatnonzero(reach)[-1]), reach.shape[1])
    expected = np.minimum(dijkstra(reach, zones, start), dijkstra(reach, zones, other))
    lengths = lengths_along(reach, against, [start, other], 450)[1:-1, 1:-1]
    assert np.array_equal(np.where(lengths < FAR, lengths, np.inf), np.where(expected <= 450, expected, np.inf))


@given(seeds)
@settings(max_examples=60)
def test_straight_from_corner_to_corner_a_way_leads_against_no_zone(seed: int) -> None:
    reach, zones, against, start = drawn(seed)
    lengths = dijkstra(reach, zones, start)
    for row, col in np.argwhere(np.isfinite(lengths))[::3].tolist():
        corners = way_along(reach, against, start, (row, col))
        assert (corners[0], corners[-1]) == (start, (row, col))
        for first, last in pairwise(corners):
            up, across = last[0] - first[0], last[1] - first[1]
            samples = np.linspace(0.0, 1.0, 40 * max(abs(up), abs(across)) + 1)[1:-1]
            rows = np.rint(first[0] + samples * up).astype(int)
            cols = np.rint(first[1] + samples * across).astype(int)
            for points, degrees in zones:
                x, y = unit(degrees)
                crossed = points[rows, cols].sum() / max(len(samples), 1) * math.hypot(up, across)
                # A line may touch a zone's edge with less than the half of a point.
                assert across * x + up * y >= -1e-9 or crossed < 0.75
        length = sum(math.dist(first, last) for first, last in pairwise(corners))
        assert length <= lengths[row, col] / 141.0 * math.sqrt(2.0) + 1e-9


def test_a_way_through_the_corridor_leads_back_through_the_other_one() -> None:
    """By hand: 2 steps to the east room, 11 up in it, 23 along the upper corridor, 11 down and 2 to the corridor."""
    terrain = ring(zone("aisle", LOWER, 0))
    reach = compute_fields(terrain, 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)]).reach
    west, east = (4, 10), (4, 29)
    for start, end, expected in ((west, east, 1900), (east, west, 4900)):
        assert lengths_along(reach, terrain.against, [start], FAR)[end[0] + 1, end[1] + 1] == expected
        back = lengths_along(reach, terrain.against, [end], FAR, back=True)
        assert back[start[0] + 1, start[1] + 1] == expected
    assert way_along(reach, terrain.against, west, east) == [west, east]
    assert way_along(reach, terrain.against, east, west) == [east, (4, 31), (15, 31), (15, 8), (4, 8), west]
    to_west = lengths_along(reach, terrain.against, [west], FAR, back=True)
    assert first_bend(reach, terrain.against, to_west, east, west) == (4, 31)


def test_steps_into_out_of_and_within_a_zone() -> None:
    points = np.zeros((1, 4), dtype=np.bool_)
    points[0, 1:3] = True
    bits = with_direction(NO_STEPS, points, 0)
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


def test_a_start_in_ground_that_is_left_out_is_refused() -> None:
    passable = np.ones((21, 40), dtype=np.bool_)
    passable[:, 25:] = False
    passable[9:12, 25:27] = True
    niche = ZoneSpec.model_validate(zone("niche", [[10, 3.5], [14, 3.5], [14, 7], [10, 7]], 0))
    terrain = with_zones(Terrain("room", passable, 0.5), [niche])
    with pytest.raises(
        BadInput, match=r"robots\.starts: one-way zones leave no way back to \(12\.75, 5\.25\), or none"
    ):
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
    """A body gets into it, and out of it only against the zone."""
    passable = np.ones((21, 40), dtype=np.bool_)
    passable[:, 25:] = False
    passable[9:12, 25:27] = True
    niche = ZoneSpec.model_validate(zone("niche", [[10, 3.5], [14, 3.5], [14, 7], [10, 7]], 0))
    fields = {
        way: compute_fields(terrain, 0.3, 4.0, True, [Pose(3.0, 5.0, 0.0)])
        for way, terrain in (
            ("open", Terrain("room", passable, 0.5)),
            ("one way", with_zones(Terrain("room", passable, 0.5), [niche])),
        )
    }
    lost = np.argwhere(fields["open"].reach & ~fields["one way"].reach).tolist()
    assert lost == [[10, 24], [10, 25]]


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
