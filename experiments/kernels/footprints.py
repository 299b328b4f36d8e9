"""Kernel of points that robots may see: the footprints that each had after similar moments, laid over each other."""

from __future__ import annotations

import numpy as np
from numba import njit, types

int64 = types.int64
LOOKS = types.Array(types.int32, 2, "C", readonly=True)
FIRST = types.Array(types.int64, 1, "C", readonly=True)
POINTS = types.Array(types.int32, 1, "C", readonly=True)
SAMPLES = types.Array(types.int64, 2, "C", readonly=True)
CHANCES = types.Array(types.float32, 2, "C")


@njit(types.void(LOOKS, FIRST, POINTS, SAMPLES, SAMPLES, CHANCES), cache=True, nogil=True)
def seen_by_none(looks, first, points, ticks, robots, out):
    """Compute the chance that no robot sees each point, robots being independent.

    Args:
        looks: int32 (ticks, robots), the number of each robot's footprint.
        first: int64 (footprints + 1,), place of the first of each footprint's points.
        points: int32 (n,), the points of all footprints.
        ticks: int64 (r, samples), the moments that each of r robots is likened to.
        robots: int64 (r, samples), the robots that were there in these moments.
        out: float32 (ahead, points), filled in for each tick after these moments.
    """
    counts = np.zeros(out.shape[1], np.int32)
    share = np.float32(1.0) / np.float32(ticks.shape[1])
    for j in range(out.shape[0]):
        out[j, :] = np.float32(1.0)
        for r in range(ticks.shape[0]):
            for s in range(ticks.shape[1]):
                look = looks[ticks[r, s] + 1 + j, robots[r, s]]
                for i in range(first[look], first[look + 1]):
                    counts[points[i]] += 1
            for v in range(out.shape[1]):
                out[j, v] *= np.float32(1.0) - np.float32(counts[v]) * share
                counts[v] = 0
