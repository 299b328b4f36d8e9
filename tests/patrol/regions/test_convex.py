"""Polygons in the plane, against shapes that are known by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.regions.convex import Floats, area, circumference, depths, hull, outward, overlap

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]])
"""A box of 4 x 2, counter-clockwise."""

places = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=3, max_size=12, unique=True)


def cross(a: Floats, b: Floats) -> Floats:
    """The cross products of vectors in the plane."""
    product: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def test_areas_are_signed_and_lengths_go_once_around() -> None:
    assert (area(SQUARE), area(SQUARE[::-1])) == (8.0, -8.0)
    assert area(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]])) == 6.0
    assert circumference(SQUARE) == 12.0


@given(places)
def test_a_hull_holds_all_places_and_turns_left_at_each_of_its_corners(points: list[tuple[int, int]]) -> None:
    given_places = np.array(points, dtype=np.float64)
    spread = given_places - given_places[0]
    if not np.abs(cross(spread[1:2], spread)).max() and not np.abs(cross(spread[:, None], spread[None])).max():
        return  # all in one line
    found = hull(given_places)
    ahead = np.roll(found, -1, axis=0) - found
    assert (cross(ahead, np.roll(ahead, -1, axis=0)) > 0.0).all()
    assert (depths(found, given_places) >= -1e-9).all()
    assert {tuple(corner) for corner in found.tolist()} <= {tuple(place) for place in given_places.tolist()}


def test_sides_of_a_box_look_outward() -> None:
    normals, reach = outward(SQUARE)
    assert normals.tolist() == [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]
    assert reach.tolist() == [0.0, 4.0, 2.0, 0.0]
    assert outward(SQUARE * 3.0)[1].tolist() == [0.0, 12.0, 6.0, 0.0]


@pytest.mark.parametrize(
    ("place", "depth"),
    [((2.0, 1.0), 1.0), ((0.25, 1.0), 0.25), ((3.5, 1.75), 0.25), ((4.0, 1.0), 0.0), ((5.5, 1.0), -1.5)],
)
def test_depths_are_to_the_nearest_side(place: tuple[float, float], depth: float) -> None:
    assert depths(SQUARE, np.array([place])).tolist() == [pytest.approx(depth)]


@pytest.mark.parametrize(
    ("shift", "depth"),
    [
        ((0.0, 0.0), 2.0),
        ((3.5, 0.0), 0.5),
        ((0.0, -1.75), 0.25),
        ((4.0, 0.0), 0.0),
        ((4.5, 0.0), -0.5),
        ((3.0, 1.5), 0.5),
    ],
)
def test_boxes_are_parted_along_the_shortest_way(shift: tuple[float, float], depth: float) -> None:
    assert overlap(SQUARE, SQUARE + shift) == pytest.approx(depth)
    assert overlap(SQUARE + shift, SQUARE) == pytest.approx(depth)


def test_the_shortest_way_may_be_along_a_side_of_the_second_alone() -> None:
    """A diamond with half diagonals of 2, whose lower right side cuts off a corner of the box."""
    diamond = np.array([[1.5, 3.0], [-0.5, 5.0], [-2.5, 3.0], [-0.5, 1.0]])
    assert overlap(SQUARE, diamond) == pytest.approx(0.5 / math.sqrt(2.0))
