"""A robot's belief at any tick of a run, computed in slices while a page shows the run."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from monitor.observation.listener import Listener, mark_outside
from monitor.replay.belief_errors import BeliefWatcher
from monitor.replay.fog_history import FogHistory
from monitor.replay.run import Run
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.prepare import sensor_footprint

BUDGET_S = 0.05
"""Wall time for one call, s."""

MEMORY = 64 << 20
"""Bytes of the snapshots of all robots together."""

MOST = 4
"""Robots whose fogs are kept; while pages show so many, others wait until one is no longer shown."""


class PastBeliefs:
    """The believed fogs of a run at any tick; those of the robots shown last are kept."""

    def __init__(self, run: Run, key: bytes | None, now: Callable[[], float] = time.monotonic) -> None:
        """Start with nothing computed; without a key, frames are accepted without checking their tags."""
        self._run = run
        self._key = key
        self._now = now
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._robots: dict[int, _Robot] = {}
        self._shown: frozenset[int] = frozenset()

    def last_seen(self, number: int, k: int) -> NDArray[np.int32] | None:
        """Return the fog that a robot believed after tick k, int32 (h, w), valid until the next call.

        None is returned while it is being computed.
        """
        if number not in self._robots and len(self._robots) >= MOST:
            idle = next((candidate for candidate in self._robots if candidate not in self._shown), None)
            if idle is None:
                return None
            del self._robots[idle]
        robot = self._robots.pop(number, None) or _Robot(self._run, self._key, self._footprint, number, self._now)
        self._robots[number] = robot  # at the end: the first one has not been used for longest
        return robot.last_seen(k)

    def set_shown(self, numbers: Collection[int]) -> None:
        """Set which robots' fogs pages show, so that no other one takes their place."""
        self._shown = frozenset(numbers)


class _Robot:
    """One robot's fog at any tick."""

    def __init__(
        self, run: Run, key: bytes | None, footprint: Footprint, number: int, now: Callable[[], float]
    ) -> None:
        self._now = now
        self._closings = run.closings
        self._footprint = footprint
        self._area, self._patrolled = run.prepared.fields[number].patrolled, run.prepared.patrolled
        self._look_log = _LookLog(run, footprint, key, number)
        self._history = FogHistory(self._blank_fog, self._advance_fog, run.ticks, MEMORY // MOST)

    def last_seen(self, k: int) -> NDArray[np.int32] | None:
        """See `PastBeliefs`."""
        until = self._now() + BUDGET_S
        while self._look_log.ticks <= k:
            if not self._look_log.hear(self._look_log.ticks) or self._now() > until:
                return None
        fog = self._history.fog(k, lambda: self._now() > until)
        return None if fog is None else fog.last_seen

    def _advance_fog(self, fog: Fog, k: int) -> Fog:
        # A robot that was started again has forgotten what it knew.
        if k in self._look_log.fresh:
            fog = self._blank_fog()
        for look_tick, pose in self._look_log.looks(k):
            self._closings.show(look_tick, self._footprint)
            fog.observe(self._footprint.visible(pose), look_tick)
        return fog

    def _blank_fog(self) -> Fog:
        return mark_outside(Fog(self._area), self._patrolled)


class _LookRecorder(Listener):
    """Records the poses of observations instead of applying them."""

    note: Callable[[int, Pose], None]

    def look(self, tick: int, pose: Pose) -> None:
        self.note(tick, pose)


_NOWHERE = np.ones((1, 1), dtype=np.bool_)


class _LookLog(BeliefWatcher):
    """The looks that one robot learnt of in each tick. fresh: ticks at which it started without knowledge."""

    def __init__(self, run: Run, footprint: Footprint, key: bytes | None, number: int) -> None:
        self._at = array("i")
        self._poses = array("d")
        self._ends = array("q")
        self.fresh: set[int] = set()
        super().__init__(run, footprint, key, robots=[run.index[number]])

    @property
    def ticks(self) -> int:
        """Number of ticks read."""
        return len(self._ends)

    def looks(self, k: int) -> Iterator[tuple[int, Pose]]:
        """Yield the looks learnt of in tick k, in order: tick and pose of each."""
        for index in range(self._ends[k - 1] if k else 0, self._ends[k]):
            yield self._at[index], Pose(*self._poses[3 * index : 3 * index + 3])

    def hear(self, k: int) -> bool:
        if not super().hear(k):
            return False
        self._ends.append(len(self._at))
        return True

    def _note_look(self, tick: int, pose: Pose) -> None:
        self._at.append(tick)
        self._poses.extend((pose.x, pose.y, pose.heading))

    def _make_listener(self, number: int) -> Listener:
        noting = _LookRecorder(self._footprint, _NOWHERE, super()._make_listener(number).inboxes, number)
        noting.note = self._note_look
        self.fresh.add(self.ticks)
        return noting
