import numpy as np
import pytest
from shapely import LinearRing, Polygon, box, union_all

from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.fields import compute_fields
from patrol.maps.builtins import LAYOUTS, builtin_terrain
from patrol.pose import Pose
from patrol.scenario import BUILTINS
from patrol.starts import starting_part

SIZES = {"open": (100.0, 88.0), "yards": (100.0, 88.0), "clutter": (118.0, 118.0), "site": (240.0, 160.0)}
FREE_M2 = {"open": (8800, 8800), "yards": (7800, 8000), "clutter": (11_000, 12_000), "site": (24_000, 27_000)}

SHAPES = {
    "open": (8800.0, 376.0, 50.0, 44.0),
    "yards": (7936.0, 725.683808, 50.0, 44.0),
    "clutter": (11617.125, 1543.742169, 58.835069, 58.893091),
    "site": (24261.496862, 2966.477392, 121.254385, 82.646786),
}
"""Area in m², edges in m, and centre in m of each terrain's free ground: no corner of it moves unnoticed."""


def free_polygon(name: str) -> Polygon:
    layout = LAYOUTS[name]
    free = box(0.0, 0.0, layout.width, layout.height) - union_all([Polygon(each) for each in layout.obstacles])
    assert isinstance(free, Polygon)
    return free


def test_the_scenarios_names_are_the_terrains_names() -> None:
    assert set(BUILTINS) == set(LAYOUTS) == set(SIZES)
    with pytest.raises(BadInput, match="known are open, yards, clutter, site"):
        builtin_terrain("moon", 0.1)


@pytest.mark.parametrize("name", SIZES)
def test_every_corner_is_where_it_was(name: str) -> None:
    free = free_polygon(name)
    assert (free.area, free.length, free.centroid.x, free.centroid.y) == pytest.approx(SHAPES[name], abs=1e-5)


@pytest.mark.parametrize("name", SIZES)
def test_size_and_free_area(name: str) -> None:
    terrain = builtin_terrain(name, 0.1)
    assert terrain.bounds == pytest.approx((0.0, 0.0, *SIZES[name]))
    least, most = FREE_M2[name]
    free = np.count_nonzero(terrain.passable) * terrain.point_area
    assert least - 0.01 <= free <= most + 0.01
    assert free == pytest.approx(free_polygon(name).area, rel=0.005)


@pytest.mark.parametrize("point", [0.2, 0.5, 0.7])
@pytest.mark.parametrize("name", SIZES)
def test_obstacles_never_shrink(name: str, point: float) -> None:
    terrain = builtin_terrain(name, point)
    free = free_polygon(name).buffer(1e-4)
    rng = np.random.default_rng(5)
    rows, cols = np.nonzero(terrain.passable)
    for at in rng.integers(0, rows.size, 60):
        x, y = terrain.centre(int(rows[at]), int(cols[at]))
        half = 0.5 * point
        assert free.contains(box(x - half, y - half, x + half, y + half))


@pytest.mark.parametrize("name", SIZES)
def test_a_wide_body_gets_everywhere_and_sees_everything(name: str) -> None:
    terrain = builtin_terrain(name, 0.2)
    for radius in (1.0, 2.3):  # gaps are 5 m and more
        assert parts_of(cspace_of(terrain, radius))[1] == 1
    part = np.flatnonzero(starting_part(terrain, 1.0))
    start = Pose(*terrain.centre(*divmod(int(part[0]), terrain.width)), 0.0)
    fields = compute_fields(terrain, 1.0, 10.0, True, [start])
    assert np.array_equal(fields.patrolled, terrain.passable)


def test_yards_falls_into_five_convex_regions_and_no_fewer() -> None:
    free = free_polygon("yards")
    regions = [free & box(west, 0.0, west + 20.0, 88.0) for west in (0.0, 20.0, 40.0, 60.0, 80.0)]
    for region in regions:
        assert region.convex_hull.area == pytest.approx(region.area)
    # Each wedge's tip is a concave corner that only a cut straight on settles, and such cuts are parallel.
    assert free.interiors[:] == []
    assert concave_corners(free.exterior) == 4


def concave_corners(ring: LinearRing) -> int:
    corners = np.array(ring.simplify(1e-9).coords)[:-1]
    after = np.roll(corners, -1, axis=0) - corners
    before = corners - np.roll(corners, 1, axis=0)
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return int(np.count_nonzero(turn < 0.0 if ring.is_ccw else turn > 0.0))


@pytest.mark.parametrize("point", [60.0, 1e-4, 1e-300])
def test_points_that_leave_no_terrain_are_refused(point: float) -> None:
    with pytest.raises(BadInput, match="point ="):
        builtin_terrain("yards", point)
