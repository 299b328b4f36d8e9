"""Obstacle proximity and the goal that avoids it (paper, "goal refinement")."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain

ROUNDING = 1e-7
"""Psi is rounded to multiples of this, far below one obstacle's share at 100 points, so equal values stay equal."""


def psi_field(terrain: Terrain, reach_m: float) -> NDArray[np.float32]:
    """Return psi of every point, float32 (h, w): the sum of 1 / rho^2 over the obstacle points near it.

    This is the paper's "goal refinement"; rho is in points. Obstacle points less than `reach_m` away along x and along
    y count, and so do points beyond the terrain's edge, up to twice its longer side. Psi is infinity on obstacles.

    Computed for the whole terrain in one convolution, by Fourier transform.
    """
    reach = min(math.ceil(reach_m / terrain.point - 1e-9) - 1, 2 * max(terrain.shape))
    offsets = np.arange(-reach, reach + 1, dtype=np.float64)
    squared = offsets[:, None] ** 2 + offsets[None, :] ** 2
    squared[reach, reach] = math.inf
    weight = 1.0 / squared
    obstacles = np.pad(terrain.blocked.astype(np.float64), reach, constant_values=1.0)
    # Circular convolution spoils the first 2 * reach rows and columns, which the padding keeps free of our points.
    shape = [_round_up_size(size) for size in obstacles.shape]
    product = np.fft.rfft2(obstacles, shape) * np.fft.rfft2(weight, shape)
    full = np.fft.irfft2(product, shape)
    psi = full[2 * reach : 2 * reach + terrain.height, 2 * reach : 2 * reach + terrain.width]
    rounded = np.maximum(np.round(psi / ROUNDING) * ROUNDING, 0.0).astype(np.float32)
    rounded[terrain.blocked != 0] = math.inf
    return rounded


def _round_up_size(size: int) -> int:
    """Return the next size with no prime factor above 5, for which Fourier transforms are quick."""
    while True:
        remaining = size
        for prime in (2, 3, 5):
            while remaining % prime == 0:
                remaining //= prime
        if remaining == 1:
            return size
        size += 1
