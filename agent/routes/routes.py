"""Routes: how long the shortest ways are and where they first bend, for whoever asks, over the ground as it is now."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Ground, Spot
from agent.routes.kernels.wave import SETTLED, STATUS
from agent.routes.path_window import FAR, PathWindow
from agent.routes.wave import Wave

LONGEST = 2**26
"""Hundredths of a point: no path is longer."""

Element = tuple[int, int]
"""Row and column of the ground's state, one more than those of the terrain's point."""


@dataclass(frozen=True, slots=True)
class Way:
    """The shortest way to a place.

    Attributes:
        place: Where it leads, x and y in m: the centre of the point that was asked for, or of the nearest reachable.
        bend: Where it first bends, x and y in m; the place itself when nothing is in between.
    """

    place: Spot
    bend: Spot


class Routes:
    """Shortest ways over one robot's ground, worked out when asked for.

    A way runs from point to neighbouring point (8 neighbours; a straight step counts 1, a diagonal one 1.41 points) and
    cuts no corner (paper, "The wave").
    """

    def __init__(self, ground: Ground, scratch: dict[str, PathWindow]) -> None:
        """Make the routes of a ground.

        Args:
            ground: Of one robot.
            scratch: Windows shared by minds of one process that never think at the same time.
        """
        self._ground = ground
        self._scratch = scratch

    def lengths(self, place: Spot, within: float | None = None) -> NDArray[np.float64]:
        """How long the ways from a place to all points are.

        Args:
            place: x and y in m: the robot's own, another robot's, or any other. Robots stand on the ground as it is
                without what is closed for now.
            within: m, beyond which no way is followed, which takes less time; None for no limit.

        Returns:
            float64 (height, width) in m; infinity where no way leads, or none of that length.
        """
        terrain = self._ground.terrain
        if not all(map(math.isfinite, place)) or (within is not None and not within >= 0.0):
            raise ValueError(f"lengths from {place} within {within}: give a place in m, and a limit of 0 m or more")
        far = np.full(terrain.shape, np.inf)
        ground = self._ground
        start = ground.join(*place)
        if start is None:
            ground = ground.static
            start = ground.join(*place)
        if start is None:
            return far
        limit = LONGEST if within is None else round(min(LONGEST, 100.0 * within / terrain.point))
        found = self.window().lengths_from(ground, *start, [start], limit)[1:-1, 1:-1]
        np.copyto(far, found * (terrain.point / 100.0), where=found < FAR)
        return far

    def way(self, start: Element, target: Element, expected: int | None = None) -> Way:
        """The way from one element of the ground to another, over the ground as it is now.

        Args:
            start: An open element.
            target: Any element inside the frame.
            expected: How long the way may well be, hundredths of a point; farther is looked only where that is not
                enough.

        Returns:
            The way to the target, or to the nearest place that a way leads to.
        """
        here = self._ground.centre(*target)
        if start == target:
            return Way(here, here)
        window = self.window()
        window.begin(self._ground, *start)
        row, col = target[0] - 1 - window.row0, target[1] - 1 - window.col0
        for limit in (LONGEST,) if expected is None else (expected, LONGEST):
            if window.state[row, col] & STATUS != SETTLED:
                window.extend(limit)
        if window.state[row, col] & STATUS != SETTLED:
            rows, cols = np.nonzero(window.state & STATUS == SETTLED)
            nearest = int(np.argmin((rows - row) ** 2 + (cols - col) ** 2))
            row, col = int(rows[nearest]), int(cols[nearest])
        bend_row, bend_col = divmod(int(window.bend[row, col]), window.state.shape[1])
        centre = self._ground.terrain.centre
        return Way(centre(row + window.row0, col + window.col0), centre(bend_row + window.row0, bend_col + window.col0))

    def window(self) -> Wave:
        """A wave over the whole terrain; made when first needed."""
        height, width = self._ground.terrain.shape
        key = f"whole {height} {width}"
        if key not in self._scratch:
            self._scratch[key] = Wave(height, width, max(height, width))
        wave = self._scratch[key]
        assert isinstance(wave, Wave)
        return wave
