import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.ground.terrain import Terrain, whole_points


def terrain(height: int = 4, width: int = 6, point: float = 0.1) -> Terrain:
    return Terrain("field", np.ones((height, width), dtype=np.bool_), point, (-1.0, 2.0))


def test_the_grid_lies_from_its_origin_upwards() -> None:
    field = terrain()
    assert field.shape == (field.height, field.width) == (4, 6)
    assert field.bounds == pytest.approx((-1.0, 2.0, -0.4, 2.4))
    assert field.point_at(-0.99, 2.01) == (0, 0)
    assert field.point_at(-0.41, 2.39) == (3, 5)
    assert field.centre(3, 5) == pytest.approx((-0.45, 2.35))


@given(row=st.integers(-5, 300), col=st.integers(-5, 300), point=st.sampled_from([0.05, 0.1, 0.3, 0.5]))
def test_a_points_centre_lies_in_the_point(row: int, col: int, point: float) -> None:
    field = terrain(point=point)
    assert field.point_at(*field.centre(row, col)) == (row, col)


@pytest.mark.parametrize(
    "place", [(-1.01, 2.1), (-0.39, 2.1), (-0.9, 1.99), (-0.9, 2.41), (math.nan, 2.1), (math.inf, 2.1)]
)
def test_places_off_the_terrain(place: tuple[float, float]) -> None:
    assert not terrain().contains(*place)
    assert terrain().contains(-0.9, 2.1)


def test_bodies_are_kept_out_where_sight_is_not() -> None:
    passable = np.ones((3, 3), dtype=np.bool_)
    passable[0, 0] = False
    keep_out = np.zeros((3, 3), dtype=np.bool_)
    keep_out[2, 2] = True
    field = Terrain("field", passable, 1.0, keep_out=keep_out)
    assert field.free.sum() == 7
    assert np.array_equal(field.blocked, (~field.free).astype(np.uint8))
    assert field.passable[2, 2]


def test_a_terrain_cannot_be_changed_and_grids_that_do_not_fit_are_refused() -> None:
    passable = np.ones((3, 3), dtype=np.bool_)
    field = Terrain("field", passable, 1.0)
    for grid in (field.passable, field.keep_out, field.free):
        assert not grid.flags.writeable
    assert passable.flags.writeable
    with pytest.raises(ValueError, match="two-dimensional"):
        Terrain("field", np.ones(3, dtype=np.bool_), 1.0)
    with pytest.raises(ValueError, match="keep_out"):
        Terrain("field", np.ones((3, 3), dtype=np.bool_), 1.0, keep_out=np.ones((2, 3), dtype=np.bool_))


@pytest.mark.parametrize(
    ("length", "point", "count"), [(88.0, 0.1, 880), (0.3, 0.1, 3), (1.0, 0.3, 3), (5.0, 1e-300, 50_000_001)]
)
def test_whole_points_along_a_length(length: float, point: float, count: int) -> None:
    assert whole_points(length, point) == count
