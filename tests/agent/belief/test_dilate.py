"""Dilatation against a brute force that walks the window of every point."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.kernels.dilate import dilate

NOTHING = 2**31 - 1
NO_SCRATCH = np.zeros(0, dtype=np.uint16)


def window(passable: NDArray[np.bool_], row: int, col: int, reach: int) -> set[tuple[int, int]]:
    """The points reached in ``reach`` rounds of a step along the row and one along the column, odd rounds reversed."""
    places = {(row, col)}
    # A value travels to the point that reads it, so the last round comes first.
    for step in reversed(range(reach)):
        for axis in ((1, 0), (0, 1)) if step % 2 == 0 else ((0, 1), (1, 0)):
            beside = {(r + d * axis[0], c + d * axis[1]) for r, c in places for d in (-1, 0, 1)}
            places = {
                (r, c)
                for r, c in beside
                if 0 <= r < passable.shape[0] and 0 <= c < passable.shape[1] and passable[r, c]
            }
    return places


WALLS = st.sampled_from([0.0, 0.1, 0.35])


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), reach=st.integers(0, 5), walls=WALLS, boxed=st.booleans())
def test_each_point_takes_the_oldest_tick_of_its_window(seed: int, reach: int, walls: float, boxed: bool) -> None:
    rng = np.random.default_rng(seed)
    height, width = (int(v) for v in rng.integers(1, 14, 2))
    passable = rng.random((height, width)) >= walls
    source = passable & (rng.random((height, width)) < 0.8)
    tick = 300
    last_seen = rng.integers(-1, tick + 1, (height, width)).astype(np.int32)
    dilated = np.full((height, width), -5, dtype=np.int32)
    box = (0, height - 1, 0, width - 1)
    if boxed:
        rows, cols = np.sort(rng.integers(-3, height + 3, 2)), np.sort(rng.integers(-3, width + 3, 2))
        box = (int(rows[0]), int(rows[1]), int(cols[0]), int(cols[1]))
    dilate(last_seen, source.view(np.uint8), passable.view(np.uint8), dilated, *box, reach, tick, NO_SCRATCH)
    for r, c in np.ndindex(height, width):
        if not (box[0] <= r <= box[1] and box[2] <= c <= box[3]) or not passable[r, c]:
            assert dilated[r, c] == -5
            continue
        ticks = [max(int(last_seen[p]), 0) for p in window(passable, r, c, reach) if source[p]]
        assert dilated[r, c] == (min(ticks) if ticks else NOTHING)


@pytest.mark.parametrize("reach", [1, 3, 7])
def test_without_obstacles_the_window_is_the_papers_square(reach: int) -> None:
    passable = np.ones((40, 50), dtype=np.uint8)
    last_seen = np.full((40, 50), 90, dtype=np.int32)
    last_seen[20, 30] = 10
    dilated = np.empty_like(last_seen)
    dilate(last_seen, passable, passable, dilated, 0, 39, 0, 49, reach, 100, NO_SCRATCH)
    rows, cols = np.mgrid[0:40, 0:50]
    near = (abs(rows - 20) <= reach) & (abs(cols - 30) <= reach)
    assert np.array_equal(dilated, np.where(near, 10, 90))


def test_very_old_points_stay_the_oldest() -> None:
    passable = np.ones((3, 3), dtype=np.uint8)
    last_seen = np.array([[0, 70_000, 99_000]] * 3, dtype=np.int32)
    dilated = np.empty_like(last_seen)
    dilate(last_seen, passable, passable, dilated, 0, 2, 0, 2, 1, 100_000, NO_SCRATCH)
    assert (dilated[:, 0] == 100_000 - 65_534).all()
    assert (dilated[:, 2] == 70_000).all()


def test_a_window_wider_than_the_ground_reaches_all_that_is_connected() -> None:
    passable = np.ones((30, 200), dtype=np.bool_)
    passable[1:, 50::50] = False
    passable[:, 150] = False
    last_seen = np.full((30, 200), 90, dtype=np.int32)
    last_seen[29, 0] = 10
    dilated = np.full_like(last_seen, -5)
    grid = passable.view(np.uint8)
    dilate(last_seen, grid, grid, dilated, 0, 29, 0, 199, 10_000, 100, NO_SCRATCH)
    assert (dilated[passable & (np.arange(200) < 150)] == 10).all()
    assert (dilated[passable & (np.arange(200) > 150)] == 90).all()
