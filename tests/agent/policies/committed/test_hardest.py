"""The kernels of commitment against plain loops over all points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.policies.committed.kernels.hardest import hardest, reaches
from agent.policies.committed.search import NO_RIVALS
from agent.routes.kernels.wave import SETTLED
from agent.routes.path_window import FAR

TICK = 40


class Situation:
    """A random window over a terrain that is one point smaller on each side, as the wave lays it."""

    def __init__(self, seed: int) -> None:
        dice = np.random.default_rng(seed)
        self.shape = int(dice.integers(3, 9)), int(dice.integers(3, 9))
        rows, cols = self.shape
        self.state = np.zeros((rows + 2, cols + 2), dtype=np.uint8)
        self.state[1:-1, 1:-1] = dice.choice([0, 1, 2, 3, 7], self.shape, p=[0.1, 0.1, 0.1, 0.35, 0.35])
        self.length = dice.integers(0, 2000, self.state.shape).astype(np.int32)
        self.rival = np.where(dice.random(self.state.shape) < 0.4, FAR, dice.integers(0, 2000, self.state.shape))
        self.rival = self.rival.astype(np.int32)
        rivals = bool(dice.random() < 0.8)
        self.rival = self.rival if rivals else np.full_like(self.rival, FAR)
        self.known = self.rival if rivals else NO_RIVALS
        ends = [np.sort(dice.choice(size + 3, 2, replace=False)) for size in self.shape]
        (top, bottom), (left, right) = (map(int, pair) for pair in ends)
        self.part = top, bottom, left, right
        self.seen = dice.integers(-1, TICK + 3, self.shape).astype(np.int32)
        self.looked = np.maximum(self.seen, np.where(dice.random(self.shape) < 0.2, TICK, -1)).astype(np.int32)
        self.pull = np.log(np.arange(TICK + 1).clip(1) / TICK) * dice.uniform(0.5, 3.0)
        self.decay = -np.arange(2001) * dice.uniform(1e-4, 1e-2)
        self.width = float(dice.choice([0.0, 30.0]))
        self.least = int(dice.choice([1, 1, TICK // 2]))
        self.hand_over = int(dice.choice([200, FAR]))
        count = int(dice.integers(0, 5))
        points, posts = (np.stack([dice.integers(0, n, count) for n in self.shape], axis=1) for _ in range(2))
        self.posts = np.concatenate([points, posts], axis=1).astype(np.int32).reshape(-1, 4)
        shunned = [(*(int(dice.integers(0, n)) for n in self.shape), int(dice.integers(0, 4))) for _ in range(2)]
        self.shunned = np.array(shunned[: int(dice.integers(0, 3))], dtype=np.int64).reshape(-1, 3)
        self.circle = (int(dice.integers(0, rows)), int(dice.integers(0, cols)), int(dice.choice([-1, 0, 5])))

    def forces(self) -> dict[tuple[int, int, int, int], float]:
        """The logarithm of the force of every point that counts, by (row, col, row to stand on, col to stand on)."""
        rows, cols = self.shape
        pairs = [(row, col, row, col) for row in range(rows) for col in range(cols)]
        pairs += [(int(a), int(b), int(c), int(d)) for a, b, c, d in self.posts]
        return {pair: force for pair in pairs if (force := self.force(*pair)) is not None}

    def force(self, row: int, col: int, stand_row: int, stand_col: int) -> float | None:
        at = stand_row + 1, stand_col + 1
        when = max(int(self.seen[row, col]), 0)
        if self.state[at] & 3 != SETTLED or TICK - when < self.least or self.looked[row, col] >= TICK:
            return None
        far = max(int(self.length[at]), 1)
        if not self.within[at]:
            return None
        behind = far - int(self.rival[at])
        if behind > self.hand_over:
            return None
        if any((stand_row - r) ** 2 + (stand_col - c) ** 2 <= squared for r, c, squared in self.shunned):
            return None
        r, c, squared = self.circle
        if (stand_row - r) ** 2 + (stand_col - c) ** 2 <= squared:
            return None
        share = 0.0
        if self.width > 0.0:
            share = float(np.logaddexp(0.0, behind / self.width))
        return float(self.pull[TICK - when] + self.decay[far] - share)

    @property
    def within(self) -> NDArray[np.bool_]:
        """The elements of the part that is searched."""
        top, bottom, left, right = self.part
        inside = np.zeros(self.state.shape, dtype=np.bool_)
        inside[top:bottom, left:right] = True
        return inside

    def found(self) -> tuple[float, tuple[int, ...]]:
        best, place = np.array([-np.inf]), np.zeros(4, dtype=np.int64)
        for points in (None, self.posts):
            grids = self.state, self.length, -1, -1, *self.part, self.seen, self.looked
            what = self.shunned, *self.circle
            law = TICK, self.least, self.pull, self.decay, self.known, self.width, self.hand_over
            hardest(points, *grids, *law, *what, best, place)
        return float(best[0]), tuple(int(number) for number in place)


@settings(max_examples=300)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_hardest_point_is_the_one_that_plain_loops_find(seed: int) -> None:
    situation = Situation(seed)
    forces = situation.forces()
    best, place = situation.found()
    if not forces:
        assert best == -math.inf
        return
    assert best == pytest.approx(max(forces.values()), abs=1e-9)
    assert len(place) == 4
    row, col, stand_row, stand_col = place
    assert forces[row, col, stand_row, stand_col] == pytest.approx(best, abs=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_longest_ways_are_that_of_all_that_of_the_claimed_ground_and_that_of_what_is_not_handed_over(
    seed: int,
) -> None:
    situation = Situation(seed)
    settled = situation.within & (situation.state & 3 == SETTLED)
    own = settled & (situation.length <= situation.rival)
    kept = settled & (situation.length.astype(np.int64) - situation.rival <= situation.hand_over)
    longest = np.full(3, -1, dtype=np.int64)
    grids = situation.state, situation.length, situation.known
    reaches(*grids, situation.hand_over, *situation.part, longest)
    assert longest.tolist() == [situation.length[points].max(initial=0) for points in (settled, own, kept)]
