"""Regions against an independent geometry library: convex, disjoint, covering, and connected where bodies pass."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.shapes import cover
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.builtins import builtin_terrain
from patrol.maps.load import read_terrain
from patrol.prepare import Prepared, prepare
from patrol.regions.pieces import SMOOTHED
from patrol.regions.split import RegionSplit, regions_by_hand, split_regions
from patrol.scenario import load_scenario

MAPS = Path(__file__).parents[4] / "shared" / "maps"
YARDS = (
    ((0, 0), (15.5, 0), (20, 48), (20, 88), (0, 88)),
    ((24.5, 0), (40, 0), (40, 40), (35.5, 88), (20, 88), (20, 48)),
    ((40, 0), (55.5, 0), (60, 48), (60, 88), (44.5, 88), (40, 40)),
    ((64.5, 0), (80, 0), (80, 40), (75.5, 88), (60, 88), (60, 48)),
    ((80, 0), (100, 0), (100, 88), (84.5, 88), (80, 40)),
)


def terrain_of(free: BoolGrid, point: float = 1.0) -> Terrain:
    return Terrain("made", free, point)


def check_split(terrain: Terrain, split: RegionSplit) -> None:
    """Convex, disjoint, covering; all tolerances in points."""
    polygons = [shapely.Polygon((np.array(polygon) - terrain.origin) / terrain.point) for polygon in split.polygons]
    for polygon in polygons:
        assert polygon.is_valid
        assert shapely.Polygon(polygon.exterior).exterior.is_ccw
        assert polygon.convex_hull.area - polygon.area < 1e-6
    tree = shapely.STRtree(polygons)
    for number, polygon in enumerate(polygons):
        for other in tree.query(polygon):
            if other < number:
                assert polygon.intersection(polygons[other]).buffer(-1e-5).is_empty
    assert np.array_equal(split.labels >= 0, terrain.free)
    assert set(np.unique(split.labels[terrain.free])) == set(range(len(polygons)))
    walls = distance_transform_edt(~terrain.free)
    for number, polygon in enumerate(polygons):
        rows, cols = np.nonzero(split.labels == number)
        away = shapely.distance(polygon, shapely.points(cols + 0.5, rows + 0.5))
        assert away.max() <= SMOOTHED
        west, south, east, north = (int(bound) for bound in polygon.bounds)
        rows, cols = np.nonzero(walls[south : north + 1, west : east + 1])
        inside = shapely.contains_xy(polygon, cols + west + 0.5, rows + south + 0.5)
        # `walls` is measured between the centres of points, half a point or more beyond the wall's face.
        assert walls[rows[inside] + south, cols[inside] + west].max(initial=0.0) <= 2.5 + 0.5


def check_connections(terrain: Terrain, split: RegionSplit, body: BoolGrid) -> None:
    """Connections lie where the body fits, on the border between their parts, and no border is forgotten."""
    assert np.array_equal(split.parts >= 0, body & terrain.free)
    parts, labels = split.parts.ravel(), split.labels.ravel()
    for link in split.connections:
        first, second = link.points
        assert abs(first - second) in (1, terrain.width)
        assert (parts[first], parts[second]) == link.parts
        assert (labels[first], labels[second]) == link.regions
        assert link.regions[0] != link.regions[1]
        assert terrain.point_at(link.x, link.y) == divmod(first, terrain.width)
    linked = {frozenset(link.parts) for link in split.connections}
    for one, two in ((split.parts[:, 1:], split.parts[:, :-1]), (split.parts[1:], split.parts[:-1])):
        meets = (one >= 0) & (two >= 0) & (one != two)
        assert {frozenset(map(int, pair)) for pair in zip(one[meets], two[meets], strict=True)} <= linked


def islands(split: RegionSplit) -> int:
    """Count the groups of parts that the connections leave, the slow way."""
    group = list(range(int(split.parts.max(initial=-1)) + 1))
    for link in split.connections:
        one, two = (group[part] for part in link.parts)
        group = [one if each == two else each for each in group]
    return len(set(group))


@pytest.mark.parametrize("point", [pytest.param(0.1, marks=pytest.mark.accept), 0.5])
@pytest.mark.parametrize(("name", "most"), [("open", 1), ("yards", 9), ("clutter", 90), ("site", 55)])
def test_builtin_terrains_split_into_few_regions(name: str, point: float, most: int) -> None:
    if (name, point) == ("site", 0.1):
        point = 0.2  # a quarter of the checking
    terrain = builtin_terrain(name, point)
    body = cspace_of(terrain, 1.0)
    split = split_regions(terrain, body)
    check_split(terrain, split)
    check_connections(terrain, split, body)
    assert len(split.polygons) <= most
    assert islands(split) == parts_of(body)[1] == 1


@pytest.mark.parametrize("name", ["cumberland", "example"])
@pytest.mark.parametrize("point", [0.1, 0.5])
def test_real_maps(name: str, point: float) -> None:
    if not (MAPS / f"{name}.yaml").exists():
        pytest.skip("the map is not here")
    terrain = read_terrain(MAPS / f"{name}.yaml", point)
    body = cspace_of(terrain, 0.3)
    split = split_regions(terrain, body)
    check_split(terrain, split)
    check_connections(terrain, split, body)
    assert len(split.polygons) <= 120
    assert islands(split) == parts_of(body)[1]


rectangles = st.lists(
    st.tuples(st.integers(0, 45), st.integers(0, 45), st.integers(1, 18), st.integers(1, 18)), max_size=12
)


@settings(max_examples=60)
@given(boxes=rectangles, solid=st.booleans(), shape=st.tuples(st.integers(1, 50), st.integers(1, 50)))
def test_random_rectangles(boxes: list[tuple[int, int, int, int]], solid: bool, shape: tuple[int, int]) -> None:
    free = np.full(shape, solid)
    for row, col, height, width in boxes:
        free[row : row + height, col : col + width] = not solid
    terrain = terrain_of(free)
    split = split_regions(terrain)
    if free.any():
        check_split(terrain, split)
    check_connections(terrain, split, free)
    assert islands(split) == parts_of(free)[1]


@settings(max_examples=40)
@example(seed=498)  # upright sides but for rounding
@example(seed=682)  # a corner on another side of its outline
@example(seed=1882)  # a bevelled obstacle whose sides meet far beyond its end
@example(seed=962137)  # a region that reaches 2.5 points into a wall
@example(seed=263512)  # and diagonally
@example(seed=3185075070)  # a large region with four points beside it
@given(seed=st.integers(0, 2**32 - 1))
def test_random_slanted_obstacles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free = np.ones((60, 70), dtype=np.bool_)
    for _ in range(rng.integers(1, 7)):
        turns = np.sort(rng.random(rng.integers(3, 7))) * 2 * np.pi
        x, y, radius = rng.random(3) * (70, 60, 14) + (0, 0, 2)
        corners = [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]
        free &= ~cover(corners, free.shape, 1.0, (0.0, 0.0))
    terrain = terrain_of(free)
    split = split_regions(terrain)
    check_split(terrain, split)
    assert islands(split) == parts_of(free)[1]


@settings(max_examples=25)
@example(seed=3446997300, density=0.3)  # a corner of an obstacle on a cut
@given(seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.02, 0.1, 0.3, 0.5]))
def test_noise_breaks_nothing(seed: int, density: float) -> None:
    free = np.random.default_rng(seed).random((24, 31)) >= density
    split = split_regions(terrain_of(free))
    polygons = [shapely.Polygon(polygon) for polygon in split.polygons]
    for number, polygon in enumerate(polygons):
        assert polygon.convex_hull.area - polygon.area < 1e-6
        assert all(polygon.intersection(other).buffer(-1e-5).is_empty for other in polygons[:number])
    assert np.array_equal(split.labels >= 0, free)
    assert islands(split) == parts_of(free)[1]


def test_the_same_terrain_splits_the_same_way() -> None:
    first, second = (split_regions(builtin_terrain("clutter", 0.5)) for _ in range(2))
    assert first.polygons == second.polygons
    assert first.connections == second.connections


def test_without_its_library_regions_must_be_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "patrol.regions.pieces", None)
    with pytest.raises(BadInput, match=r"needs shapely; install it with: .* or give patrol\.options\.regions"):
        split_regions(builtin_terrain("yards", 0.5))


def test_too_broken_a_terrain_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("patrol.regions.pieces.MOST_CORNERS", 20)
    with pytest.raises(BadInput, match=r"patrol.options.paths = regions: the outline of yards has .*choose wave"):
        split_regions(builtin_terrain("yards", 0.5))


def two_rooms(*doors: tuple[int, int]) -> Terrain:
    """Two rooms of 10 x 8 m with a wall of one point between them, and doors in it, from row to row."""
    free = np.ones((80, 201), dtype=np.bool_)
    free[:, 100] = False
    for low, high in doors:
        free[low:high, 100] = True
    return terrain_of(free, 0.1)


def test_a_door_connects_only_bodies_that_fit_through() -> None:
    terrain = two_rooms((30, 36))
    split = split_regions(terrain)
    narrow, wide = cspace_of(terrain, 0.2), cspace_of(terrain, 0.4)
    assert [islands(split.for_body(terrain, body)) for body in (narrow, wide)] == [1, 2]
    assert split.for_body(terrain, wide).labels is split.labels


def test_each_stretch_of_a_border_has_its_connection_and_parts_that_no_body_joins_are_apart() -> None:
    terrain = two_rooms((10, 20), (50, 70))
    west, east = ((0, 0), (10.05, 0), (10.05, 8), (0, 8)), ((10.05, 0), (20.1, 0), (20.1, 8), (10.05, 8))
    split = regions_by_hand(terrain, [west, east])
    assert [link.regions for link in split.connections] == [(0, 1), (0, 1)]
    assert sorted(link.y for link in split.connections) == pytest.approx([1.5, 6.0], abs=0.11)
    terrain = two_rooms((30, 36))
    split = regions_by_hand(terrain, [((0, 0), (20.1, 0), (20.1, 8), (0, 8))], cspace_of(terrain, 0.4))
    assert len(split.polygons) == 1
    assert split.parts.max() == 1
    assert split.connections == ()


@pytest.mark.parametrize("point", [0.1, 0.5])
def test_regions_by_hand(point: float) -> None:
    terrain = builtin_terrain("yards", point)
    body = cspace_of(terrain, 1.0)
    split = regions_by_hand(terrain, [YARDS[0], *(polygon[::-1] for polygon in YARDS[1:])], body)
    assert np.array_equal(split.labels >= 0, terrain.free)
    numbers = [split.labels[terrain.point_at(x, y)] for x, y in ((10, 44), (30, 44), (50, 44), (70, 44), (90, 44))]
    assert sorted(numbers) == [0, 1, 2, 3, 4]
    check_connections(terrain, split, body)
    assert len(split.connections) == 4


@pytest.mark.parametrize("name", ["yards", "clutter"])
def test_what_was_found_can_be_given(name: str) -> None:
    terrain = builtin_terrain(name, 0.5)
    found = split_regions(terrain)
    given_back = regions_by_hand(terrain, found.polygons)
    assert len(given_back.polygons) == len(found.polygons)
    # Centres on a border, of which diagonals of the triangles have many, may go to either side.
    assert np.count_nonzero(given_back.labels != found.labels) <= 0.02 * found.labels.size


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({0: YARDS[0][:2]}, ".0: has 2 corners; give at least 3"),
        ({0: ((0, 37), (10, 37), (15, 37))}, ".0: covers less than one point"),
        ({4: ((80, 0), (100, 0), (90, 40), (100, 88), (80, 40))}, ".4: is not convex at (90, 40); split"),
        ({0: ((0, 0), (20, 88), (20, 0), (0, 88))}, ".0: its sides cross; list the corners in order"),
        ({0: ((0, 0), (23, 0), (23, 88), (0, 88))}, ".1: overlaps region 0 by 3.00 m; move"),
        ({2: ((157, 51), (196, 51), (196, 88))}, ".2: holds no free point of yards; correct or drop it"),
        ({4: ((80, 0), (98, 0), (98, 88), (84.5, 88), (80, 40))}, ": 176.00 m2 of free ground lie in no"),
    ],
)
def test_regions_by_hand_that_are_no_split(change: dict[int, tuple[tuple[float, float], ...]], problem: str) -> None:
    polygons = [change.get(number, polygon) for number, polygon in enumerate(YARDS)]
    with pytest.raises(BadInput) as caught:
        regions_by_hand(builtin_terrain("yards", 0.5), polygons)
    assert str(caught.value).startswith(f"patrol.options.regions{problem}")
    assert "\n" not in str(caught.value)


def test_a_gap_is_told_with_its_place() -> None:
    with pytest.raises(BadInput, match=r"m2 of them around \(70\.\d+, 4[34]\.\d+\); widen the regions or add one"):
        regions_by_hand(builtin_terrain("yards", 0.5), [YARDS[0], YARDS[1], YARDS[2], YARDS[4]])


def test_ground_that_no_body_gets_to_may_be_left_out() -> None:
    terrain = two_rooms()
    west = ((0, 0), (10, 0), (10, 8), (0, 8))
    with pytest.raises(BadInput, match="in no region"):
        regions_by_hand(terrain, [west])
    body = cspace_of(terrain, 0.4)
    body = body & (np.arange(terrain.width) < 100)
    assert len(regions_by_hand(terrain, [west], body).polygons) == 1


COARSE_YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 0.5}


def by_regions(**options: Any) -> dict[str, Any]:
    """A scenario's section `patrol` with paths over regions."""
    return {"policy": "potential-field", "options": {"paths": "regions", **options}}


