"""Psi, the proximity of obstacles (paper, "goal refinement"): grids made when a scenario is prepared; robots map them.

Preparing a scenario loads no mind for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario

Psi = Mapping[float, NDArray[np.float32]]
"""Grids of psi, float32 (h, w), by their reach in m; empty where no goals are refined."""


def psi_of(scenario: Scenario, terrain: Terrain) -> Psi:
    """Compute a scenario's grids of psi, one for each reach that its robots have."""
    return {reach: psi_field(terrain, reach) for reach in _psi_reaches(scenario)}


def save_psi(prepared: Prepared, folder: Path) -> None:
    """Write the fields that `load_psi` reads into an existing folder."""
    for number, psi in enumerate(psi_of(prepared.scenario, prepared.terrain).values(), start=1):
        np.save(folder / _psi_file(number), psi)


def load_psi(scenario: Scenario, folder: Path) -> Psi:
    """Map the fields that `save_psi` wrote for a scenario, read-only."""
    return {
        reach: np.load(folder / _psi_file(number), mmap_mode="r")
        for number, reach in enumerate(_psi_reaches(scenario), start=1)
    }


def _psi_reaches(scenario: Scenario) -> list[float]:
    """Return the reaches of the fields psi that a scenario's robots refine their goals by, m, ascending."""
    if scenario.patrol.avoidance != "goal-refinement":
        return []
    return sorted({lengths.refine_reach for lengths in scenario.lengths.values()})


def _psi_file(number: int) -> str:
    """Return the file name of the field with the number-th smallest reach, from 1 on."""
    return f"psi-{number}.npy"


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
