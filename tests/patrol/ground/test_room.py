"""Room: how many rows or columns there are between each point and the nearest obstacle."""

import numpy as np
import pytest

from patrol.ground.terrain import Terrain

# Not the product's own, so that a wrong one there is noticed.
MOST_ROOM = 255


def counted(blocked: np.ndarray) -> np.ndarray:
    """The same, one ring of points after the other."""
    room = np.zeros(blocked.shape, dtype=np.int64)
    far = np.pad(blocked == 0, 1)
    while far.any():
        room += far[1:-1, 1:-1]
        shifted = [np.roll(far, (up, across), (0, 1)) for up in (-1, 0, 1) for across in (-1, 0, 1)]
        far = np.logical_and.reduce(shifted)
    return np.minimum(room, MOST_ROOM)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 30), (31, 40)])
def test_room_counts_rows_or_columns_to_the_nearest_obstacle_or_the_edge(shape: tuple[int, int], seed: int) -> None:
    dice = np.random.default_rng(seed)
    terrain = Terrain("some", dice.random(shape) > 0.03 * seed, 0.1)
    np.testing.assert_array_equal(terrain.room, counted(terrain.blocked))


def test_it_ends_at_the_largest_number_that_fits() -> None:
    terrain = Terrain("wide", np.ones((2 * MOST_ROOM + 9, 2 * MOST_ROOM + 9), dtype=np.bool_), 0.1)
    assert terrain.room.max() == MOST_ROOM
    assert terrain.room[MOST_ROOM - 1, MOST_ROOM + 4] == MOST_ROOM
    assert terrain.room[MOST_ROOM - 2, MOST_ROOM + 4] == MOST_ROOM - 1
    assert not terrain.room.flags.writeable
