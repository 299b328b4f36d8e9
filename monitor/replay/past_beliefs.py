"""What a robot believed at any tick of a run, found out little by little while somebody looks at the run."""

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
from patrol.ground.footprint import Footprint, sensor_footprint
from patrol.pose import Pose

BUDGET_S = 0.05
"""Wall time that is given to it at once."""

MEMORY = 48 << 20
"""Bytes of all robots' fogs, snapshots and looks together, but for what pages show."""

MOST = 4
"""Robots that are kept as long as pages show them, whatever they take; more at once wait until one is shown no more."""

KEPT_S = 10.0
"""For how long what was found out of a robot is kept that nobody looks at."""

SNAPSHOTS = 40
"""Of one robot, evenly over the run; fewer where there is no room."""


class PastBeliefs:
    """The fogs of a run's robots at any tick; where there is no room for all, who was looked at last is kept."""

    def __init__(self, run: Run, key: bytes | None, now: Callable[[], float] = time.monotonic) -> None:
        """key: of the fleet's tags; without it frames are believed untested."""
        self._run = run
        self._key = key
        self._now = now
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._robots: dict[int, _Robot] = {}
        self._asked: dict[int, float] = {}
        self._shown: frozenset[int] = frozenset()

    @property
    def held(self) -> int:
        """Bytes that are kept."""
        return sum(robot.held for robot in self._robots.values())

    def last_seen(self, number: int, k: int) -> NDArray[np.int32] | None:
        """int32 (h, w) after tick k; None as long as it takes more time. Its own: copy what is to last."""
        if number not in self._robots and len(self._robots) >= MOST and not self._drop_idle():
            return None
        robot = self._robots.pop(number, None) or _Robot(self._run, self._key, self._footprint, number, self._now)
        self._robots[number] = robot
        self._asked[number] = self._now()
        found = robot.last_seen(k)
        self._make_room()
        return found

    def set_shown(self, numbers: Collection[int]) -> None:
        """Somebody shows these robots' fogs; of others nothing is kept once nobody has asked for long."""
        now = self._now()
        self._shown = frozenset(numbers)
        self._asked |= dict.fromkeys(self._robots.keys() & numbers, now)
        for number in [number for number in self._robots if now > self._asked[number] + KEPT_S]:
            self._drop(number)

    def _make_room(self) -> None:
        """Every other snapshot of the robot that has most goes, and where that is not enough, one that no page shows.

        Of two that are shown neither may go: each would be begun anew in the other's place, and none ever be done.
        """
        while self.held > MEMORY:
            thinned = max(self._robots.values(), key=lambda robot: robot.snapshots).thin()
            if not thinned and (len(self._robots) == 1 or not self._drop_idle()):
                return

    def _drop_idle(self) -> bool:
        """Drop who was asked for longest ago of those that no page shows; False where there is none."""
        idle = next((number for number in self._robots if number not in self._shown), None)
        if idle is not None:
            self._drop(idle)
        return idle is not None

    def _drop(self, number: int) -> None:
        del self._robots[number], self._asked[number]


class _Robot:
    """One robot's fog at any tick."""

    def __init__(
        self, run: Run, key: bytes | None, footprint: Footprint, number: int, now: Callable[[], float]
    ) -> None:
        self._now = now
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
        """Bytes that they take."""
        return sum(kept.nbytes for kept in self._kept.values())

    @property
    def held(self) -> int:
        """Bytes that it takes."""
        return self._fog.last_seen.nbytes + self.snapshots + self._look_log.nbytes

    def thin(self) -> bool:
        """Keep half as many snapshots; False where there were none."""
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
        """The last snapshot up to tick k; -1 for none."""
        return max((tick for tick in self._kept if tick <= k), default=-1)

    def _walk(self) -> None:
        """One tick on."""
        self._k += 1
        if self._k in self._look_log.anew:
            self._fog = self._blank()
        for at, pose in self._look_log.looks(self._k):
            self._fog.observe(self._footprint.visible(pose), at)
        if self._k % self._apart == 0 and self._k not in self._kept:
            self._kept[self._k] = Snapshot.of(self._fog.last_seen)

    def _blank(self) -> Fog:
        return mark_outside(Fog(self._area), self._patrolled)


class _LookRecorder(Listener):
    """Notes where somebody looked from, and leaves the looking for later."""

    note: Callable[[int, Pose], None]

    def look(self, tick: int, pose: Pose) -> None:
        self.note(tick, pose)


_NOWHERE = np.ones((1, 1), dtype=np.bool_)


class _LookLog(BeliefWatcher):
    """The looks of which one robot learnt in each tick. anew: ticks at which it knew nothing."""

    def __init__(self, run: Run, footprint: Footprint, key: bytes | None, number: int) -> None:
        self._at = array("i")
        self._poses = array("d")
        self._ends = array("q")
        self.anew: set[int] = set()
        super().__init__(run, footprint, key, robots=[run.index[number]])

    @property
    def ticks(self) -> int:
        """How many are known."""
        return len(self._ends)

    @property
    def nbytes(self) -> int:
        """What they take."""
        return sum(len(one) * one.itemsize for one in (self._at, self._poses, self._ends))

    def looks(self, k: int) -> Iterator[tuple[int, Pose]]:
        """Those of tick k, which is known, in order: when, and from where."""
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
        noting = _LookRecorder(self._footprint, _NOWHERE, super()._listener(number).inbox, self._run.step)
        noting.note = self._note
        self.anew.add(self.ticks)
        return noting
