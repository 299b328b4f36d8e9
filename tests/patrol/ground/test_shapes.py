from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box

from patrol.ground.shapes import cover

SHAPE = (9, 12)
ORIGIN = (-1.0, 0.5)
places = st.tuples(
    st.integers(-20, 80).map(lambda tenth: tenth / 10.0), st.integers(-20, 80).map(lambda tenth: tenth / 10.0)
)


@settings(max_examples=150)
@given(corners=st.lists(places, min_size=3, max_size=7), point=st.sampled_from([0.25, 0.5, 0.7, 1.0]))
def test_covers_exactly_the_points_that_share_area(corners: list[tuple[float, float]], point: float) -> None:
    polygon = Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        return
    covered = cover(corners, SHAPE, point, ORIGIN)
    for row in range(SHAPE[0]):
        for col in range(SHAPE[1]):
            left, low = ORIGIN[0] + col * point, ORIGIN[1] + row * point
            shared = polygon.intersection(box(left, low, left + point, low + point)).area
            if covered[row, col]:
                assert polygon.intersects(box(left - 1e-9, low - 1e-9, left + point + 1e-9, low + point + 1e-9))
            else:
                assert shared < 1e-5 * point * point


def test_an_edge_along_the_grid_takes_no_point_more() -> None:
    covered = cover([(0.3, 0.1), (0.7, 0.1), (0.7, 0.6), (0.3, 0.6)], (10, 10), 0.1, (0.0, 0.0))
    expected = np.zeros((10, 10), dtype=np.bool_)
    expected[1:6, 3:7] = True
    assert np.array_equal(covered, expected)


def test_a_speck_inside_one_point_covers_it() -> None:
    covered = cover([(2.4, 3.4), (2.5, 3.4), (2.4, 3.5)], (6, 6), 1.0, (0.0, 0.0))
    assert np.argwhere(covered).tolist() == [[3, 2]]


def test_a_concave_polygon_leaves_its_notch_free() -> None:
    corners = [(0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (4.0, 6.0), (4.0, 2.0), (2.0, 2.0), (2.0, 6.0), (0.0, 6.0)]
    covered = cover(corners, (6, 6), 1.0, (0.0, 0.0))
    assert not covered[2:, 2:4].any()
    assert covered.sum() == 36 - 8


@pytest.mark.parametrize("shift", [(-50.0, 0.0), (50.0, 0.0), (0.0, 50.0), (0.0, -50.0)])
def test_a_polygon_off_the_grid_covers_nothing(shift: tuple[float, float]) -> None:
    corners = [(x + shift[0], y + shift[1]) for x, y in [(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)]]
    assert not cover(corners, (5, 5), 1.0, (0.0, 0.0)).any()
