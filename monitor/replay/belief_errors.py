"""How far each robot's picture of the fog was from the truth, rebuilt from what the radio delivered to it.

Believed is the fog that follows from a robot's own position frames and the frames that reached it, before any
dilatation. Where every frame arrives in its own tick, and robots know where they are, it is the truth to the point.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.observation.frames import MIND_ENDS, frames_of, own_pose
from monitor.observation.listener import Listener
from monitor.replay.run import Run
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint, View
from patrol.journal.records import Status, TickRecord, sent_at
from patrol.pose import Pose
from patrol.radio.inbox import inbox_of

SAMPLES = 200
"""Ticks at which beliefs are held against the truth, evenly over the run."""

WORK = 400_000
"""Footprints taken in for beliefs, at most; a fleet for which that is too few is told by some of its robots."""


@dataclass(frozen=True, eq=False)
class BeliefErrors:
    """Believed against true fog.

    ticks: int64 (m,), those looked at. robots: places in the roster. mean: float64 (m, robots), the mean over the
    robot's patrolled area of |believed - true| age, ticks; NaN where it takes no part. mfow: float64 (m, robots), the
    believed MFoW, ticks. exact: nothing was lost, late or forged, so nothing had to be rebuilt.
    """

    ticks: NDArray[np.int64]
    robots: tuple[int, ...]
    mean: NDArray[np.float64]
    mfow: NDArray[np.float64]
    exact: bool


def exact_by_construction(run: Run) -> bool:
    """Whether every living robot's position reached every other in its tick, undistorted."""
    return (
        not run.links.dropped
        and run.links.late == 0
        and run.rejected == 0
        and not run.prepared.scenario.faults
        and run.positions == int(np.count_nonzero(run.status == Status.ALIVE))
        and bool((run.status == Status.ALIVE).all())
    )


def chosen_robots(run: Run, work: int = WORK) -> tuple[int, ...]:
    """The places of the robots to look at: all, or as many as `work` allows of those that missed most."""
    count = len(run.numbers)
    most = max(1, work // max(1, run.ticks * count))
    if most >= count:
        return tuple(range(count))
    missed = run.links.lost.sum(axis=0)[1:]
    return tuple(sorted(np.argsort(-missed, kind="stable")[:most].tolist()))


class BeliefWatcher:
    """Goes along with `monitor.replay.replay.play` and rebuilds beliefs from the journal's frames and deliveries."""

    def __init__(
        self,
        run: Run,
        footprint: Footprint,
        key: bytes | None = None,
        work: int = WORK,
        robots: Sequence[int] | None = None,
    ) -> None:
        """key: of the fleet's tags; without it frames are believed untested. robots: whom to look at, by place."""
        self._run = run
        self._footprint = footprint
        self._key = key
        self._robots = chosen_robots(run, work) if robots is None else tuple(robots)
        self._wanted = [run.numbers[place] for place in self._robots]
        self._listeners = {number: self._listener(number) for number in self._wanted}
        self._records = iter(run.journal.ticks)
        self._past: deque[dict[tuple[int, int], bytes]] = deque(maxlen=run.links.late + 1)
        self._fresh: dict[int, set[int]] = defaultdict(set)
        for event in run.events:
            if event.robot is not None and event.kind in MIND_ENDS:
                self._fresh[event.k].add(event.robot)
        self._sampled = set(np.unique(np.linspace(0, run.ticks - 1, SAMPLES).astype(np.int64)).tolist())
        self._ticks: list[int] = []
        self._mean: list[list[float]] = []
        self._mfow: list[list[float]] = []

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Nothing: beliefs follow from frames."""

    def after(self, k: int, fog: Fog) -> None:
        """Every chosen robot takes in what it heard in tick k; now and then the fogs are compared."""
        if self.hear(k) and k in self._sampled:
            self._compare(k, fog)

    def hear(self, k: int) -> bool:
        """Every chosen robot takes in what it heard in tick k, the next one; False where the journal ends."""
        record = next(self._records, None)
        if record is None:
            return False
        self._past.append(frames_of(record))
        heard = self._deliveries(record)
        for number in self._wanted:
            if self._begins_anew(k, number):
                self._listeners[number] = self._listener(number)
            if self._alive(k, number):
                listener = self._listeners[number]
                listener.look(k, self._own(k, number))
                listener.hear(k, heard.get(number, ()))
        return True

    def believed(self, number: int) -> Fog:
        """What a chosen robot believes now."""
        return self._listeners[number].fog

    def result(self) -> BeliefErrors:
        """What was found."""
        shape = (len(self._ticks), len(self._robots))
        ticks = np.array(self._ticks, dtype=np.int64)
        mean, mfow = (np.array(rows, dtype=np.float64).reshape(shape) for rows in (self._mean, self._mfow))
        return BeliefErrors(ticks, self._robots, mean, mfow, exact=False)

    def _listener(self, number: int) -> Listener:
        prepared = self._run.prepared
        inbox = inbox_of(prepared.scenario, number, prepared.terrain.bounds, self._key)
        return Listener(self._footprint, prepared.fields[number].patrolled, inbox, self._run.step)

    def _alive(self, k: int, number: int) -> bool:
        return bool(self._run.status[k, self._run.index[number]] == Status.ALIVE)

    def _begins_anew(self, k: int, number: int) -> bool:
        if number in self._fresh[k]:
            return True
        before = Status(int(self._run.status[k - 1, self._run.index[number]])) if k else Status.ALIVE
        return self._alive(k, number) and before not in (Status.ALIVE, Status.PAUSED)

    def _own(self, k: int, number: int) -> Pose:
        true = Pose(*self._run.poses[k, self._run.index[number]].tolist())
        return own_pose(k, number, self._past[-1], true)

    def _deliveries(self, record: TickRecord) -> dict[int, list[bytes]]:
        """By receiver, the frames that reach it in this tick, in the order of arrival."""
        heard: dict[int, list[bytes]] = defaultdict(list)
        wanted = set(self._wanted)
        for source, destination, sequence in record.deliveries:
            if destination not in wanted:
                continue
            ago = record.k - sent_at(sequence)
            sent = self._past[-1 - ago] if 0 <= ago < len(self._past) else {}
            frame = sent.get((source, sequence))
            if frame is not None:
                heard[destination].append(frame)
        return heard

    def _compare(self, k: int, fog: Fog) -> None:
        truth = fog.age(k)
        means, mfows = [], []
        for number in self._wanted:
            if not self._alive(k, number):
                means.append(np.nan)
                mfows.append(np.nan)
                continue
            believed = self._listeners[number].fog
            # The fleet's area holds the robot's, so the truth is known wherever the robot believes something.
            off = np.abs(believed.age(k) - truth)[believed.patrolled.view(np.bool_)]
            means.append(float(off.mean()))
            mfows.append(float(believed.mfow(k)))
        self._ticks.append(k)
        self._mean.append(means)
        self._mfow.append(mfows)
