"""A run played again from its journal: the state at any tick, forwards and backwards.

The true fog follows from the poses alone. `play` goes through a run once, for whoever wants to watch all of it;
`Replay` jumps to any tick. Pure: nothing here knows how fast somebody looks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from monitor.observation.listener import as_sent
from monitor.replay.run import Run
from monitor.replay.snapshot import Snapshot
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint, View, sensor_footprint
from patrol.journal.records import Event, Status

MEMORY = 256 << 20
"""Bytes that a replay's snapshots may take if no two points beside each other were seen at the same time."""

_MOST_SNAPSHOTS = 400
_LEAST_APART = 8
_NEAR = 8
"""Snapshots kept of the stretch that is being played backwards."""


class Watcher(Protocol):
    """Somebody who goes along with `play`."""

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Tick k's footprints are about to be taken in."""
        ...

    def after(self, k: int, fog: Fog) -> None:
        """They have been."""
        ...


def play(run: Run, watchers: Sequence[Watcher], footprint: Footprint | None = None) -> int | None:
    """Go through all ticks; returns the first whose fog is not as the journal measured it, which must not be."""
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
    """What each robot that takes part in tick k truly sees, in roster order."""
    return [footprint.visible(as_sent(number, pose)) for number, pose in run.alive(k)]


@dataclass(frozen=True, slots=True)
class RobotMoment:
    """One robot at one tick: where it truly is (m, rad), its standing, what its mind says it does, its goal (m)."""

    number: int
    name: str
    status: Status
    state: str
    x: float
    y: float
    heading: float
    bumped: bool
    goal: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class Moment:
    """A run at tick k, after its observations.

    last_seen: int32 (h, w), a copy; mfow and fog_mean in ticks, as the journal has them. events: those before tick k or
    at it, all since the run began.
    """

    k: int
    time_s: float
    last_seen: NDArray[np.int32]
    mfow: int
    fog_mean: float
    robots: tuple[RobotMoment, ...]
    events: tuple[Event, ...]

    def ages(self) -> NDArray[np.int32]:
        """int32 (h, w): ticks since each point was last seen; outside the patrolled area as if never seen."""
        return np.int32(self.k) - np.maximum(self.last_seen, np.int32(0))


class Replay:
    """A run at any tick.

    Snapshots of the fog are kept as they are passed, some evenly over the run and some within the stretch that is
    played backwards. Where a look makes a point fresh, the fog at tick k also follows from the last MFoW ticks alone,
    so that a jump never needs the whole run once every point has been seen.
    """

    def __init__(self, run: Run, memory: int = MEMORY) -> None:
        """memory: bytes for snapshots."""
        self.run = run
        self._footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
        self._whole_looks = run.prepared.scenario.sensor.quality == 1.0
        self._fog = Fog(run.prepared.patrolled)
        self._k = -1
        size = self._fog.last_seen.nbytes
        self._most = int(np.clip(memory // size - _NEAR, 4, _MOST_SNAPSHOTS))
        self._apart = max(_LEAST_APART, -(-run.ticks // self._most))
        self._far: dict[int, Snapshot] = {}
        self._near: dict[int, Snapshot] = {}

    @property
    def ticks(self) -> int:
        """How many there are."""
        return self.run.ticks

    def fog(self, k: int) -> Fog:
        """The true fog after tick k's observations; it is the replay's own, so copy what is to last."""
        if not 0 <= k < self.run.ticks:
            raise BadInput(f"tick {k}: the run has ticks 0 to {self.run.ticks - 1}")
        if k != self._k:
            self._seek(k)
        return self._fog

    def at(self, k: int) -> Moment:
        """The run at tick k."""
        run, fog = self.run, self.fog(k)
        robots = []
        for place, facts in enumerate(run.robots):
            x, y, heading = run.poses[k, place].tolist()
            to_x, to_y = run.goals[k, place].tolist()
            robots.append(
                RobotMoment(
                    number=facts.number,
                    name=facts.name,
                    status=Status(int(run.status[k, place])),
                    state=run.labels[run.states[k, place]],
                    x=x,
                    y=y,
                    heading=heading,
                    bumped=bool(run.bumped[k, place]),
                    goal=None if np.isnan(to_x) else (to_x, to_y),
                )
            )
        return Moment(
            k=k,
            time_s=k * run.step,
            last_seen=fog.last_seen.copy(),
            mfow=int(run.mfow[k]),
            fog_mean=float(run.fog_mean[k]),
            robots=tuple(robots),
            events=tuple(event for event in run.events if event.k <= k),
        )

    def _seek(self, k: int) -> None:
        backwards = k < self._k
        base = max((tick for kept in (self._far, self._near) for tick in kept if tick <= k), default=-1)
        from_here = base <= self._k <= k
        base = self._k if from_here else base
        # A step back begins a stretch earlier, for more are likely to follow.
        goal = max(k - self._apart, 0) if backwards else k
        if not (goal > base and self._look_back(goal, base)) and not from_here:
            self._restore(base)
        if backwards:
            self._near.clear()
        self._walk(k, max(1, (k - self._k) // _NEAR) if backwards else 0)

    def _look_back(self, k: int, base: int) -> bool:
        """Rebuild tick k's fog from the last ticks alone, if that is less work than to go on from `base`."""
        enough = k - int(self.run.mfow[k])
        if not self._whole_looks or enough <= base + 1:
            return False
        fog = Fog(self.run.prepared.patrolled)
        for tick in range(enough, k + 1):
            for view in views_at(self.run, tick, self._footprint):
                fog.observe(view, tick)
        if fog.mfow(k) != self.run.mfow[k]:
            return False
        self._fog, self._k = fog, k
        self._keep(k)
        return True

    def _restore(self, base: int) -> None:
        kept = self._far.get(base, self._near.get(base))
        patrolled = self.run.prepared.patrolled
        self._fog = Fog(patrolled) if kept is None else Fog.resumed(patrolled, kept.map())
        self._k = base

    def _walk(self, last: int, near: int) -> None:
        """Go on to tick `last`; near: ticks between two of the snapshots kept on the way, 0 for none."""
        first = self._k + 1
        for k in range(first, last + 1):
            for view in views_at(self.run, k, self._footprint):
                self._fog.observe(view, k)
            if k % self._apart == 0:
                self._keep(k)
            elif near and (k - first) % near == 0 and len(self._near) < _NEAR:
                self._near[k] = Snapshot.of(self._fog.last_seen)
        self._k = last

    def _keep(self, k: int) -> None:
        if len(self._far) < self._most and k not in self._far:
            self._far[k] = Snapshot.of(self._fog.last_seen)
