"""Nearness and approach of robots on open ground, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.intruders.on_run import nearness_and_approach
from patrol.ground.terrain import Terrain
from patrol.journal.records import Status


@pytest.mark.parametrize(("step", "ticks"), [(0.5, 2), (0.3, 3), (1.0, 1), (2.0, 1), (5.0, 1)])
def test_the_approach_is_that_of_the_last_second_or_tick(step: float, ticks: int) -> None:
    """Robots come from 39 m by 1, 2, 3, ... m in each tick; pixels of 0.5 m. One is dead, one out of the ground."""
    along = np.cumsum(np.arange(8))
    poses = np.full((8, 3, 3), 0.5)
    poses[:, 0, 0] = 0.5 + along
    poses[:, 2, 0] = -5.0
    terrain = Terrain("hall", np.ones((3, 40), dtype=np.bool_), 1.0)
    status = np.full((8, 3), Status.ALIVE)
    status[:, 1] = Status.DEAD
    run: Any = SimpleNamespace(
        prepared=SimpleNamespace(terrain=terrain), poses=poses, status=status, step=step, ticks=8
    )
    nearness, approach = nearness_and_approach(run, [(0, 39)], 0.5)
    away = 2.0 * (39.0 - along)
    expected = np.zeros(8)
    expected[ticks:] = (away[:-ticks] - away[ticks:]) / (ticks * step) / away[ticks:]
    assert nearness[:, 0] == pytest.approx(1.0 / away, rel=1e-5)
    assert approach[:, 0] == pytest.approx(expected, rel=1e-5)
