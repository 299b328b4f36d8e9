"""The first pair of bodies that overlap, against a look at every pair."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from worldsim.kernels.verdict import first_overlap


@pytest.mark.parametrize("seed", range(20))
def test_the_first_pair_is_the_one_that_a_look_at_every_pair_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places, radii = rng.uniform(0.0, 30.0, (40, 2)), rng.uniform(0.1, 1.5, 40)
    overlap = [
        (i, j)
        for i, j in itertools.combinations(range(40), 2)
        if math.dist(places[i], places[j]) < radii[i] + radii[j] - 1e-6
    ]
    assert first_overlap(places, radii, 1e-6) == min(overlap, default=(40, 40))


def test_bodies_that_touch_do_not_overlap_and_none_is_no_pair() -> None:
    radii = np.array([0.5, 0.5])
    assert first_overlap(np.array([[0.0, 0.0], [1.0, 0.0]]), radii, 0.0) == (2, 2)
    assert first_overlap(np.zeros((0, 2)), np.zeros(0), 0.0) == (0, 0)
