"""The ground: what blocks it just now, and where a body joins it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.kernels.wave import HEMMED, OPEN, STATUS
from agent.routes.ground import Area, Disc, Ground
from patrol.ground.terrain import Terrain
from tests.present import present


def fresh(is_open: np.ndarray, discs: list[Disc]) -> np.ndarray:
    """The state of a grid with discs cut out, worked out from nothing."""
    rows, cols = np.mgrid[0 : is_open.shape[0], 0 : is_open.shape[1]] + 0.5
    left = is_open.copy()
    for x, y, radius in discs:
        left &= (rows - y / 0.5) ** 2 + (cols - x / 0.5) ** 2 >= (radius / 0.5) ** 2
    framed = np.pad(left, 2)
    state = np.zeros((left.shape[0] + 2, left.shape[1] + 2), dtype=np.uint8)
    for r, c in np.argwhere(left):
        around = framed[r + 1 : r + 4, c + 1 : c + 4]
        state[r + 1, c + 1] = OPEN if around.all() else OPEN | HEMMED
    return state


discs = st.lists(st.tuples(st.floats(-2, 14), st.floats(-2, 12), st.floats(0, 4)), max_size=3)


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), turns=st.lists(discs, min_size=1, max_size=4))
def test_obstacles_come_and_go_without_a_trace(seed: int, turns: list[list[Disc]]) -> None:
    is_open = np.random.default_rng(seed).random((20, 24)) < 0.85
    ground = Ground(Terrain("t", is_open, 0.5), is_open)
    for turn in [*turns, []]:
        ground.begin(turn)
        assert np.array_equal(ground.state, fresh(is_open, turn))


def test_a_body_joins_at_its_own_point_or_one_beside_it() -> None:
    is_open = np.ones((20, 20), dtype=np.bool_)
    is_open[:, 10:] = False
    ground = Ground(Terrain("t", np.ones((20, 20), dtype=np.bool_), 0.5), is_open)
    assert ground.join(2.3, 4.1) == (9, 5)
    assert ground.join(5.1, 4.1) == (9, 10)
    assert ground.join(9.0, 4.1) is None
    assert ground.join(-50.0, 4.1) is None
    row, col = 9, 5
    assert ground.state[row, col] & STATUS == OPEN
    assert ground.centre(row, col) == (2.25, 4.25)


def test_no_body_joins_through_a_wall() -> None:
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[:, 10] = False
    is_open = passable.copy()
    is_open[:, 9:] = False
    is_open[:, 12:] = True
    ground = Ground(Terrain("t", passable, 0.5), is_open)
    joined = present(ground.join(4.75, 4.1))
    assert joined[1] <= 10


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), turns=st.lists(st.tuples(discs, discs), min_size=1, max_size=3))
def test_what_a_policy_closes_is_closed_for_its_tick(seed: int, turns: list[tuple[list[Disc], list[Disc]]]) -> None:
    rng = np.random.default_rng(seed)
    is_open = rng.random((20, 24)) < 0.85
    part = rng.random((20, 24)) < 0.1
    ground = Ground(Terrain("t", is_open, 0.5), is_open)
    for in_the_way, closed in turns:
        ground.begin(in_the_way)
        if closed:
            assert np.array_equal(ground.state, fresh(is_open, in_the_way))
        ground.close(closed)
        ground.close(areas=[Area(part)])
        assert np.array_equal(ground.state, fresh(is_open & ~part, [*in_the_way, *closed]))
        assert np.array_equal(ground.open_now, ground.state[1:-1, 1:-1] & STATUS == OPEN)
        assert np.array_equal(ground.static.state, fresh(is_open, []))
    ground.begin([])
    assert np.array_equal(ground.state, fresh(is_open, []))
    assert ground.static is ground


def test_what_is_open_now_is_read_only() -> None:
    is_open = np.ones((20, 24), dtype=np.bool_)
    ground = Ground(Terrain("t", is_open, 0.5), is_open)
    with pytest.raises(ValueError, match="read-only"):
        ground.open_now[0, 0] = False
    ground.begin([(3.0, 3.0, 1.0)])
    assert np.array_equal(ground.state, fresh(is_open, [(3.0, 3.0, 1.0)]))


@pytest.mark.parametrize("disc", [(math.nan, 1.0, 1.0), (1.0, math.inf, 1.0), (1.0, 1.0, -math.inf)])
def test_a_disc_that_is_nowhere_is_refused_at_once_and_closes_nothing(disc: Disc) -> None:
    is_open = np.ones((20, 24), dtype=np.bool_)
    ground = Ground(Terrain("t", is_open, 0.5), is_open)
    with pytest.raises(ValueError, match="not finite"):
        ground.close([(3.0, 3.0, 1.0), disc])
    assert np.array_equal(ground.state, fresh(is_open, []))


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), share=st.sampled_from([0.0, 0.02, 0.5]))
def test_an_area_is_closed_as_a_whole(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    is_open, part = rng.random((20, 24)) < 0.85, rng.random((20, 24)) < share
    area = Area(part)
    top, bottom, left, right = area.box
    assert area.mask.shape == (bottom - top, right - left)
    assert area.mask.sum() == part.sum()
    ground = Ground(Terrain("t", is_open, 0.5), is_open)
    ground.close(areas=[area])
    assert np.array_equal(ground.state, fresh(is_open & ~part, []))


def test_several_bodies_join_the_ground_as_each_of_them_does() -> None:
    dice = np.random.default_rng(2)
    is_open = dice.random((20, 30)) < 0.7
    terrain = Terrain("t", np.ones((20, 30), dtype=np.bool_), 0.5, (-3.0, 2.0))
    base = Ground(terrain, is_open)
    places = dice.uniform((-6.0, 0.0), (15.0, 14.0), (200, 2))
    for ground in (base, base.over()):
        for discs in ([], [(1.0, 5.0, 2.0)], []):
            ground.close(discs) if discs else ground.begin([])
            each = [ground.join(x, y) for x, y in places.tolist()]
            joined = [element for element in each if element is not None]
            assert 50 < len(joined) < 200
            assert ground.join_each(places).tolist() == [list(element) for element in joined]
    assert base.join_each(np.zeros((0, 2))).shape == (0, 2)


def test_what_a_place_joins_is_looked_up_anew_when_something_closes() -> None:
    terrain = Terrain("t", np.ones((9, 9), dtype=np.bool_), 1.0)
    ground = Ground(terrain, terrain.passable)
    assert ground.join(4.5, 4.5) == (5, 5)
    ground.close([(4.5, 4.5, 0.4)])
    assert ground.join(4.5, 4.5) not in (None, (5, 5))
    ground.begin([])
    assert ground.join(4.5, 4.5) == (5, 5)


def test_grounds_over_each_other_each_have_what_they_close() -> None:
    is_open = np.random.default_rng(3).random((20, 24)) < 0.9
    part = np.zeros_like(is_open)
    part[4:9, 3:7] = True
    base = Ground(Terrain("t", is_open, 0.5), is_open)
    one, other = base.over([(3.0, 3.0, 1.5)]), base.over()
    other.close([(8.0, 6.0, 2.0)], [Area(part)])
    above = other.over([(2.0, 8.0, 1.0)])
    for _ in range(2):
        assert np.array_equal(one.state, fresh(is_open, [(3.0, 3.0, 1.5)]))
        assert np.array_equal(other.state, fresh(is_open & ~part, [(8.0, 6.0, 2.0)]))
        assert np.array_equal(above.state, fresh(is_open & ~part, [(8.0, 6.0, 2.0), (2.0, 8.0, 1.0)]))
        assert np.array_equal(above.static.state, fresh(is_open, []))
        assert np.array_equal(base.state, fresh(is_open, []))
    above.begin([])
    assert np.array_equal(above.state, other.state)


def test_an_area_that_does_not_fit_spoils_no_ground_of_another_robot() -> None:
    is_open = np.ones((20, 24), dtype=np.bool_)
    base = Ground(Terrain("t", is_open, 0.5), is_open)
    one, other, wide = base.over(), base.over([(3.0, 3.0, 1.5)]), Area(np.ones((30, 40), dtype=np.bool_))
    one.close([(6.0, 5.0, 2.0)], [wide])
    for _ in range(2):
        with pytest.raises(ValueError, match="broadcast"):
            _ = one.state
        assert np.array_equal(other.state, fresh(is_open, [(3.0, 3.0, 1.5)]))
