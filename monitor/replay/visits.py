"""Statistics of the fog over a run, point by point: mean age, largest age, and times between visits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.visits import settle, visit
from monitor.replay.replay import Watcher
from patrol.ground.fog import Fog
from patrol.ground.footprint import View


@dataclass(frozen=True, eq=False)
class Visits:
    """The statistics of a run, in ticks."""

    mean: NDArray[np.float64]  # (h, w), mean age over all ticks; 0 outside the patrolled area
    worst: NDArray[np.int32]  # (h, w), largest age; 0 outside the patrolled area
    # (n,), how often n ticks passed from the end of a visit to a point to its next; a first visit ends no gap
    gaps: NDArray[np.int64]
    never: NDArray[np.bool_]  # (h, w), patrolled points that no robot ever saw


class VisitCounter(Watcher):
    """Computes the statistics while `monitor.replay.replay.play` replays the run."""

    def __init__(self, patrolled: NDArray[np.bool_], ticks: int) -> None:
        """Start with empty sums."""
        self._tracked = np.ascontiguousarray(patrolled).view(np.uint8)
        self._upto = np.full(patrolled.shape, -1, dtype=np.int32)
        self._sums = np.zeros(patrolled.shape, dtype=np.int64)
        self._worst = np.zeros(patrolled.shape, dtype=np.int32)
        self._looked = np.full(patrolled.shape, -1, dtype=np.int32)
        self._gaps = np.zeros(ticks + 1, dtype=np.int64)
        self._ticks = 0
        self._last_seen = np.full(patrolled.shape, -1, dtype=np.int32)

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """See `Watcher`: adds the ages that the observations will reset."""
        totals = (self._tracked, self._upto, self._sums, self._worst, self._looked, self._gaps)
        for view in views:
            visit(fog.last_seen, *totals, view.mask, view.row0, view.col0, k)

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`."""
        self._ticks = k + 1
        self._last_seen = fog.last_seen

    def result(self) -> Visits:
        """Return the statistics up to the last tick."""
        settle(self._last_seen, self._tracked, self._upto, self._sums, self._worst, self._ticks - 1)
        never = self._tracked.view(np.bool_) & (self._looked < 0)
        return Visits(self._sums / max(self._ticks, 1), self._worst, self._gaps, never)
