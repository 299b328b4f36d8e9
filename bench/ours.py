"""Our kernels, called as a mind calls them. All other benchmarks use scenarios, minds, fleets and the command line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agent.kernels.dilate import dilate
from agent.kernels.wave import FAR
from agent.routes.ground import Ground
from agent.routes.wave import Wave
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.footprint import cast


class WholeWave:
    """The wave from one point over a whole ground."""

    def __init__(self, is_open: BoolGrid, start: tuple[int, int]) -> None:
        """Prepare what a mind keeps from tick to tick.

        Args:
            is_open: bool (h, w), where the robot's centre may be.
            start: Row and column of an open point.
        """
        height, width = is_open.shape
        self._ground = Ground(Terrain("benchmark", np.ones_like(is_open), 0.1), is_open)
        self._wave = Wave(height, width, max(height, width))
        self._start = start[0] + 1, start[1] + 1
        self._limit = 100 * self._wave.span

    def run(self) -> None:
        """Find the lengths and the first bends of all paths."""
        self._wave.begin(self._ground, *self._start)
        self._wave.extend(self._limit)

    def run_lengths(self) -> NDArray[np.int32]:
        """Find the lengths of all paths and nothing else: int32 (h + 2, w + 2), hundredths of a point."""
        return self._wave.lengths_from(self._ground, *self._start, [self._start], self._limit)

    def lengths(self) -> NDArray[np.float64]:
        """The lengths, float64 (h, w), in points; infinite where no path leads."""
        lengths = self.run_lengths()[1:-1, 1:-1]
        return np.where(lengths == FAR, np.inf, lengths / 100.0)


class Dilatation:
    """The dilatation over a whole ground."""

    def __init__(self, seen: NDArray[np.int32], is_open: BoolGrid, reach: int, tick: int) -> None:
        """Lay out the grids.

        Args:
            seen: int32 (h, w), the tick at which each point was last seen.
            is_open: bool (h, w), the points over which staleness spreads.
            reach: Half-width of the window, in points.
            tick: Now.
        """
        self._seen, self._reach, self._tick = seen.copy(), reach, tick
        self._open = is_open.astype(np.uint8)
        self.dilated: NDArray[np.int32] = seen.copy()
        height, width = (size + 2 * reach + 4 for size in seen.shape)
        self._scratch = np.zeros(3 * height * width, dtype=np.uint16)

    def run(self) -> None:
        """Fill `dilated`: the oldest tick within each open point's window, int32 (h, w)."""
        height, width = self._seen.shape
        box = 0, height - 1, 0, width - 1
        grids = (self._seen, self._open, self._open, self.dilated)
        dilate(*grids, *box, self._reach, self._tick, self._scratch)


class Look:
    """One footprint of a sensor that sees all round."""

    def __init__(self, is_open: BoolGrid, at: tuple[int, int], radius: int) -> None:
        """Allocate the view.

        Args:
            is_open: bool (h, w), where a sensor sees through.
            at: Row and column of the sensor.
            radius: Of the view, in points.
        """
        self._passable = is_open.astype(np.uint8)
        self._at, self._radius = at, radius
        self._corner = at[0] - radius, at[1] - radius
        self._view = np.zeros((2 * radius + 1, 2 * radius + 1), dtype=np.uint8)

    def run(self) -> None:
        """Find the points in view."""
        cast(self._passable, *self._at, float(self._radius), self._view, *self._corner)
