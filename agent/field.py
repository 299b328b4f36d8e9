"""The social potential field of one robot: the forces of all points, summed (paper, steps 4 and 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agent.direction import sector_table
from agent.force import ForceLaw
from agent.ground import Ground
from agent.kernels.force import gather, gather_from_posts
from agent.paths.straight import Straight
from agent.paths.wave import Wave
from agent.paths.window import Window
from patrol.fields import StaticFields
from patrol.scenario import PatrolSpec

_Floats = NDArray[np.float64]
_Law = tuple[int, _Floats, _Floats, NDArray[np.uint16], bool, _Floats, _Floats, NDArray[np.int64]]

FIRST_LOOK = 20.0
"""Path length in m up to which forces are summed before the horizon is drawn from them."""

PATHS: dict[str, type[Window]] = {"wave": Wave, "straight": Straight}


@dataclass(frozen=True, slots=True)
class Pull:
    """The forces on a robot.

    sums: float64 (sectors,), the sum of moduli in each sector; for the vector method (3,): the sum's x and y, and the
    sum of moduli. near: for each sector (one for the vector method) the open element (row, col) of the ground to
    stand on for the largest single force, if it is in sight of the robot, else None.
    """

    sums: NDArray[np.float64]
    near: tuple[tuple[int, int] | None, ...]


class Field:
    """Sums the forces on a robot over sectors (mode) or as a vector.

    Paths are followed in two rounds: the near ones first, and from what they exert the horizon up to which farther
    ones can still change the result (see `ForceLaw`).
    """

    def __init__(
        self, patrol: PatrolSpec, fields: StaticFields, point: float, sensor_range: float, scratch: dict[str, Window]
    ) -> None:
        """point, sensor_range: m. scratch: windows shared by minds of one process that never think at the same time."""
        height, width = fields.reach.shape
        sources = int(np.count_nonzero(fields.patrolled))
        self.law = ForceLaw(patrol, point, sources, longest=400 * (height + width))
        span = min(max(height, width), -(-self.law.limit // 100))
        key = f"{patrol.paths} {height} {width} {span}"
        self.paths = scratch.setdefault(key, PATHS[patrol.paths](height, width, span))
        self._point = point
        self._posts = _posts(fields.proxy)
        self._post_rows = np.ascontiguousarray(self._posts[:, 2])
        self._as_vector = patrol.direction == "vector"
        beside = math.ceil(sensor_range / point)
        self._sector = sector_table(patrol.sectors, max(span, min(beside, max(height, width))) + 1)
        self._sectors = patrol.sectors

    def pull(
        self,
        ground: Ground,
        row: int,
        col: int,
        seen: NDArray[np.int32],
        dilated: NDArray[np.int32],
        tick: int,
        mfow: int,
    ) -> Pull:
        """The forces on a robot on the open element (row, col) of the ground.

        seen, dilated: int32 (h, w), last-seen ticks before and after dilatation. mfow: ticks.
        """
        sums = np.zeros(3 if self._as_vector else self._sectors)
        strongest = np.zeros(1 if self._as_vector else self._sectors)
        source = np.zeros(strongest.size, dtype=np.int64)
        by_age = self.law.pull(mfow)
        law = (tick, by_age, self.law.decay, self._sector, self._as_vector, sums, strongest, source)
        self.paths.begin(ground, row, col)
        near = min(self.law.limit, round(100.0 * FIRST_LOOK / self._point))
        self._gather(0, near, seen, dilated, law)
        exerted = float(sums[2] if self._as_vector else sums.sum())
        horizon = self.law.horizon(exerted, float(by_age[-1]))
        if horizon > near:
            self._gather(near, horizon, seen, dilated, law)
        return Pull(
            sums,
            tuple(
                self._in_sight(int(index), bool(force > 0.0)) for index, force in zip(source, strongest, strict=True)
            ),
        )

    def _gather(self, first: int, last: int, seen: NDArray[np.int32], dilated: NDArray[np.int32], law: _Law) -> None:
        """Add the forces along paths longer than ``first`` and at most ``last`` hundredths of a point."""
        paths = self.paths
        paths.extend(last)
        span = min(paths.span, -(-last // 100))
        grids = (paths.state, paths.length, paths.bend)
        place = (paths.start_row, paths.start_col, paths.row0, paths.col0)
        gather(*grids, first, last, span, *place, dilated, *law)
        here = paths.row0 + paths.start_row
        low, high = np.searchsorted(self._post_rows, [here - span, here + span + 1])
        gather_from_posts(self._posts[low:high], *grids, first, last, *place, seen, *law)

    def _in_sight(self, index: int, exerts: bool) -> tuple[int, int] | None:
        """The window's element ``index`` as an element of the ground, if a straight path leads there."""
        row, col = divmod(index, self.paths.state.shape[1])
        if not exerts or self.paths.bend[row, col] != index:
            return None
        return row + self.paths.row0 + 1, col + self.paths.col0 + 1


def _posts(proxy: NDArray[np.int32]) -> NDArray[np.int32]:
    """int32 (n, 5): row and column of each point that has a proxy, of the proxy, and their gap; by the proxy's row."""
    width = proxy.shape[1]
    points = np.flatnonzero(proxy.reshape(-1) >= 0)
    posts = proxy.reshape(-1)[points]
    order = np.argsort(posts, kind="stable")
    row, col = np.divmod(points[order], width)
    post_row, post_col = np.divmod(posts[order], width)
    gap = np.rint(100.0 * np.hypot(row - post_row, col - post_col))
    return np.ascontiguousarray(np.stack([row, col, post_row, post_col, gap], axis=1).astype(np.int32))
