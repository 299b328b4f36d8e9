"""Nearness and approach against ways that a plain search finds."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from experiments.intruders.on_run import nearness_and_approach
from patrol.ground.terrain import BoolGrid


def way_lengths(free: BoolGrid, start: tuple[int, int]) -> dict[tuple[int, int], float]:
    """Lengths in points from a start to all points; steps cost 1 or 1.41, and no way cuts a corner."""
    lengths: dict[tuple[int, int], float] = {}
    waiting = [(0, start)]
    while waiting:
        length, (row, col) = heapq.heappop(waiting)
        if (row, col) in lengths:
            continue
        lengths[row, col] = length / 100.0
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                beside = [(row + down, col + right), (row + down, col), (row, col + right)]
                if all(0 <= r < free.shape[0] and 0 <= c < free.shape[1] and free[r, c] for r, c in beside):
                    heapq.heappush(waiting, (length + (141 if down and right else 100), beside[0]))
    return lengths


@pytest.mark.parametrize("which", ["quiet", "faulty"])
def test_robots_are_as_near_as_the_ways_to_them(which: str, request: pytest.FixtureRequest) -> None:
    run = request.getfixturevalue(which).open()
    terrain = run.prepared.terrain
    corner, wall = (tuple(np.argwhere(grid)[-1].tolist()) for grid in (terrain.free, ~terrain.free))
    places = [terrain.point_at(run.poses[20, 0, 0], run.poses[20, 0, 1]), corner, wall, (-1, 5)]
    pixel = 0.5
    nearness, approach = nearness_and_approach(run, places, pixel)
    assert nearness.shape == approach.shape == (run.ticks, 4)
    assert not nearness[:, 2:].any()
    assert not approach[:, 2:].any()
    for place in (0, 1):
        lengths = way_lengths(terrain.free, places[place])
        pixels = [
            {
                number: max(lengths.get(terrain.point_at(pose.x, pose.y), math.inf) * terrain.point / pixel, 1.0)
                for number, pose in run.alive(k)
            }
            for k in range(run.ticks)
        ]
        for k in range(run.ticks):
            assert nearness[k, place] == pytest.approx(sum(1.0 / away for away in pixels[k].values()), rel=1e-5)
            before = pixels[k - 2] if k >= 2 else {}
            towards = sum((before[number] - away) / away for number, away in pixels[k].items() if number in before)
            assert approach[k, place] == pytest.approx(towards, rel=1e-4, abs=1e-6)
