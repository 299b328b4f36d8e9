"""The observation of a learned policy: what its robot believes, as arrays of fixed shapes.

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

from agent.policies.learned.kernels.sectors import sum_ages
from patrol.pose import TAU

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
    """Makes the observations of one robot.

    Attributes:
        shapes: Of each part of an observation, in the order of `patrol.options.inputs`.
        half_m: Distance from the robot to the side of its window, m.
    """

    def __init__(self, terrain: Terrain, options: LearnedOptions, step: float) -> None:
        """Take what never changes.

        Args:
            terrain: The ground.
            options: What is to be seen.
            step: s per tick.
        """
        self._half = options.window // 2
        self._heard = options.heard
        self._step = step
        x0, y0, x1, y1 = terrain.bounds
        self._middle, self._span = ((x0 + x1) / 2.0, (y0 + y1) / 2.0), (x1 - x0, y1 - y0)
        self._longest = max(self._span)
        self.half_m = (self._half + 0.5) * terrain.point
        shapes: dict[str, tuple[int, ...]] = {
            "fog": (2, options.window, options.window),
            "pose": (4,),
            "heard": (options.heard, 4),
            "sectors": (SECTORS, 5),
        }
        self.shapes = {name: shapes[name] for name in options.inputs}
        makers = {"fog": self._fog, "pose": self._pose, "heard": self._others, "sectors": self._sectors}
        self._makers = [(name, makers[name]) for name in options.inputs]
        steps = np.arange(1, self._half + 1)
        bearings = [bearing_of(sector) for sector in range(SECTORS)]
        # The points of the window from its middle to its side, in each direction.
        self._rays = tuple(
            np.array([[self._half + round(k * side(b)) for k in steps.tolist()] for b in bearings], dtype=np.intp)
            for side in (math.sin, math.cos)
        )
        self._sums = np.zeros((SECTORS, 4), dtype=np.int64)

    @property
    def size(self) -> int:
        """Number of values of an observation."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def observe(self, view: View) -> Observation:
        """Make an observation.

        Args:
            view: Of this tick.

        Returns:
            New arrays by name, in the order of `shapes`.
        """
        return {name: make(view) for name, make in self._makers}

    def free_ways(self, view: View) -> NDArray[np.int64]:
        """Count the open points from the robot towards the side of its window.

        Args:
            view: Of this tick.

        Returns:
            int64 (8,), by sector, 0 to half a window.
        """
        ways = self._cut(view.ground.open_now, view)[self._rays]
        return np.where(ways.all(axis=1), self._half, ways.argmin(axis=1))

    def _fog(self, view: View) -> Grid:
        fog = np.zeros(self.shapes["fog"], dtype=np.float32)
        patrolled, seen = self._cut(view.fog.patrolled, view), self._cut(view.fog.last_seen, view)
        fog[0] = np.where(patrolled, (view.tick - np.maximum(seen, 0)) / max(view.mfow, 1), 0.0)
        fog[1] = self._cut(view.ground.open_now, view)
        return fog

    def _cut(self, grid: NDArray[np.generic], view: View) -> NDArray[np.generic]:
        """Return the robot's window of a grid (height, width), 0 beyond the terrain."""
        (row, col), half = view.ground.terrain.point_at(view.pose.x, view.pose.y), self._half
        height, width = grid.shape
        top, bottom, left, right = row - half, row + half + 1, col - half, col + half + 1
        if 0 <= top and bottom <= height and 0 <= left and right <= width:
            return grid[top:bottom, left:right]
        cut = np.zeros((2 * half + 1, 2 * half + 1), dtype=grid.dtype)
        rows, cols = (max(top, 0), min(bottom, height)), (max(left, 0), min(right, width))
        if rows[0] < rows[1] and cols[0] < cols[1]:
            inside = grid[rows[0] : rows[1], cols[0] : cols[1]]
            cut[rows[0] - top : rows[1] - top, cols[0] - left : cols[1] - left] = inside
        return cut

    def _pose(self, view: View) -> Grid:
        pose = view.pose
        x, y = (2.0 * (v - m) / s for v, m, s in zip((pose.x, pose.y), self._middle, self._span, strict=True))
        return np.array([_bounded(x), _bounded(y), math.cos(pose.heading), math.sin(pose.heading)], dtype=np.float32)

    def _others(self, view: View) -> Grid:
        heard = np.zeros(self.shapes["heard"], dtype=np.float32)
        pose = view.pose
        peers = sorted(
            (math.hypot(peer.pose.x - pose.x, peer.pose.y - pose.y), number) for number, peer in view.peers.items()
        )
        for place, (_, number) in enumerate(peers[: self._heard]):
            peer = view.peers[number]
            across, up = (peer.pose.x - pose.x) / self._longest, (peer.pose.y - pose.y) / self._longest
            age = min((view.tick - peer.tick) * self._step / HEARD_S, 1.0)
            heard[place] = 1.0, _bounded(across), _bounded(up), age
        return heard

    def _sectors(self, view: View) -> Grid:
        sectors = np.zeros(self.shapes["sectors"], dtype=np.float32)
        pose, fog, sums = view.pose, view.fog, self._sums
        row, col = view.ground.terrain.point_at(pose.x, pose.y)
        sum_ages(fog.last_seen, fog.patrolled, row, col, self._half, view.tick, sums)
        sectors[:, :2] = sums[:, ::2] / np.maximum(sums[:, 1::2] * max(view.mfow, 1), 1)
        sectors[:, 2] = self.free_ways(view) / self._half
        for peer in view.peers.values():
            across, up = peer.pose.x - pose.x, peer.pose.y - pose.y
            nearness = 1.0 - math.hypot(across, up) / self.half_m
            if nearness > 0.0:
                sector = round(math.atan2(up, across) * SECTORS / TAU) % SECTORS
                sectors[sector, 3] = max(sectors[sector, 3], nearness)
        sectors[:, 4] = [math.cos(pose.heading - bearing_of(sector)) for sector in range(SECTORS)]
        return sectors


def _bounded(value: float) -> float:
    return min(max(value, -1.0), 1.0)
