"""How the fog went over a whole run, point by point: mean, worst, and the times between two visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.replay.kernels.visits import settle, visit
from patrol.ground.fog import Fog
from patrol.ground.footprint import View


@dataclass(frozen=True, eq=False)
class Visits:
    """What a run came to at each point, in ticks.

    mean: float64 (h, w), the age over all ticks; worst: int32 (h, w), the largest. Both 0 where nothing counts.
    gaps: int64 (n,), points by ticks between the end of a visit and the next look; a first visit ends no gap.
    never: bool (h, w), patrolled points that nobody ever saw.
    """

    mean: NDArray[np.float64]
    worst: NDArray[np.int32]
    gaps: NDArray[np.int64]
    never: NDArray[np.bool_]


class VisitCounter:
    """Goes along with `monitor.replay.replay.play` over `ticks` ticks and adds up."""

    def __init__(self, patrolled: NDArray[np.bool_], ticks: int) -> None:
        self._tracked = np.ascontiguousarray(patrolled).view(np.uint8)
        self._upto = np.full(patrolled.shape, -1, dtype=np.int32)
        self._sums = np.zeros(patrolled.shape, dtype=np.int64)
        self._worst = np.zeros(patrolled.shape, dtype=np.int32)
        self._looked = np.full(patrolled.shape, -1, dtype=np.int32)
        self._gaps = np.zeros(ticks + 1, dtype=np.int64)
        self._ticks = 0
        self._last_seen = np.full(patrolled.shape, -1, dtype=np.int32)

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Account for what the fog is about to forget."""
        totals = (self._tracked, self._upto, self._sums, self._worst, self._looked, self._gaps)
        for view in views:
            visit(fog.last_seen, *totals, view.mask, view.row0, view.col0, k)

    def after(self, k: int, fog: Fog) -> None:
        """Remember how far it got."""
        self._ticks = k + 1
        self._last_seen = fog.last_seen

    def result(self) -> Visits:
        """The sums up to the last tick."""
        settle(self._last_seen, self._tracked, self._upto, self._sums, self._worst, self._ticks - 1)
        never = self._tracked.view(np.bool_) & (self._looked < 0)
        return Visits(self._sums / max(self._ticks, 1), self._worst, self._gaps, never)
