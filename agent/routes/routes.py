"""Routes: lengths and first bends of the shortest ways over the ground as it is now."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Ground, Spot
from agent.routes.kernels.between import keep_between
from agent.routes.kernels.wave import SETTLED, STATUS
from agent.routes.path_window import DIAGONAL, FAR, PathWindow
from agent.routes.wave import LONGEST, Wave

LEAST_SPAN = 64
"""Span of the smallest window, in points; larger ones have powers of two, so that there are few of them."""

LARGE = 2**21
"""Points of a window that is worth letting go; one over a whole terrain of 1600 x 2400 points takes 54 MB."""

STRAIGHT_OVER = 2**16
"""Points between two places among which a closed one is looked for before a wave."""

IDLE = 16
"""Ways found without it after which a large one is let go. Some are needed at the beginning only."""

Element = tuple[int, int]
"""Row and column in `Ground.state`: one more than those of the terrain's point."""


@dataclass(frozen=True, slots=True)
class Way:
    """The shortest way to a place.

    Attributes:
        place: Where it ends, x and y in m: the centre of the target point, or of the nearest reachable one.
        bend: Where it first bends, x and y in m; the place itself when the way is straight.
        length: m.
    """

    place: Spot
    bend: Spot
    length: float


def unhindered(one: Element, other: Element) -> int:
    """The length of the way between two elements if nothing is in between, in hundredths of a point."""
    up, across = abs(one[0] - other[0]), abs(one[1] - other[1])
    return 100 * max(up, across) + (DIAGONAL - 100) * min(up, across)


class Routes:
    """Shortest ways over one robot's ground, computed on demand.

    A way runs from point to neighbouring point (8 neighbours; a straight step counts 1, a diagonal one 1.41 points) and
    cuts no corner (paper, "The wave").
    """

    def __init__(self, ground: Ground, scratch: dict[str, PathWindow]) -> None:
        """Compute nothing yet.

        Args:
            ground: The ground of one robot.
            scratch: Windows shared by minds of one process that never think at the same time.
        """
        self._ground = ground
        self._scratch = scratch

    def lengths(self, place: Spot, within: float | None = None) -> NDArray[np.float64]:
        """Lengths of the ways from a place to all points.

        Args:
            place: x and y in m: the robot's own place, another robot's, or any other. A place that is closed at this
                tick starts from the ground with nothing closed, since robots do stand there.
            within: Longest way to follow, m; a limit saves time. None for no limit.

        Returns:
            float64 (height, width) in m; infinity where no way leads, or only a longer one.
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
            expected: Likely upper bound of the way's length, in hundredths of a point. The search goes beyond it only
                if needed.

        Returns:
            The way to the target, or to the reachable place nearest to it.
        """
        here = self._ground.centre(*target)
        if start == target or self._is_straight(start, target):
            for key in list(self._scratch):
                self._let_go(key)
            return Way(here, here, float(unhindered(start, target)) * self._ground.terrain.point / 100.0)
        if expected is not None:
            window = self.window(-(-expected // 100) + 1)
            window.begin(self._ground, *start)
            row, col = target[0] - 1 - window.row0, target[1] - 1 - window.col0
            height, width = window.state.shape
            if 0 <= row < height and 0 <= col < width:
                keep_between(window.state, window.start_row, window.start_col, row, col, expected)
                window.extend(expected)
                if window.state[row, col] & STATUS == SETTLED:
                    return self._way_in(window, row, col)
        window = self.window()
        window.begin(self._ground, *start)
        window.extend(LONGEST)
        row, col = target[0] - 1 - window.row0, target[1] - 1 - window.col0
        if window.state[row, col] & STATUS != SETTLED:
            rows, cols = np.nonzero(window.state & STATUS == SETTLED)
            nearest = int(np.argmin((rows - row) ** 2 + (cols - col) ** 2))
            row, col = int(rows[nearest]), int(cols[nearest])
        return self._way_in(window, row, col)

    def _is_straight(self, start: Element, target: Element) -> bool:
        """Whether nothing is closed between two elements, and the one is in sight of the other.

        Then no way is shorter than theirs, and it does not bend. No look reaches farther than the terrain is long.
        Where much lies between them, something is closed nearly always, and is not looked for.
        """
        (row, col), (to_row, to_col) = start, target
        if math.dist(start, target) > max(self._ground.terrain.shape):
            return False
        if (abs(to_row - row) + 1) * (abs(to_col - col) + 1) > STRAIGHT_OVER:
            return False
        rows, cols = slice(min(row, to_row), max(row, to_row) + 1), slice(min(col, to_col), max(col, to_col) + 1)
        return bool(self._ground.state[rows, cols].all())

    def _way_in(self, window: Wave, row: int, col: int) -> Way:
        """The way to a settled element of a window."""
        bend_row, bend_col = divmod(int(window.bend[row, col]), window.state.shape[1])
        centre = self._ground.terrain.centre
        place = centre(row + window.row0, col + window.col0)
        bend = centre(bend_row + window.row0, bend_col + window.col0)
        return Way(place, bend, float(window.length[row, col]) * self._ground.terrain.point / 100.0)

    def window(self, span: int | None = None) -> Wave:
        """A wave, made on first use and shared from then on.

        Args:
            span: How far it has to reach from its start, in points; it may reach farther. None for the whole terrain.
        """
        height, width = self._ground.terrain.shape
        whole = max(height, width)
        wide = whole if span is None else min(whole, max(LEAST_SPAN, 2 ** max(span - 1, 1).bit_length()))
        key = f"wave {height} {width} {wide}"
        wave = self._scratch.get(key)
        if wave is None:
            wave = self._scratch[key] = Wave(height, width, wide)
        assert isinstance(wave, Wave)
        wave.idle = 0
        for other in [other for other in self._scratch if other != key]:
            self._let_go(other)
        return wave

    def _let_go(self, key: str) -> None:
        """Count a way found without this window; let a large wave go that nobody has asked for in a while."""
        wave = self._scratch[key]
        wave.idle += 1
        if wave.idle > IDLE and isinstance(wave, Wave) and wave.state.size > LARGE:
            del self._scratch[key]
