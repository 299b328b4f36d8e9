import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol.ground.fog import NEVER, Fog, Looks
from patrol.ground.footprint import View


def view_of(row0: int, col0: int, mask: np.ndarray, quality: np.ndarray | None = None) -> View:
    return View(row0, col0, mask.astype(np.uint8), quality)


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), partial=st.booleans(), ticks=st.integers(1, 40))
def test_mfow_and_mean_equal_the_plain_maximum_and_mean(seed: int, partial: bool, ticks: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 12, 2))
    patrolled = rng.random(shape) < 0.7
    patrolled.flat[0] = True
    fog = Fog(patrolled)
    assert (fog.last_seen == NEVER).all()
    age = np.zeros(shape, dtype=np.int64)
    seen = np.zeros(shape, dtype=np.bool_)
    for tick in range(ticks):
        if tick:
            age += 1
        for _ in range(int(rng.integers(0, 3))):
            side = int(rng.integers(1, 8))
            row0, col0 = (int(v) for v in rng.integers(-5, 12, 2))
            mask = rng.random((side, side)) < 0.6
            quality = np.ascontiguousarray(rng.random((side, side))) if partial else None
            view = view_of(row0, col0, mask, quality)
            fog.observe(view, tick)
            box = view.box(fog.last_seen.shape)
            for i, j in np.argwhere(mask):
                r, c = row0 + int(i), col0 + int(j)
                if not (0 <= r < shape[0] and 0 <= c < shape[1] and patrolled[r, c]):
                    continue
                left = 0 if quality is None else int(age[r, c] * (1.0 - quality[i, j]))
                if left < age[r, c] or not seen[r, c]:
                    assert box is not None
                    assert box[0] <= r <= box[1]
                    assert box[2] <= c <= box[3]
                    age[r, c] = left
                    seen[r, c] = True
        assert fog.mfow(tick) == age[patrolled].max()
        assert abs(fog.mean(tick) - age[patrolled].mean()) < 1e-9
        assert np.array_equal(fog.age(tick)[patrolled], age[patrolled])
        assert fog.seen == np.count_nonzero(seen)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 6))
def test_many_looks_at_once_do_what_each_by_itself_does(seed: int, number: int) -> None:
    """Of one tick and of earlier ones; those that were not chosen do nothing."""
    rng = np.random.default_rng(seed)
    patrolled = rng.random((8, 11)) < 0.7
    patrolled[0, 0] = True
    whole, single = Fog(patrolled), Fog(patrolled)
    for tick in range(4, 12):
        views = [view_of(row, col, rng.random((5, 5)) < 0.6) for row, col in rng.integers(-4, 12, (number, 2)).tolist()]
        looks = [(tick - int(rng.integers(0, 4)), view) for view in views]
        chosen = (rng.random(number) < 0.7).astype(np.uint8)
        whole.observe_each(Looks(looks), chosen)
        for (at, view), taken in zip(looks, chosen, strict=True):
            if taken:
                single.observe(view, at)
        assert np.array_equal(whole.last_seen, single.last_seen)
        assert (whole.mfow(tick), whole.mean(tick), whole.seen) == (single.mfow(tick), single.mean(tick), single.seen)


def test_after_years_the_mean_is_still_exact() -> None:
    """One look at a row of points gains more than fits into 32 bits."""
    fog = Fog(np.ones((2, 50), dtype=np.bool_))
    fog.observe(view_of(0, 0, np.ones((50, 50))), 2**29 - 1)
    assert fog.mean(2**29) == 1.0
    assert fog.seen == 100


def test_a_view_beside_the_terrain_has_no_box_and_shows_nothing() -> None:
    fog, view = Fog(np.ones((3, 4), dtype=np.bool_)), view_of(0, 9, np.ones((3, 3)))
    fog.observe(view, 5)
    assert view.box((3, 4)) is None
    assert fog.seen == 0


def test_a_run_may_be_longer_than_expected() -> None:
    fog = Fog(np.ones((1, 1), dtype=np.bool_))
    for tick in (3, 5000, 5001, 100_000):
        fog.observe(view_of(0, 0, np.ones((1, 1))), tick)
        assert fog.mfow(tick + 7) == 7


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), ticks=st.integers(1, 30))
def test_the_stalest_point_is_one_of_the_oldest_and_stays_while_it_is(seed: int, ticks: int) -> None:
    rng = np.random.default_rng(seed)
    patrolled = rng.random((6, 9)) < 0.7
    patrolled[2, 3] = True
    fog = Fog(patrolled)
    before = fog.stalest()
    for tick in range(ticks):
        fog.observe(view_of(int(rng.integers(-2, 5)), int(rng.integers(-2, 8)), rng.random((3, 3)) < 0.8), tick)
        oldest = int(fog.last_seen[patrolled].min())
        stalest = fog.stalest()
        assert patrolled[stalest]
        assert fog.last_seen[stalest] == oldest
        assert int(fog.age(tick)[stalest]) == fog.mfow(tick)
        assert stalest == before or not patrolled[before] or fog.last_seen[before] != oldest
        before = stalest


def test_what_a_fork_sees_leaves_the_fog_as_it_was() -> None:
    first, second = view_of(-2, 0, np.ones((3, 3))), view_of(1, 0, np.ones((3, 3)))
    fog = Fog(np.ones((2, 3), dtype=np.bool_))
    fog.observe(first, 2)
    fog.observe(second, 3)
    fork = fog.fork()
    fork.observe(first, 7)
    assert (fork.mfow(9), fork.mean(9)) == (6, 4.0)
    assert (fog.mfow(9), fog.mean(9)) == (7, 6.5)
