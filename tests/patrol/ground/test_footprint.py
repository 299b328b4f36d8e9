import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.kernels.footprint import disc
from patrol.pose import Pose
from tests.patrol.ground.masks import line_is_free, on_terrain

grids = st.tuples(
    st.integers(3, 14), st.integers(3, 14), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.1, 0.3])
).map(lambda a: np.random.default_rng(a[2]).random((a[0], a[1])) >= a[3])


@settings(max_examples=60)
@given(passable=grids, seed=st.integers(0, 10**6), radius=st.floats(1.0, 12.0))
def test_line_of_sight_agrees_with_crossing_every_line_of_points(
    passable: NDArray[np.bool_], seed: int, radius: float
) -> None:
    height, width = passable.shape
    row, col = seed % height, (seed // 97) % width
    passable[row, col] = True
    view = footprint_of(Terrain("t", passable, 1.0), radius).visible(Pose(col + 0.5, row + 0.5, 0.0))
    seen = on_terrain(view, passable.shape)
    for r, c in np.ndindex(passable.shape):
        near = (r - row) ** 2 + (c - col) ** 2 <= radius**2 + 1e-9
        assert not seen[r, c] or (near and passable[r, c])
        # Where a line only grazes a corner the two may differ; what is seen has a clear line in any case.
        if seen[r, c] and (r, c) != (row, col):
            assert line_is_free(passable, (row, col), (r, c), lenient=True)


@settings(max_examples=60)
@given(passable=grids, whole=st.integers(1, 12), seed=st.integers(0, 10**6))
def test_a_radius_that_rounding_made_less_sees_what_the_whole_one_sees(
    passable: NDArray[np.bool_], whole: int, seed: int
) -> None:
    terrain = Terrain("t", passable, 1.0)
    pose = Pose(seed % passable.shape[1] + 0.5, seed // 97 % passable.shape[0] + 0.5, 0.0)
    less, exact = (footprint_of(terrain, radius).visible(pose) for radius in (whole - 9e-10, float(whole)))
    assert np.array_equal(on_terrain(less, passable.shape), on_terrain(exact, passable.shape))


@settings(max_examples=40)
@given(passable=grids, radius=st.floats(1.0, 12.0))
def test_sight_is_symmetric(passable: NDArray[np.bool_], radius: float) -> None:
    footprint = footprint_of(Terrain("t", passable, 1.0), radius)
    views = {
        (r, c): on_terrain(footprint.visible(Pose(c + 0.5, r + 0.5, 0.0)), passable.shape)
        for r, c in np.argwhere(passable)
    }
    for a, seen in views.items():
        for b in views:
            assert seen[b] == views[b][a]


def test_an_open_field_is_seen_as_a_disc() -> None:
    terrain = Terrain("open", np.ones((41, 61), dtype=np.bool_), 0.5)
    seen = on_terrain(footprint_of(terrain, 6.0).visible(Pose(10.3, 12.2, 1.0)), terrain.shape)
    rows, cols = np.mgrid[0:41, 0:61]
    assert np.array_equal(seen, (rows - 24) ** 2 + (cols - 20) ** 2 <= 144)


def test_through_walls_a_point_at_exactly_the_range_is_seen() -> None:
    terrain = Terrain("open", np.ones((13, 15), dtype=np.bool_), 1.0)
    rows, cols = np.mgrid[0:13, 0:15]
    for radius in (5.0, 4.999, np.sqrt(5.0)):
        sensor = footprint_of(terrain, radius, line_of_sight=False)
        seen = on_terrain(sensor.visible(Pose(7.5, 6.5, 0.0)), terrain.shape)
        assert np.array_equal(seen, (rows - 6) ** 2 + (cols - 7) ** 2 <= radius**2 + 1e-9)


def test_a_radius_beyond_which_its_square_has_no_smaller_share_holds_its_last_point() -> None:
    view = np.zeros((1, 3), dtype=np.uint8)
    disc(np.ones((1, 5000), dtype=np.uint8), 0, 0, 4096.0, view, 0, 4095)
    assert view.tolist() == [[1, 1, 0]]


def test_a_wall_hides_what_lies_behind_it_unless_sight_goes_through() -> None:
    passable = np.ones((21, 21), dtype=np.bool_)
    passable[:, 10] = False
    terrain = Terrain("wall", passable, 1.0)
    pose = Pose(5.5, 10.5, 0.0)
    assert not on_terrain(footprint_of(terrain, 20.0).visible(pose), terrain.shape)[:, 11:].any()
    through = on_terrain(footprint_of(terrain, 20.0, line_of_sight=False).visible(pose), terrain.shape)
    assert through[10, 20]
    assert not through[:, 10].any()


def test_a_keep_out_zone_is_seen_across() -> None:
    zone = np.broadcast_to(np.arange(21) == 10, (11, 21))
    terrain = Terrain("zone", np.ones((11, 21), dtype=np.bool_), 1.0, keep_out=zone)
    assert on_terrain(footprint_of(terrain, 20.0).visible(Pose(2.5, 5.5, 0.0)), terrain.shape).all()


@pytest.mark.parametrize("angle", [30.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi, -2.0])
def test_a_sector_holds_the_bearings_within_half_its_angle(angle: float, heading: float) -> None:
    terrain = Terrain("open", np.ones((61, 61), dtype=np.bool_), 1.0)
    seen = on_terrain(footprint_of(terrain, 25.0, angle).visible(Pose(30.5, 30.5, heading)), terrain.shape)
    for row, col in np.ndindex(61, 61):
        distance = math.hypot(row - 30, col - 30)
        if distance == 0.0:
            assert seen[row, col]
            continue
        off = abs(math.remainder(math.atan2(row - 30, col - 30) - heading, 2 * math.pi))
        if abs(off - math.radians(angle) / 2) > 1e-6:
            assert seen[row, col] == (distance <= 25.0 and off < math.radians(angle) / 2)


@pytest.mark.parametrize("eighth", range(-4, 5))
def test_a_point_on_the_edge_of_a_sector_is_seen(eighth: int) -> None:
    """A quarter circle from one of the eight directions to another, both with their points."""
    terrain = Terrain("open", np.ones((41, 41), dtype=np.bool_), 1.0)
    pose = Pose(20.5, 20.5, eighth * math.pi / 4.0)
    seen = on_terrain(footprint_of(terrain, 15.0, 90.0).visible(pose), terrain.shape)
    for off in (-2, -1, 0, 1, 2):
        down, across = (
            round(math.sqrt(2.0) * part(pose.heading + off * math.pi / 4.0)) for part in (math.sin, math.cos)
        )
        edge = [bool(seen[20 + n * down, 20 + n * across]) for n in range(1, 11)]
        assert edge == [abs(off) < 2] * 10, off


def test_a_robot_beyond_the_edge_sees_what_is_inside_or_nothing() -> None:
    terrain = Terrain("open", np.ones((10, 10), dtype=np.bool_), 1.0)
    places = [(x, y) for x in range(-6, 17) for y in range(-6, 17) if not (-2 <= x <= 11 and -2 <= y <= 11)]
    for x, y in [*places, (50, 50)]:
        assert not on_terrain(footprint_of(terrain, 3.0).visible(Pose(x + 0.5, y + 0.5, 0.0)), terrain.shape).any()
    assert on_terrain(footprint_of(terrain, 3.0).visible(Pose(-0.5, 5.5, 0.0)), terrain.shape)[5, 0]
