"""A robot's belief at any tick of a run, computed in slices while a page shows the run."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from monitor.observation.listener import Listener, mark_outside
from monitor.replay.belief_errors import BeliefWatcher
from monitor.replay.run import Run
from monitor.replay.snapshot import Snapshot
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.prepare import sensor_footprint

BUDGET_S = 0.05
"""Wall time for one call, s."""

MEMORY = 48 << 20
"""Bytes of all fogs, snapshots and looks together; robots that pages show may exceed it."""

MOST = 4
"""Robots that may be shown at once; others wait until one is no longer shown."""

KEPT_S = 10.0
"""Time for which the results for a robot that no page shows are kept, s of wall time."""

SNAPSHOTS = 40
"""Snapshots of one robot, evenly over the run; fewer when memory is short."""


class PastBeliefs:
    """The believed fogs of a run at any tick; the robots shown last are kept in memory."""

    def __init__(self, run: Run, key: bytes | None, now: Callable[[], float] = time.monotonic) -> None:
        """Start with nothing computed; without a key, frames are accepted without checking their tags."""
        self._run = run
        self._key = key
        self._now = now
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._robots: dict[int, _Robot] = {}
        self._used: dict[int, float] = {}
        self._shown: frozenset[int] = frozenset()

    @property
    def held(self) -> int:
        """Bytes in use."""
        return sum(robot.held for robot in self._robots.values())

    def last_seen(self, number: int, k: int) -> NDArray[np.int32] | None:
        """Return the fog that a robot believed after tick k, int32 (h, w), valid until the next call.

        None is returned while it is being computed.
        """
        if number not in self._robots and len(self._robots) >= MOST and not self._drop_idle():
            return None
        robot = self._robots.pop(number, None) or _Robot(self._run, self._key, self._footprint, number, self._now)
        self._robots[number] = robot
        self._used[number] = self._now()
        last_seen = robot.last_seen(k)
        self._make_room()
        return last_seen

    def set_shown(self, numbers: Collection[int]) -> None:
        """Set which robots' fogs pages show; others are dropped after `KEPT_S`."""
        now = self._now()
        self._shown = frozenset(numbers)
        self._used |= dict.fromkeys(self._robots.keys() & numbers, now)
        for number in [number for number in self._robots if now > self._used[number] + KEPT_S]:
            self._drop(number)

    def _make_room(self) -> None:
        """Free memory: drop every other snapshot of the robot with the most, then robots that no page shows.

        Robots that pages show are kept: two of them would otherwise replace each other and never finish.
        """
        while self.held > MEMORY:
            thinned = max(self._robots.values(), key=lambda robot: robot.snapshots).thin()
            if not thinned and (len(self._robots) == 1 or not self._drop_idle()):
                return

    def _drop_idle(self) -> bool:
        """Drop the robot not used for longest of those that no page shows; False if there is none."""
        idle = next((number for number in self._robots if number not in self._shown), None)
        if idle is not None:
            self._drop(idle)
        return idle is not None

    def _drop(self, number: int) -> None:
        del self._robots[number], self._used[number]


class _Robot:
    """One robot's fog at any tick."""

    def __init__(
        self, run: Run, key: bytes | None, footprint: Footprint, number: int, now: Callable[[], float]
    ) -> None:
        self._now = now
        self._closings = run.closings
        self._footprint = footprint
        self._apart = max(1, run.ticks // SNAPSHOTS)
        self._area = run.prepared.fields[number].patrolled
        self._patrolled = run.prepared.patrolled
        self._look_log = _LookLog(run, footprint, key, number)
        self._kept: dict[int, Snapshot] = {}
        self._fog = self._blank()
        self._k = -1

    @property
    def snapshots(self) -> int:
        """Size of the snapshots, bytes."""
        return sum(kept.nbytes for kept in self._kept.values())

    @property
    def held(self) -> int:
        """Size of everything, bytes."""
        return self._fog.last_seen.nbytes + self.snapshots + self._look_log.nbytes

    def thin(self) -> bool:
        """Keep every other snapshot; False if there were none."""
        if not self._kept:
            return False
        self._apart *= 2
        only = len(self._kept) == 1
        self._kept = {} if only else {k: kept for k, kept in self._kept.items() if k % self._apart == 0}
        return True

    def last_seen(self, k: int) -> NDArray[np.int32] | None:
        """See `PastBeliefs`."""
        until = self._now() + BUDGET_S
        while self._look_log.ticks <= k:
            if not self._look_log.hear(self._look_log.ticks) or self._now() > until:
                return None
        base = self._before(k)
        if not base <= self._k <= k:
            kept = self._kept.get(base)
            self._fog = self._blank() if kept is None else Fog.resumed(self._area, kept.map())
            self._k = base
        while self._k < k:
            self._walk()
            if self._now() > until and self._k < k:
                return None
        return self._fog.last_seen

    def _before(self, k: int) -> int:
        """Return the tick of the last snapshot up to tick k; -1 for none."""
        return max((tick for tick in self._kept if tick <= k), default=-1)

    def _walk(self) -> None:
        """Advance one tick."""
        self._k += 1
        if self._k in self._look_log.fresh:
            self._fog = self._blank()
        for look_tick, pose in self._look_log.looks(self._k):
            self._closings.show(look_tick, self._footprint)
            self._fog.observe(self._footprint.visible(pose), look_tick)
        if self._k % self._apart == 0 and self._k not in self._kept:
            self._kept[self._k] = Snapshot.of(self._fog.last_seen)

    def _blank(self) -> Fog:
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

    @property
    def nbytes(self) -> int:
        """Size, bytes."""
        return sum(len(one) * one.itemsize for one in (self._at, self._poses, self._ends))

    def looks(self, k: int) -> Iterator[tuple[int, Pose]]:
        """Yield the looks learnt of in tick k, in order: tick and pose of each."""
        for place in range(self._ends[k - 1] if k else 0, self._ends[k]):
            yield self._at[place], Pose(*self._poses[3 * place : 3 * place + 3])

    def hear(self, k: int) -> bool:
        if not super().hear(k):
            return False
        self._ends.append(len(self._at))
        return True

    def _note(self, tick: int, pose: Pose) -> None:
        self._at.append(tick)
        self._poses.extend((pose.x, pose.y, pose.heading))

    def _listener(self, number: int) -> Listener:
        noting = _LookRecorder(self._footprint, _NOWHERE, super()._listener(number).inboxes, number)
        noting.note = self._note
        self.fresh.add(self.ticks)
        return noting
