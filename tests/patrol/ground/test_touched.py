"""Points that share some area with a marked cell, against looking at each pair of a point and a cell."""

import numpy as np
import pytest

from patrol.ground.shapes import touched_points


@pytest.mark.parametrize("resolution", [0.05, 0.25, 1.0])
@pytest.mark.parametrize("point", [0.1, 0.25, 0.4])
@pytest.mark.parametrize("start", [(0.0, 0.0), (0.1, -0.3), (-0.25, 0.5), (3.0, 0.07)])
def test_points_touch_marked_cells_that_they_share_area_with(
    resolution: float, point: float, start: tuple[float, float]
) -> None:
    cells = np.random.default_rng(7).random((5, 9)) < 0.25
    found = touched_points(cells, resolution, point, (6, 11), start)
    expected = np.zeros((6, 11), dtype=np.bool_)
    for row, col in np.ndindex(6, 11):
        left, low = start[0] + col * point, start[1] + row * point
        for r, c in np.argwhere(cells):
            across = min(left + point, (c + 1) * resolution) - max(left, c * resolution)
            up = min(low + point, (r + 1) * resolution) - max(low, r * resolution)
            expected[row, col] |= across > 1e-6 and up > 1e-6
    assert found.dtype == np.bool_
    assert found.tolist() == expected.tolist()


@pytest.mark.parametrize(("row", "col"), [(0, 0), (0, 3), (2, 0), (2, 3), (1, 2)])
def test_one_cell_touches_its_own_points_alone(row: int, col: int) -> None:
    cells = np.zeros((3, 4), dtype=np.bool_)
    cells[row, col] = True
    assert touched_points(cells, 0.5, 0.5, (3, 4)).tolist() == cells.tolist()
    halves = touched_points(cells, 1.0, 0.5, (6, 8))
    assert np.argwhere(halves).tolist() == [[2 * row + i, 2 * col + j] for i in (0, 1) for j in (0, 1)]
    assert not touched_points(cells, 0.5, 0.5, (2, 2), (2.0, 1.5)).any()
