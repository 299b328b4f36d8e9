from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.terrain import BoolGrid, Terrain
from tests.patrol.ground.masks import masks, random_map


@settings(max_examples=80)
@given(free=masks, radius=st.sampled_from([0.05, 0.1, 0.2, 0.25, 0.35, 0.5]), point=st.sampled_from([0.1, 0.2]))
def test_a_body_fits_where_no_square_or_edge_is_too_near(free: BoolGrid, radius: float, point: float) -> None:
    terrain = Terrain("field", free, point, (-2.0, 7.0))
    cspace = cspace_of(terrain, radius)
    walled = np.pad(free, 1)
    blocked = np.argwhere(~walled) - 1
    for (row, col), fits in np.ndenumerate(cspace):
        across = np.maximum(np.abs(blocked - [row, col]) - 0.5, 0.0) * point
        clearance = float(np.hypot(across[:, 0], across[:, 1]).min()) if free[row, col] else 0.0
        assert fits == (clearance >= radius + point / 2 - 1e-9)


def test_keep_out_blocks_bodies_as_walls_do() -> None:
    free = random_map(1)
    passable = np.ones_like(free)
    kept = Terrain("field", passable, 0.1, keep_out=~free)
    assert np.array_equal(cspace_of(kept, 0.2), cspace_of(Terrain("field", free, 0.1), 0.2))


@settings(max_examples=60)
@given(mask=masks)
def test_parts_are_those_without_corner_cutting(mask: BoolGrid) -> None:
    labels, count = parts_of(mask)
    expected, expected_count = ndimage.label(mask)
    assert count == expected_count
    assert np.array_equal(labels, expected)
