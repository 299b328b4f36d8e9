"""Nearness of robots to places in each tick of a run, and their approach: features of the learned intruder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from monitor.replay.run import Run
from patrol.ground.kernels.ways import FAR
from patrol.ground.terrain import ALL_WAYS
from patrol.ground.ways import lengths_along
from patrol.journal.records import Status

Features = NDArray[np.float32]


def nearness_and_approach(run: Run, places: Sequence[tuple[int, int]], pixel: float) -> tuple[Features, Features]:
    """Return the robots' nearness and approach to places, float32 (ticks, places) each.

    Distances are ways over free ground in units of `pixel` (m), and at least 1. Nearness is the sum over robots of 1 /
    distance, in 1 / px. Approach is that of the speed towards the place over the last second / distance, in 1 / s. For
    example, with pixels of 0.075 m, a robot 1.5 m (20 px) from a place that drives there at 1 m/s (13.3 px/s) has
    nearness 0.05 and approach 0.67.

    Places are row and column. Without a way to a place, or off the terrain, both features are 0.
    """
    terrain = run.prepared.terrain
    cells = np.floor((run.poses[:, :, :2] - terrain.origin) / terrain.point)
    cells = np.clip(np.nan_to_num(cells), -1, [terrain.width, terrain.height]).astype(np.int64) + 1
    alive = run.status == Status.ALIVE
    stride = max(round(1.0 / run.step), 1)
    nearness, approach = (np.zeros((run.ticks, len(places)), dtype=np.float32) for _ in range(2))
    for place, (row, col) in enumerate(places):
        if not (terrain.inside(row, col) and terrain.free[row, col]):
            continue
        ways = lengths_along(terrain.free, ALL_WAYS, [(row, col)], FAR // 2)[cells[:, :, 1], cells[:, :, 0]]
        known = alive & (ways < FAR)
        pixels = np.maximum(ways * (terrain.point / 100.0 / pixel), 1.0)
        nearness[:, place] = (known / pixels).sum(axis=1)
        towards = (pixels[:-stride] - pixels[stride:]) / (stride * run.step)
        both = known[:-stride] & known[stride:]
        approach[stride:, place] = (both * towards / pixels[stride:]).sum(axis=1)
    return nearness, approach
