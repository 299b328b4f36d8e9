import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from patrol.ground.cspace import clearance_levels, cspace_of, narrow_passages, parts_of
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


@pytest.mark.parametrize("shape", [(9, 40), (40, 9), (1, 7), (12, 12)])
@pytest.mark.parametrize("cap", [1, 3, 100])
def test_clearance_is_the_distance_to_the_nearest_blocked_square_or_the_edge(shape: tuple[int, int], cap: int) -> None:
    """In half points, squared; beyond `cap` whole points it is not told apart."""
    free = np.ones(shape, dtype=np.bool_)
    free[0, shape[1] // 3] = False
    found = clearance_levels(free, cap)
    padded = np.pad(free, 1)
    blocked = np.argwhere(~padded)
    for row, col in np.ndindex(shape):
        if not free[row, col]:
            assert found[row, col] == 0
            continue
        apart = np.maximum(2 * np.abs(blocked - [row + 1, col + 1]) - 1, 0)
        nearest = int((apart**2).sum(axis=1).min())
        assert found[row, col] == min(nearest, (2 * cap - 1) ** 2)


@pytest.mark.parametrize(("width_m", "found"), [(2.5, False), (2.6, True)])
@pytest.mark.parametrize("turned", [False, True])
def test_a_passage_is_critical_where_it_is_narrower_than_the_width(width_m: float, found: bool, turned: bool) -> None:
    """Two halls and a passage of six points of 0.5 m: a disc around a point in its middle has 1.25 m to one side."""
    free = np.zeros((12, 30), dtype=np.bool_)
    free[:, :12] = free[:, 18:] = free[3:9, 12:18] = True
    terrain = Terrain("halls", free.T if turned else free, 0.5)
    passages = narrow_passages(terrain, terrain.free, width_m)
    assert len(passages) == found
    for passage in passages:
        inside = passage.T if turned else passage
        assert inside[3:9, 14:16].all()
        assert not inside[:, :10].any()


def test_a_small_narrow_part_is_no_passage() -> None:
    """A gap of 0.5 x 1.5 m between two halls is below a square metre, and one of 0.5 x 2.5 m is not."""
    for long, count in ((3, 0), (5, 1)):
        free = np.zeros((12, 24 + long), dtype=np.bool_)
        free[:, :12] = free[:, 12 + long :] = free[6, 12 : 12 + long] = True
        terrain = Terrain("halls", free, 0.5)
        assert len(narrow_passages(terrain, terrain.free, 1.2)) == count
