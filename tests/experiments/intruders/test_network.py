"""The gradients of the learned intruder's networks against finite differences of their loss, and Adam's steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.intruders.network import Floats, Networks, drawn_weights
from patrol.kernels.elementary import log10

# Not the product's own, so that a wrong one there is noticed.
DECAY_OF_SQUARES = 0.999
LEAST_ROOT = 1e-7
PENALTY = 0.1
RATE = 1e-3
WINDOW = 10

NETWORKS, WINDOWS, PLACES = 2, 3, 4


def example() -> tuple[list[Floats], Floats, NDArray[np.bool_], Floats]:
    """Weights (no bias is 0, where the penalty has a corner), windows, labels and the weights of positive ones."""
    dice = np.random.default_rng(5)
    drawn = drawn_weights(range(NETWORKS), PLACES)
    weights: list[Floats] = [weight + 0.1 + 0.1 * dice.random(weight.shape) for weight in drawn]
    windows = dice.normal(size=(NETWORKS, 3, WINDOW, WINDOWS, PLACES))
    return weights, windows, dice.random((NETWORKS, WINDOWS, PLACES)) < 0.4, np.array([1.0, 3.5])


def losses(weights: list[Floats], windows: Floats, unseen: NDArray[np.bool_], weight: Floats) -> Floats:
    likely = Networks(weights).outputs(windows)
    entropy = np.where(unseen, -weight[:, None, None] * log10(likely), -log10(1.0 - likely)) * math.log(10.0)
    last, last_bias = weights[6:]
    size = np.abs(last).sum(axis=(1, 2)) + np.abs(last_bias).sum(axis=1)
    return np.asarray(entropy.mean(axis=(1, 2)) + PENALTY / (PLACES**2 + PLACES) * size)


def test_the_gradients_are_those_of_finite_differences() -> None:
    weights, windows, unseen, weight = example()
    gradients = Networks(weights).gradients(windows, unseen, weight)
    assert [gradient.shape for gradient in gradients] == [own.shape for own in weights]
    small = 1e-6
    for own, gradient in zip(weights, gradients, strict=True):
        for place in np.ndindex(own.shape):
            before = own[place]
            own[place] = before + small
            more = losses(weights, windows, unseen, weight)
            own[place] = before - small
            less = losses(weights, windows, unseen, weight)
            own[place] = before
            differences = (more - less) / (2.0 * small)
            # A network's weights change the loss of no other one.
            assert differences[1 - place[0]] == 0.0
            assert gradient[place] == pytest.approx(differences[place[0]], abs=1e-8)


def test_the_first_step_of_adam_is_the_learning_rate_against_the_gradient() -> None:
    weights, windows, unseen, weight = example()
    networks = Networks([own.copy() for own in weights])
    gradients = networks.gradients(windows, unseen, weight)
    networks.train(windows, unseen, weight)
    for own, before, gradient in zip(networks.weights, weights, gradients, strict=True):
        step = RATE * gradient / (np.abs(gradient) + LEAST_ROOT / np.sqrt(1.0 - DECAY_OF_SQUARES))
        assert own == pytest.approx(before - step, abs=1e-12)


def test_training_lowers_the_loss() -> None:
    weights, windows, unseen, weight = example()
    networks = Networks([own.copy() for own in weights])
    for _ in range(300):
        networks.train(windows, unseen, weight)
    assert (losses(networks.weights, windows, unseen, weight) < losses(weights, windows, unseen, weight) - 0.1).all()


def test_the_first_weights_depend_on_the_seed_alone_and_are_small() -> None:
    both, second = drawn_weights([3, 4], PLACES), drawn_weights([4], PLACES)
    for pair, single in zip(both, second, strict=True):
        assert np.array_equal(pair[1:], single)
    assert (np.abs(both[0]) <= np.sqrt(6.0 / 9.0)).all()
    assert not np.array_equal(both[6][0], both[6][1])
    assert not both[7].any()
