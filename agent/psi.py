"""Grids of psi (`agent.bodies.refine`) for a scenario: computed once when it is prepared, and mapped by its robots.

Preparing a scenario loads no mind for it.
"""

from __future__ import annotations

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
    from agent.bodies.refine import psi_field  # here: a process that maps the grids, or has none, needs no bodies

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
