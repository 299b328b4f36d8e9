"""The fog: the histogram against the plain maximum, and what an observation takes away."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol.ground.fog import NEVER, Fog
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
    age = np.zeros(shape, dtype=np.int64)
    seen = np.zeros(shape, dtype=np.bool_)
    for tick in range(ticks):
        if tick:
            age += 1
        observed: set[tuple[int, int]] = set()
        for _ in range(int(rng.integers(0, 3))):
            side = int(rng.integers(1, 8))
            row0, col0 = (int(v) for v in rng.integers(-5, 12, 2))
            mask = rng.random((side, side)) < 0.6
            quality = np.ascontiguousarray(rng.random((side, side))) if partial else None
            box = fog.observe(view_of(row0, col0, mask, quality), tick)
            changed = []
            for i, j in np.argwhere(mask):
                r, c = row0 + int(i), col0 + int(j)
                if not (0 <= r < shape[0] and 0 <= c < shape[1] and patrolled[r, c]):
                    continue
                left = 0 if quality is None else int(age[r, c] * (1.0 - quality[i, j]))
                if left < age[r, c] or not seen[r, c]:
                    changed.append((r, c))
                    age[r, c] = left
                    seen[r, c] = True
            assert (box is not None) == bool(changed)
            if box is not None:
                rows, cols = zip(*changed, strict=True)
                assert box == (min(rows), max(rows), min(cols), max(cols))
            observed.update(changed)
        assert fog.mfow(tick) == age[patrolled].max()
        assert abs(fog.mean(tick) - age[patrolled].mean()) < 1e-9
        assert np.array_equal(fog.age(tick)[patrolled], age[patrolled])
        assert fog.seen == np.count_nonzero(seen)


def test_what_nobody_saw_has_aged_since_the_beginning() -> None:
    fog = Fog(np.ones((3, 4), dtype=np.bool_))
    assert fog.mfow(0) == 0
    assert fog.mfow(17) == 17
    assert fog.seen == 0
    assert (fog.last_seen == NEVER).all()
    fog.observe(view_of(0, 0, np.ones((3, 3))), 20)
    assert fog.mfow(25) == 25
    assert fog.seen == 9
    fog.observe(view_of(0, 3, np.ones((3, 1))), 30)
    assert fog.mfow(30) == 10


def test_points_outside_the_patrolled_area_do_not_count() -> None:
    patrolled = np.zeros((4, 4), dtype=np.bool_)
    patrolled[1, 1] = True
    fog = Fog(patrolled)
    assert fog.observe(view_of(0, 0, np.ones((1, 4))), 5) is None
    assert fog.mfow(5) == 5
    assert fog.observe(view_of(0, 0, np.ones((4, 4))), 6) == (1, 1, 1, 1)
    assert fog.mfow(6) == 0


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
