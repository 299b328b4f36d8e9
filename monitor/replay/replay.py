"""Reconstructs a run from its journal. The true fog follows from the poses alone.

`play` replays a run once from start to end for any number of watchers, such as `VisitCounter`; `Replay` gives the fog
at any tick. Neither uses a clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.visits import settle, visit
from monitor.replay.fog_history import FogHistory
from monitor.replay.run import Run
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint, View
from patrol.prepare import sensor_footprint
from patrol.radio.message import as_received

MEMORY = 256 << 20
"""Bytes for a replay's snapshots."""


class Watcher(Protocol):
    """Receives each tick that `play` replays; a subclass may leave out what it does not need."""

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - for those that need it
        """Take in a tick before its observations.

        `fog` is the true fog before them, and `views` are the footprints of the robots that take part.
        """
        return

    def after(self, k: int, fog: Fog) -> None:  # noqa: ARG002 - likewise
        """Take in a tick after its observations, with the true fog after them."""
        return


def play(run: Run, watchers: Sequence[Watcher], footprint: Footprint | None = None) -> int | None:
    """Replay all ticks of a run; return the first whose fog differs from the journal's measures.

    None is returned if all agree, as they must.
    """
    footprint = footprint or sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    fog = Fog(run.prepared.patrolled)
    wrong = None
    for k in range(run.ticks):
        views = views_at(run, k, footprint)
        for watcher in watchers:
            watcher.before(k, fog, views)
        for view in views:
            fog.observe(view, k)
        for watcher in watchers:
            watcher.after(k, fog)
        if wrong is None and not _as_measured(run, k, fog):
            wrong = k
    return wrong


def _as_measured(run: Run, k: int, fog: Fog) -> bool:
    same = fog.mfow(k) == run.mfow[k] and fog.seen == run.seen[k]
    return bool(same and abs(fog.mean(k) - run.fog_mean[k]) < 1e-6)


def views_at(run: Run, k: int, footprint: Footprint) -> list[View]:
    """Return the true footprint of each robot that takes part in a tick, in roster order."""
    run.closings.show(k, footprint)
    return [footprint.visible(as_received(pose)) for _, pose in run.alive(k)]


class Replay:
    """Gives the true fog of a run at any tick."""

    def __init__(self, run: Run, memory: int = MEMORY) -> None:
        """Start before the first tick, with about `memory` bytes for snapshots of the fog."""
        self.run = run
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._history = FogHistory(self._blank_fog, self._advance_fog, run.ticks, memory)

    def fog(self, k: int) -> Fog:
        """Return the true fog after the observations of a tick, valid until the next call."""
        if not 0 <= k < self.run.ticks:
            raise BadInput(f"tick {k}: the run has ticks 0 to {self.run.ticks - 1}")
        # Every point was seen in the last MFoW ticks. With looks that leave nothing of an age, they are enough for the
        # fog, so that a jump does not replay the whole run. It goes to a snapshot's place, from which steps back go on.
        position = self._history.place(k)
        enough = position - int(self.run.mfow[position])
        if not self._footprint.leaves_age and enough > self._history.base(k) + 1:
            fog = self._blank_fog()
            for tick in range(enough, position + 1):
                self._advance_fog(fog, tick)
            if fog.mfow(position) == self.run.mfow[position]:
                self._history.put(fog, position)
        fog_then = self._history.fog(k)
        assert fog_then is not None
        return fog_then

    def _blank_fog(self) -> Fog:
        return Fog(self.run.prepared.patrolled)

    def _advance_fog(self, fog: Fog, k: int) -> Fog:
        for view in views_at(self.run, k, self._footprint):
            fog.observe(view, k)
        return fog


@dataclass(frozen=True, eq=False)
class Visits:
    """The ages of each point of the ground over a run, and the gaps between its visits, in ticks."""

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
