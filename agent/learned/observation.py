"""The observation of a learned policy: its robot's belief, as arrays of fixed shapes.

    fog      (2, window, window)   the believed age of each point around the robot, and where its centre may be now
    pose     (4,)                  its place on the terrain, and the cosine and sine of its heading
    heard    (heard, 4)            the nearest robots heard lately: whether there is one, where, and how long ago
    sectors  (8, 5)                by direction: near and far staleness, free way, nearness of others, and the heading

All are float32 within [-1, 1]. Ages are divided by the robot's believed MFoW, so 1 is the stalest point. Everything
comes from the robot's view, never from the truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.kernels.surroundings import count_free, fill_features, fill_heard, fill_window, sum_ages
from patrol.pose import TAU
from patrol.radio.peers import columns_of, places_of

if TYPE_CHECKING:
    from agent.view import View
    from patrol.ground.terrain import Terrain
    from patrol.scenario.policies import LearnedOptions

Observation = Mapping[str, NDArray[np.float32]]

SECTORS = 8
"""Directions of 45 degrees; number 0 is that of x, counted towards y."""

HEARD_S = 10.0
"""Seconds after which a position counts as old as any."""

Grid = NDArray[np.float32]


def bearing_of(sector: int) -> float:
    """Return the direction of a sector's middle, rad."""
    return sector * TAU / SECTORS


class Observer:
    """Makes the observations of one robot."""

    def __init__(self, terrain: Terrain, options: LearnedOptions, step: float) -> None:
        self._half = options.window // 2
        self._heard = options.heard
        self._step = step
        x0, y0, x1, y1 = terrain.bounds
        self._middle, self._span = ((x0 + x1) / 2.0, (y0 + y1) / 2.0), (x1 - x0, y1 - y0)
        self._longest = max(self._span)
        self.half_m = (self._half + 0.5) * terrain.point  # from the robot to the side of its window
        shapes: dict[str, tuple[int, ...]] = {
            "fog": (2, options.window, options.window),
            "pose": (4,),
            "heard": (options.heard, 4),
            "sectors": (SECTORS, 5),
        }
        self.shapes = {name: shapes[name] for name in options.inputs}  # in the order of `patrol.options.inputs`
        makers = {
            "fog": self._fog_input,
            "pose": self._pose_input,
            "heard": self._others_input,
            "sectors": self._sectors_input,
        }
        self._makers = [(name, makers[name]) for name in options.inputs]
        # The points from the robot's own to the side of its window, in each direction.
        self._rays = np.array(
            [
                [[round(k * math.sin(b)), round(k * math.cos(b))] for k in range(1, self._half + 1)]
                for b in map(bearing_of, range(SECTORS))
            ],
            dtype=np.int64,
        )
        self._sums = np.zeros((SECTORS, 4), dtype=np.int64)
        self._ways = np.zeros(SECTORS, dtype=np.int64)
        self._ways_at = -1

    @property
    def size(self) -> int:
        """Number of values of an observation."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def observe(self, view: View) -> Observation:
        """Make an observation: new arrays by name, in the order of `shapes`."""
        return {name: make(view) for name, make in self._makers}

    def free_ways(self, view: View) -> NDArray[np.int64]:
        """Count the open points from the robot towards the side of its window, in each of the 8 sectors."""
        if self._ways_at != view.tick:
            row, col = view.ground.terrain.point_at(view.pose.x, view.pose.y)
            count_free(view.ground.open_now, row, col, self._rays, self._ways)
            self._ways_at = view.tick
        return self._ways

    def _fog_input(self, view: View) -> Grid:
        fog = np.empty(self.shapes["fog"], dtype=np.float32)
        row, col = view.ground.terrain.point_at(view.pose.x, view.pose.y)
        grids = view.fog.last_seen, view.fog.patrolled, view.ground.open_now
        fill_window(*grids, row, col, view.tick, max(view.mfow, 1), fog)
        return fog

    def _pose_input(self, view: View) -> Grid:
        pose = view.pose
        x, y = (2.0 * (v - m) / s for v, m, s in zip((pose.x, pose.y), self._middle, self._span, strict=True))
        return np.array(
            [_clip_value(x), _clip_value(y), math.cos(pose.heading), math.sin(pose.heading)], dtype=np.float32
        )

    def _others_input(self, view: View) -> Grid:
        rows = np.empty(self.shapes["heard"], dtype=np.float32)
        _, _, ticks, places = columns_of(view.peers)
        fill_heard(places, ticks, view.pose.x, view.pose.y, self._longest, view.tick, HEARD_S / self._step, rows)
        return rows

    def _sectors_input(self, view: View) -> Grid:
        sectors = np.empty(self.shapes["sectors"], dtype=np.float32)
        pose, fog, sums, half = view.pose, view.fog, self._sums, self._half
        row, col = view.ground.terrain.point_at(pose.x, pose.y)
        sum_ages(fog.last_seen, fog.patrolled, row, col, half, view.tick, sums)
        ways, places, heading = self.free_ways(view), places_of(view.peers), pose.heading
        numbers = pose.x, pose.y, self.half_m, math.cos(heading), math.sin(heading)
        fill_features(sums, max(view.mfow, 1), ways, half, places, *numbers, sectors)
        return sectors


def _clip_value(value: float) -> float:
    return min(max(value, -1.0), 1.0)