def test_a_scenario_is_prepared_with_a_split_for_each_body(tmp_path: Path) -> None:
    robots = [{"radius": 1.0}, {"radius": 0.4, "model": "holonomic"}, {"radius": 1.0}]
    scenario = load_scenario({**COARSE_YARDS, "robots": robots, "patrol": by_regions()})
    prepared = prepare(scenario)
    assert prepared.regions[1] is prepared.regions[3]
    assert np.count_nonzero(prepared.regions[1].parts >= 0) < np.count_nonzero(prepared.regions[2].parts >= 0)
    prepared.save(tmp_path / "static")
    loaded = Prepared.load(scenario, tmp_path / "static").regions
    assert loaded is not None
    assert loaded[1] is loaded[3]
    for number, split in prepared.regions.items():
        assert loaded[number].polygons == split.polygons
        assert loaded[number].connections == split.connections
        assert np.array_equal(loaded[number].labels, split.labels)
        assert np.array_equal(loaded[number].parts, split.parts)
        assert not loaded[number].labels.flags.writeable


def test_other_paths_need_no_regions(tmp_path: Path) -> None:
    scenario = load_scenario(COARSE_YARDS)
    prepared = prepare(scenario)
    assert not prepared.regions
    prepared.save(tmp_path / "static")
    assert not Prepared.load(scenario, tmp_path / "static").regions


def test_a_scenarios_own_regions_are_used_and_checked() -> None:
    regions = prepare(load_scenario({**COARSE_YARDS, "patrol": by_regions(regions=YARDS)})).regions
    assert regions is not None
    assert len(regions[1].polygons) == 5
    assert any((20.0, 48.0) in polygon for polygon in regions[1].polygons)
    with pytest.raises(BadInput, match="lie in no region"):
        prepare(load_scenario({**COARSE_YARDS, "patrol": by_regions(regions=YARDS[:4])}))
