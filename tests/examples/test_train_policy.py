"""The example that trains a policy: its network is the weighted sum that it speaks of, and its scores repeat."""

import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.examples.test_mujoco import load_module

EXAMPLE = Path(__file__).parents[2] / "examples" / "train_policy.py"


@pytest.fixture(name="example", scope="module")
def load_example() -> ModuleType:
    return load_module("train_policy", EXAMPLE)


def test_each_direction_pulls_by_its_features_alike(example: ModuleType) -> None:
    numbers = np.array([1.0, -2.0, 0.5, 3.0, 0.25])
    features = np.random.default_rng(1).random((8, 5))
    pulls, angles = features @ numbers, [math.radians(45.0 * sector) for sector in range(8)]
    expected = [pulls @ [math.cos(angle) for angle in angles], pulls @ [math.sin(angle) for angle in angles]]
    np.testing.assert_allclose(example.network_of(numbers)(features.ravel()), expected)


def test_ages_repeat_and_the_stalest_place_is_older_than_the_mean(example: ModuleType) -> None:
    numbers = np.array(example.START)
    mean_age_s, mfow_s = example.ages_of(numbers, [3], 10.0)
    assert (mean_age_s, mfow_s) == example.ages_of(numbers, [3], 10.0)
    assert 0.0 < mean_age_s < mfow_s < 10.0
