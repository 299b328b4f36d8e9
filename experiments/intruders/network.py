"""The small neural network of the learned intruder, many of them at once, with gradients by hand.

A network looks at a window of the last `WINDOW` seconds, three features for each place, and says how likely each place
is to stay unseen for the whole of an attack (arXiv 2509.11971):

    features (3) -> dense, 6, leaky ReLU -> dense, 1        the same for each place and second of the window
    -> dense, 1                                             over the seconds of the window, the same for each place
    -> dense, V, sigmoid                                    over the V places

The fourth layer has an L1 penalty. One step of Adam at a time is made on the binary cross-entropy, in which places that
do stay unseen have a weight of their own. The second layer has no activation, so it and the third are one product.

The paper's description leaves open: the slope of the leaky ReLU (0.3, as in Keras), the first weights (Glorot's uniform
ones, biases 0) and that the penalty holds for the biases as well (its divisor V^2 + V counts them).

Products are those of the processor's BLAS: another processor may give other last digits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.elementary import exp
from patrol.random import Purpose, draw

WINDOW = 10
"""Seconds that a network looks at."""

FEATURES = 3
HIDDEN = 6
LEAK = 0.3
"""Slope of the leaky ReLU below 0."""

PENALTY = 0.1
"""L1 penalty of the last layer, divided by the number of its weights and biases."""

RATE = 1e-3
DECAY = 0.9
DECAY_OF_SQUARES = 0.999
LEAST_ROOT = 1e-7
"""Adam's constants, those of Keras."""

Floats = NDArray[np.floating]


def drawn_weights(seeds: Sequence[int], places: int) -> list[Floats]:
    """Draw the weights with which networks begin, float32, by layer: weights, biases, weights, biases, ...

    Shapes are (n, 6, 3), (n, 6), (n, 6), (n,), (n, 10), (n,), (n, V, V) and (n, V) for n seeds and V places.
    """
    weights: list[Floats] = []
    shapes = ((HIDDEN, FEATURES), (HIDDEN,), (WINDOW,), (places, places))
    fans = (HIDDEN + FEATURES, HIDDEN + 1, WINDOW + 1, 2 * places)
    biases = ((HIDDEN,), (), (), (places,))
    for layer, (shape, fan, bias) in enumerate(zip(shapes, fans, biases, strict=True)):
        limit = math.sqrt(6.0 / fan)
        size = math.prod(shape)
        drawn = [[draw(seed, Purpose.INTRUDER, layer, entry) for entry in range(size)] for seed in seeds]
        uniform = limit * (2.0 * np.array(drawn) - 1.0)
        weights += [
            uniform.reshape(len(seeds), *shape).astype(np.float32),
            np.zeros((len(seeds), *bias), dtype=np.float32),
        ]
    return weights


