"""Points at and next to places, on a terrain whose sides differ."""

import numpy as np
import pytest

from patrol.ground.terrain import Terrain


@pytest.mark.parametrize("origin", [(0.0, 0.0), (-3.0, 7.0)])
def test_the_nearest_point_of_a_place_is_its_own_or_one_of_the_edge(origin: tuple[float, float]) -> None:
    terrain = Terrain("wide", np.ones((3, 8), dtype=np.bool_), 0.5, origin)
    for row in range(-2, 6):
        for col in range(-2, 11):
            x, y = terrain.centre(row, col)
            assert terrain.point_at(x, y) == (row, col)
            assert terrain.nearest_point(x, y) == (min(max(row, 0), 2), min(max(col, 0), 7))
