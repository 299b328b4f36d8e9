import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box

from patrol.ground.shapes import TOLERANCE, cover, points_near
from patrol.ground.terrain import BoolGrid, Terrain

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


def test_an_edge_along_the_grid_takes_no_point_more_and_a_speck_covers_its_own() -> None:
    covered = cover([(0.3, 0.1), (0.7, 0.1), (0.7, 0.6), (0.3, 0.6)], (10, 10), 0.1, (0.0, 0.0))
    expected = np.zeros((10, 10), dtype=np.bool_)
    expected[1:6, 3:7] = True
    assert np.array_equal(covered, expected)
    covered = cover([(2.4, 3.4), (2.5, 3.4), (2.4, 3.5)], (6, 6), 1.0, (0.0, 0.0))
    assert np.argwhere(covered).tolist() == [[3, 2]]


def by_every_point(
    polygon: list[tuple[float, float]], shape: tuple[int, int], point: float, origin: tuple[float, float]
) -> BoolGrid:
    """Return what `cover` gives, from each edge and each point by itself."""
    corners = [((x - origin[0]) / point, (y - origin[1]) / point) for x, y in polygon]
    covered = np.zeros(shape, dtype=np.bool_)
    for row, col in np.ndindex(shape):
        inside = False
        for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
            y = row + 0.5
            if (y >= y0) != (y >= y1) and col + 0.5 < x0 + (y - y0) * ((x1 - x0) / (y1 - y0)):
                inside = not inside
            spans = [(0.0, 1.0)]
            for a0, a1, index in ((x0, x1, col), (y0, y1, row)):
                low, high = index + TOLERANCE, index + 1.0 - TOLERANCE
                if a0 != a1:
                    spans.append(tuple(sorted(((low - a0) / (a1 - a0), (high - a0) / (a1 - a0)))))
                elif not low < a0 < high:
                    spans.append((1.0, 0.0))
            covered[row, col] |= max(low for low, _ in spans) < min(high for _, high in spans)
        covered[row, col] |= inside
    return covered


near = st.sampled_from([-1.0, 0.0, 0.5, 1.0, 3.0, 7.25, 70.0]) | st.floats(-3.0, 90.0)


@given(
    st.lists(st.tuples(near, near), min_size=1, max_size=6),
    st.tuples(st.integers(1, 5), st.integers(1, 90)) | st.tuples(st.integers(1, 90), st.integers(1, 5)),
    st.sampled_from([1.0, 0.3]),
)
def test_each_point_is_covered_as_if_it_were_looked_at_alone(
    polygon: list[tuple[float, float]], shape: tuple[int, int], point: float
) -> None:
    for origin in ((0.0, 0.0), (-0.7, 1.3)):
        assert np.array_equal(cover(polygon, shape, point, origin), by_every_point(polygon, shape, point, origin))


@given(place=places, radius=st.floats(0.0, 5.0))
def test_points_near_a_place_are_those_whose_centres_are(place: tuple[float, float], radius: float) -> None:
    terrain = Terrain("field", np.ones(SHAPE, dtype=np.bool_), 0.5, origin=ORIGIN)
    near = points_near(terrain, place, radius)
    for row, col in np.ndindex(SHAPE):
        away = math.dist(terrain.centre(row, col), place)
        if abs(away - radius) > 1e-9:
            assert near[row, col] == (away < radius)
