from itertools import pairwise

import numpy as np
import pytest

from fogwatch.planning import division
from fogwatch.planning.division import Divider, Territory, longest_m, seen_along, shared_out
from patrol.graph import Graph, graph_of, tour_length
from patrol.ground.fields import compute_fields
from patrol.ground.fog import Fog
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.measures.best_tour import best_tour
from patrol.pose import Pose
from patrol.prepare import Prepared, sensor_footprint
from patrol.scenario import load_scenario
from patrol.tours.round import Tour
from patrol.tours.search import find_tour
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
GAIN_M = 0.01

SPEED = 1.0


def line(vertices: int) -> Graph:
    """Vertices in a line, 10 m apart."""
    places = [(10.0 * vertex, 0.0) for vertex in range(vertices)]
    return graph_of(places, [(vertex, vertex + 1, 10.0) for vertex in range(vertices - 1)])


def rooms(robots: int, door: bool = True) -> Prepared:
    """Two rooms of 10 x 10 m side by side; robots start in the left one and the right one in turn."""
    free = np.ones((20, 41), dtype=np.bool_)
    free[:, 20] = False
    if door:
        free[8:12, 20] = True
    return prepared_on(free, 3.0, [Pose(3.0 + 14.0 * (number % 2), 3.0, 0.0) for number in range(robots)])


def prepared_on(free: BoolGrid, range_m: float, starts: list[Pose]) -> Prepared:
    terrain = Terrain("rooms", free, 0.5)
    body = {"count": len(starts), "model": "holonomic", "radius": 0.3, "speed": SPEED}
    given = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": body, "sensor": {"range": range_m}}
    fields = compute_fields(terrain, 0.3, range_m, True, starts)
    numbers = range(1, len(starts) + 1)
    return Prepared(load_scenario(given), terrain, tuple(starts), dict.fromkeys(numbers, fields), {})


def divided(prepared: Prepared) -> tuple[Territory, ...]:
    return present(Divider().divide(prepared))


def test_vertices_in_a_line_are_shared_out_evenly() -> None:
    tours = shared_out(line(8), list(range(8)), 2)
    assert sorted(sorted(tour) for tour in tours) == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert [tour_length(line(8), tour) for tour in tours] == [60.0, 60.0]
    assert len(shared_out(line(2), [0, 1], 5)) == 2


def test_each_point_belongs_to_one_robot() -> None:
    prepared = rooms(3)
    owners = np.sum([territory.ground for territory in divided(prepared)], axis=0)
    assert np.array_equal(owners, prepared.patrolled.astype(owners.dtype))


@pytest.mark.parametrize("robots", [2, 3])
def test_no_point_gets_older_than_the_longest_tour_takes(robots: int) -> None:
    prepared = rooms(robots)
    territories = divided(prepared)
    footprint = sensor_footprint(prepared.scenario, prepared.terrain)
    fog = Fog(prepared.patrolled)
    oldest, longest = 0, longest_m(territories)
    step_m = 0.1
    for tick in range(int(3 * longest / step_m)):
        for territory in territories:
            x, y = place_along(territory, tick * step_m)
            fog.observe(footprint.visible(Pose(x, y, 0.0)), tick)
        if tick > 1.5 * longest / step_m:
            oldest = max(oldest, fog.mfow(tick))
    assert 0.5 * longest < oldest * step_m < longest + 2.0


def test_the_way_back_to_the_first_corner_shows_ground_too() -> None:
    prepared = prepared_on(np.ones((20, 20), dtype=np.bool_), 1.0, [Pose(1.0, 1.0, 0.0)])
    tour = Tour(16.0 + 8.0 * np.sqrt(2.0), ((1.0, 1.0), (9.0, 1.0), (9.0, 9.0)))
    seen = seen_along(prepared.terrain, sensor_footprint(prepared.scenario, prepared.terrain), tour)
    xs, ys = np.meshgrid(*[np.arange(0.25, 10.0, 0.5)] * 2)
    from_the_diagonal_m = np.abs(xs - ys) / np.sqrt(2.0)
    between = (xs + ys > 6.0) & (xs + ys < 14.0) & (ys > 2.5) & (xs < 7.5)
    assert seen[between & (from_the_diagonal_m < 0.9)].all()
    assert not seen[between & (from_the_diagonal_m > 1.1)].any()


@pytest.mark.parametrize(("shape", "range_m", "robots"), [((24, 30), 4.0, 3), ((12, 20), 3.0, 4)])
def test_the_longest_tour_is_relieved_of_all_that_others_see(
    shape: tuple[int, int], range_m: float, robots: int
) -> None:
    """One more time without what is seen on the other tours, its search finds nothing shorter."""
    prepared = prepared_on(np.ones(shape, dtype=np.bool_), range_m, [Pose(1.0, 1.0, 0.0)] * robots)
    territories = divided(prepared)
    terrain, fields = prepared.terrain, prepared.fields[1]
    footprint = sensor_footprint(prepared.scenario, terrain)
    *others, longest = sorted(territories, key=lambda territory: territory.tour.length_m)
    remaining = longest.ground & ~np.logical_or.reduce([seen_along(terrain, footprint, one.tour) for one in others])
    again = present(find_tour(terrain, fields.reach, remaining, fields.proxy, footprint))
    assert again.length_m > longest.tour.length_m - GAIN_M
    assert np.array_equal(sum(territory.ground.astype(int) for territory in territories), prepared.patrolled)


@pytest.mark.parametrize(("gain_m", "is_taken"), [(0.008, False), (0.015, True)])
def test_a_shorter_tour_is_taken_from_a_centimetre_on(
    gain_m: float, is_taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two robots, which see but a corner, the first search for less of the longer tour's ground gains so much."""
    ways = ((2.0, 2.0), (2.5, 2.0))
    lengths = iter([20.0, 24.0, 24.0 - gain_m, 24.0 - gain_m])
    monkeypatch.setattr(division, "find_tour", lambda *_: Tour(next(lengths), ways))
    monkeypatch.setattr(division, "OFFSETS", 1)
    prepared = prepared_on(np.ones((20, 20), dtype=np.bool_), 3.0, [Pose(1.0, 1.0, 0.0)] * 2)
    assert longest_m(divided(prepared)) == (24.0 - gain_m if is_taken else 24.0)


def test_two_rooms_are_best_shared_by_two_robots() -> None:
    prepared = rooms(2)
    common = present(best_tour(prepared).length_m)
    left, right = divided(prepared)
    assert longest_m((left, right)) < 0.6 * common
    columns = sorted(float(np.nonzero(territory.ground)[1].mean()) for territory in (left, right))
    assert columns[0] < 15.0
    assert columns[1] > 25.0


def test_rooms_without_a_door_have_robots_of_their_own() -> None:
    prepared = rooms(2, door=False)
    for territory in divided(prepared):
        columns = np.nonzero(territory.ground)[1]
        assert columns.max() < 20 or columns.min() > 20


def place_along(territory: Territory, passed_m: float) -> tuple[float, float]:
    """Return the place on a closed tour after some length."""
    way = [*territory.tour.way, territory.tour.way[0]]
    along = np.concatenate([[0.0], np.cumsum([np.hypot(x1 - x, y1 - y) for (x, y), (x1, y1) in pairwise(way)])])
    at = passed_m % along[-1] if along[-1] else 0.0
    xs, ys = np.array(way).T
    return float(np.interp(at, along, xs)), float(np.interp(at, along, ys))
