"""What a robot believed at any tick of a run, found out little by little while somebody looks at the run."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monitor.beliefs import BeliefWatcher
from monitor.observer import Listener, keep_outside
from monitor.runs import Run
from patrol.fog import Fog
from patrol.footprint import Footprint, sensor_footprint
from patrol.pose import Pose

BUDGET_S = 0.05
"""Wall time that is given to it at once."""

SNAPSHOTS = 40
MOST = 4
"""Robots of which snapshots are kept, each of the whole map."""


class Hindsight:
    """The fogs of a run's robots at any tick; of more than `MOST` robots in turn each begins anew."""

    def __init__(self, run: Run, key: bytes | None, now: Callable[[], float] = time.monotonic) -> None:
        """key: of the fleet's tags; without it frames are believed untested."""
        self._run = run
        self._key = key
        self._now = now
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._robots: dict[int, _Robot] = {}

    def last_seen(self, number: int, k: int) -> NDArray[np.int32] | None:
        """int32 (h, w) after tick k; None as long as it takes more time. Its own: copy what is to last."""
        robot = self._robots.pop(number, None) or _Robot(self._run, self._key, self._footprint, number, self._now)
        self._robots[number] = robot
        if len(self._robots) > MOST:
            del self._robots[next(iter(self._robots))]
        return robot.last_seen(k)


class _Robot:
    """One robot's fog at any tick."""

    def __init__(
        self, run: Run, key: bytes | None, footprint: Footprint, number: int, now: Callable[[], float]
    ) -> None:
        self._now = now
        self._footprint = footprint
        self._apart = max(1, run.ticks // SNAPSHOTS)
        self._patrolled = run.prepared.fields[number].patrolled
        self._blank = keep_outside(Fog(self._patrolled), run.prepared.patrolled).last_seen
        self._recall = _Recall(run, footprint, key, number)
        self._kept: dict[int, NDArray[np.int32]] = {}
        self._fog = Fog.resumed(self._patrolled, self._blank)
        self._k = -1

    def last_seen(self, k: int) -> NDArray[np.int32] | None:
        """See `Hindsight`."""
        until = self._now() + BUDGET_S
        while self._recall.ticks <= k:
            if not self._recall.hear(self._recall.ticks) or self._now() > until:
                return None
        base = self._before(k)
        if not base <= self._k <= k:
            self._fog = Fog.resumed(self._patrolled, self._kept.get(base, self._blank))
            self._k = base
        while self._k < k:
            self._walk()
            if self._now() > until and self._k < k:
                return None
        return self._fog.last_seen

    def _before(self, k: int) -> int:
        """The last snapshot up to tick k; -1 for none."""
        return max((tick for tick in self._kept if tick <= k), default=-1)

    def _walk(self) -> None:
        """One tick on."""
        self._k += 1
        if self._k in self._recall.anew:
            self._fog = Fog.resumed(self._patrolled, self._blank)
        for at, pose in self._recall.looks[self._k]:
            self._fog.observe(self._footprint.visible(pose), at)
        if self._k % self._apart == 0:
            self._kept[self._k] = self._fog.last_seen.copy()


class _Noting(Listener):
    """Notes where somebody looked from, and leaves the looking for later."""

    looks: list[tuple[int, Pose]]

    def look(self, tick: int, pose: Pose) -> None:
        self.looks.append((tick, pose))


class _Recall(BeliefWatcher):
    """The looks of which one robot learnt in each tick. anew: ticks at which it knew nothing."""

    def __init__(self, run: Run, footprint: Footprint, key: bytes | None, number: int) -> None:
        self.looks: list[list[tuple[int, Pose]]] = []
        self.anew: set[int] = set()
        super().__init__(run, footprint, key, robots=[run.index[number]])

    @property
    def ticks(self) -> int:
        """How many are known."""
        return len(self.looks)

    def hear(self, k: int) -> bool:
        self.looks.append([])
        for listener in self._listeners.values():
            listener.looks = self.looks[-1]  # type: ignore[attr-defined]
        if super().hear(k):
            return True
        self.looks.pop()
        return False

    def _listener(self, number: int) -> Listener:
        plain = super()._listener(number)
        noting = _Noting(self._footprint, plain.fog.patrolled.view(np.bool_), plain.inbox, self._run.step)
        noting.looks = self.looks[-1] if self.looks else []
        self.anew.add(len(self.looks) - 1)
        return noting