class Networks:
    """Networks that are trained side by side, each on its own windows.

    Windows are arrays (n, 3, 10, b, V): for each of n networks the features of b windows, by second and place.
    """

    def __init__(self, weights: Sequence[Floats]) -> None:
        """Start with weights as of `drawn_weights`, float32 or float64, which `train` changes in place."""
        self.weights = list(weights)
        self._means = [np.zeros_like(weight) for weight in weights]
        self._squares = [np.zeros_like(weight) for weight in weights]
        self._scratch: dict[tuple[int, ...], tuple[Floats, Floats]] = {}
        self._trained = 0

    def outputs(self, windows: Floats) -> Floats:
        """Return how likely each place is to stay unseen, (n, b, V)."""
        return self._last_layer(self._merged_output(windows, self._hidden_values(windows)))

    def gradients(self, windows: Floats, unseen: NDArray[np.bool_], weight: Floats) -> list[Floats]:
        """Return the gradients of the loss, the mean weighted cross-entropy plus the penalty, in the weights' order.

        `unseen` (n, b, V) says whether each place did stay unseen, and `weight` (n,) how much those count that did.
        """
        _, _, second, second_bias, steps, _, last, last_bias = self.weights
        n, _, _, b, places = windows.shape
        hidden = self._hidden_values(windows)
        merged = self._merged_output(windows, hidden)
        likely = self._last_layer(merged)
        error = np.where(unseen, weight[:, None, None] * (likely - 1.0), likely) * likely.dtype.type(1.0 / (b * places))
        penalty = last.dtype.type(PENALTY / (places * places + places))
        last_gradient = np.swapaxes(merged, 1, 2) @ error
        last_gradient += penalty * np.sign(last)
        last_bias_gradient = error.sum(axis=1) + penalty * np.sign(last_bias)
        into = (error @ np.swapaxes(last, 1, 2)).reshape(n, 1, b * places)
        total = into.sum(axis=(1, 2))
        by_hidden = (hidden @ np.swapaxes(into, 1, 2)).reshape(n, HIDDEN, WINDOW)
        mixed = _layer_product(second, steps).reshape(n, HIDDEN * WINDOW, 1)
        _, slope = self._reuse_buffers(hidden.shape)
        np.sign(hidden, out=slope)
        slope *= 0.5 - 0.5 * LEAK
        slope += 0.5 + 0.5 * LEAK
        slope *= into
        slope *= mixed
        slope = slope.reshape(n, HIDDEN, -1)
        return [
            slope @ np.swapaxes(windows.reshape(n, FEATURES, -1), 1, 2),
            slope.sum(axis=2),
            (by_hidden * steps[:, None, :]).sum(axis=2),
            total * steps.sum(axis=1),
            (by_hidden * second[:, :, None]).sum(axis=1) + (second_bias * total)[:, None],
            total,
            last_gradient,
            last_bias_gradient,
        ]

    def train(self, windows: Floats, unseen: NDArray[np.bool_], weight: Floats) -> None:
        """Make one step of Adam; see `gradients`."""
        self._trained += 1
        rate = RATE * math.sqrt(1.0 - DECAY_OF_SQUARES**self._trained) / (1.0 - DECAY**self._trained)
        gradients = self.gradients(windows, unseen, weight)
        for layer, mean, square, gradient in zip(self.weights, self._means, self._squares, gradients, strict=True):
            part, root = self._reuse_buffers(layer.shape)
            np.multiply(mean, DECAY, out=mean)
            np.add(mean, np.multiply(gradient, 1.0 - DECAY, out=part), out=mean)
            np.multiply(square, DECAY_OF_SQUARES, out=square)
            np.multiply(gradient, gradient, out=part)
            np.add(square, np.multiply(part, 1.0 - DECAY_OF_SQUARES, out=part), out=square)
            np.add(np.sqrt(square, out=root), LEAST_ROOT, out=root)
            np.divide(np.multiply(mean, rate, out=part), root, out=part)
            np.subtract(layer, part, out=layer)

    def _reuse_buffers(self, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
        """Return two arrays that the next caller overwrites: new ones each time cost more than the arithmetic."""
        if shape not in self._scratch:
            self._scratch[shape] = np.empty(shape, self.weights[0].dtype), np.empty(shape, self.weights[0].dtype)
        return self._scratch[shape]

    def _hidden_values(self, windows: Floats) -> Floats:
        """Return the first layer's six values by value and second of the window, (n, 60, b V)."""
        first, first_bias = self.weights[:2]
        n, _, _, b, places = windows.shape
        shape = (n, HIDDEN * WINDOW, b * places)
        buffer, part = (array.reshape(n, HIDDEN, -1) for array in self._reuse_buffers(shape))
        np.matmul(first, windows.reshape(n, FEATURES, -1), out=part)
        part += first_bias[:, :, None]
        np.multiply(part, LEAK, out=buffer)
        return np.maximum(part, buffer, out=buffer).reshape(shape)

    def _merged_output(self, windows: Floats, hidden: Floats) -> Floats:
        """Return the third layer's output, (n, b, V)."""
        _, _, second, second_bias, steps, steps_bias, _, _ = self.weights
        n, _, _, b, places = windows.shape
        merged = _layer_product(second, steps).reshape(n, 1, HIDDEN * WINDOW) @ hidden
        merged += (second_bias * steps.sum(axis=1) + steps_bias)[:, None, None]
        return merged.reshape(n, b, places)

    def _last_layer(self, merged: Floats) -> Floats:
        last, last_bias = self.weights[6:]
        return (1.0 / (1.0 + exp(-(merged @ last + last_bias[:, None, :])))).astype(merged.dtype)


def _layer_product(second: Floats, steps: Floats) -> Floats:
    """Return the product of the second and the third layer, (n, 6, 10)."""
    return second[:, :, None] * steps[:, None, :]
