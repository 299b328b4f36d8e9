"""A view's window and its terrain, where they overlap in part; and what a sensor takes of a point's age."""

from itertools import product

import numpy as np
import pytest

from patrol.ground.footprint import View
from patrol.ground.sensors import Quality, footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose

SHAPE = (7, 4)
ALL_PLACES = list(product(range(-4, 9), range(-4, 6)))


def view_at(row0: int, col0: int) -> View:
    """A window of 3 x 3 points with a mask without any symmetry, empty outside the terrain."""
    mask = np.array([[1, 0, 1], [1, 1, 0], [0, 0, 1]], dtype=np.uint8)
    for row, col in np.ndindex(mask.shape):
        if not (0 <= row0 + row < SHAPE[0] and 0 <= col0 + col < SHAPE[1]):
            mask[row, col] = 0
    return View(row0, col0, mask)


@pytest.mark.parametrize(("row0", "col0"), ALL_PLACES)
def test_marks_box_and_points_agree_wherever_the_window_lies(row0: int, col0: int) -> None:
    view = view_at(row0, col0)
    seen = {(row0 + int(row), col0 + int(col)) for row, col in np.argwhere(view.mask)}
    assert {(row, col) for row, col in product(range(-6, 14), repeat=2) if view.shows(row, col)} == seen
    on_terrain = [
        (row, col)
        for row, col in product(range(row0, row0 + 3), range(col0, col0 + 3))
        if 0 <= row < SHAPE[0] and 0 <= col < SHAPE[1]
    ]
    rows, cols = [row for row, _ in on_terrain], [col for _, col in on_terrain]
    assert view.box(SHAPE) == ((min(rows), max(rows), min(cols), max(cols)) if on_terrain else None)
    if on_terrain:
        grid = np.full(SHAPE, 5, dtype=np.int32)
        grid[0, :] = grid[:, 0] = 9  # seen later than this view
        before = grid.copy()
        view.mark(grid, 7)
        for row, col in np.ndindex(SHAPE):
            assert grid[row, col] == (max(before[row, col], 7) if (row, col) in seen else before[row, col])


@pytest.mark.parametrize(
    ("quality", "shares"),
    [
        (0.6, [0.6] * 5),
        ([(1.0, 0.8), (3.0, 0.4)], [0.8, 0.8, 0.6, 0.4, 0.4]),
        ([(0.0, 1.0), (4.0, 0.2)], [1.0, 0.8, 0.6, 0.4, 0.2]),
    ],
)
def test_quality_is_that_of_the_distance_in_metres(quality: Quality, shares: list[float]) -> None:
    """On points of 0.5 m: shares at 0, 1, 2, 3 and 4 m to the right, above and, of 3 and 4 points, on a slant."""
    terrain = Terrain("field", np.ones((21, 21), dtype=np.bool_), 0.5)
    footprint = footprint_of(terrain, 4.0, quality=quality)
    view = footprint.visible(Pose(5.25, 5.25, 0.0))
    assert view.quality is not None
    middle = 10 - view.row0, 10 - view.col0
    for metres, share in enumerate(shares):
        assert view.quality[middle[0], middle[1] + 2 * metres] == pytest.approx(share)
        assert view.quality[middle[0] - 2 * metres, middle[1]] == pytest.approx(share)
    slanting = np.interp(2.5, range(5), shares)
    assert view.quality[middle[0] + 3, middle[1] - 4] == pytest.approx(slanting)
    assert footprint.leaves_age


@pytest.mark.parametrize("quality", [1.0, 1, [(0.0, 1.0), (5.0, 1.0)]])
def test_a_quality_of_one_leaves_no_age(quality: Quality) -> None:
    terrain = Terrain("field", np.ones((5, 5), dtype=np.bool_), 0.5)
    footprint = footprint_of(terrain, 2.0, quality=quality)
    assert footprint.visible(Pose(1.0, 1.0, 0.0)).quality is None
    assert not footprint.leaves_age


@pytest.mark.parametrize(("angle_deg", "all_round"), [(360.0, True), (361.0, True), (359.9, False)])
def test_a_sector_of_a_whole_turn_is_a_disc(angle_deg: float, all_round: bool) -> None:
    terrain = Terrain("field", np.ones((5, 5), dtype=np.bool_), 0.5)
    assert footprint_of(terrain, 2.0, angle_deg).all_round == all_round
