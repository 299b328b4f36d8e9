"""Walls on a line: the world's count is what geometry finds, and lies within the verdict's bounds."""

from itertools import groupby

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely import LineString, box

from patrol.ground.terrain import Terrain
from patrol.kernels.swept_path import free_fraction_line
from worldsim.checks.reach import Sightlines
from worldsim.kernels.radio import walls_between, walls_on_line

# Not the product's own, so that a wrong one there is noticed.
GRAZING_M = 1e-5
BEAM = 1e-6

POINT, ORIGIN = 0.5, (-1.0, 2.0)
HEIGHT, WIDTH = 9, 13
Place = tuple[float, float]

grounds = st.integers(0, 2**32).map(lambda seed: np.random.default_rng(seed).random((HEIGHT, WIDTH)) < 0.8)
places = st.tuples(
    st.floats(ORIGIN[0], ORIGIN[0] + WIDTH * POINT - 1e-9), st.floats(ORIGIN[1], ORIGIN[1] + HEIGHT * POINT - 1e-9)
)


def masked(passable: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return (~passable).view(np.uint8)


def counted(passable: NDArray[np.bool_], a: Place, b: Place) -> int:
    return int(walls_on_line(masked(passable), POINT, *ORIGIN, *a, *b, BEAM))


def by_geometry(passable: NDArray[np.bool_], a: Place, b: Place, margin: float) -> int:
    """Cut the line into strips of the grid along its longer side; count the stretches of those that touch a square."""
    line = LineString([a, b])
    axis = 0 if abs(b[0] - a[0]) >= abs(b[1] - a[1]) else 1
    touches = []
    for strip in range((WIDTH, HEIGHT)[axis]):
        low = ORIGIN[axis] + strip * POINT
        cut = box(low, -99, low + POINT, 99) if axis == 0 else box(-99, low, 99, low + POINT)
        inside = line.intersection(cut)
        squares = [
            box(ORIGIN[0] + POINT * col, ORIGIN[1] + POINT * row, *(ORIGIN + POINT * np.array([col + 1, row + 1])))
            for row, col in np.argwhere(~passable)
            if (col, row)[axis] == strip
        ]
        touches.append(not inside.is_empty and any(inside.distance(square) <= margin for square in squares))
    return sum(touching for touching, _ in groupby(touches))


@settings(max_examples=150, deadline=None)
@given(grounds, places, places)
def test_walls_are_those_that_geometry_finds(passable: NDArray[np.bool_], a: Place, b: Place) -> None:
    least, most = Sightlines(Terrain("rubble", passable, POINT, ORIGIN)).crossings(a, b)
    count = counted(passable, a, b)
    assert least <= count <= most
    assert counted(passable, b, a) == count
    assume(least == most)
    assert by_geometry(passable, a, b, BEAM) == count


@settings(max_examples=150, deadline=None)
@given(grounds, places, places)
def test_a_line_of_sight_is_one_along_which_nothing_is_hit(passable: NDArray[np.bool_], a: Place, b: Place) -> None:
    lines = Sightlines(Terrain("rubble", passable, POINT, ORIGIN))
    assume((lines.walls(a, b, GRAZING_M) > 0) == (lines.walls(a, b, -GRAZING_M) > 0))
    inside = all(
        ORIGIN[axis] + 1e-5 < place[axis] < ORIGIN[axis] + (WIDTH, HEIGHT)[axis] * POINT - 1e-5
        for place in (a, b)
        for axis in (0, 1)
    )
    assume(inside)
    free = free_fraction_line(masked(passable), POINT, *ORIGIN, *a, *b, BEAM)
    assert (counted(passable, a, b) == 0) == (free == 1.0)


@given(grounds, st.lists(places, max_size=5))
def test_walls_between_several_places_are_those_between_each_two(
    passable: NDArray[np.bool_], some: list[Place]
) -> None:
    found = walls_between(masked(passable), POINT, *ORIGIN, np.array(some).reshape(-1, 2), BEAM)
    assert found.tolist() == [[0 if a is b else counted(passable, a, b) for b in some] for a in some]


def test_a_wall_counts_once_however_thick_it_is() -> None:
    passable = np.ones((HEIGHT, WIDTH), dtype=np.bool_)
    passable[:, 2] = passable[:, 5:9] = False
    west, middle, east = (-0.9, 3.0), (1.0, 5.1), (5.0, 4.0)
    assert [counted(passable, west, other) for other in (west, middle, east)] == [0, 1, 2]
