"""The difference between each robot's believed fog and the true one.

The believed fog follows from the robot's own position frames and the frames that it received, before dilatation. If
every frame arrives in its own tick and robots know their poses, it equals the true fog exactly.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.observation.listener import GONE, BeliefFollower, Listener
from monitor.replay.replay import Watcher
from monitor.replay.run import Run
from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.journal.records import Status, standing_after
from patrol.prepare import inboxes_of

SAMPLES = 200
"""Ticks at which beliefs are compared with the truth, evenly over the run."""

WORK = 400_000
"""Most footprints to compute for beliefs; of a large fleet only some robots are examined."""


@dataclass(frozen=True, eq=False)
class BeliefErrors:
    """Believed fog compared with the true one."""

    ticks: NDArray[np.int64]  # (m,), the ticks compared
    robots: tuple[int, ...]  # places in the roster
    # (m, robots), mean of |believed age - true age| over its patrolled area, ticks; NaN while it takes no part
    mean: NDArray[np.float64]
    mfow: NDArray[np.float64]  # (m, robots), the believed MFoW, ticks
    exact: bool  # nothing was lost, late or forged, so that there was nothing to compare


def exact_by_construction(run: Run) -> bool:
    """Return whether every living robot's position reached every other robot unchanged in its own tick."""
    return (
        not run.links.dropped
        and run.links.late == 0
        and run.figures.messages.rejected == 0
        and not run.prepared.scenario.faults
        and run.positions == int(np.count_nonzero(run.status == Status.ALIVE))
        and bool((run.status == Status.ALIVE).all())
    )


def chosen_robots(run: Run, work: int = WORK) -> tuple[int, ...]:
    """Return the places in the roster of the robots to examine, ascending.

    These are all robots, or as many as `work` footprints allow, those that missed most frames.
    """
    count = len(run.numbers)
    robot_limit = max(1, work // max(1, run.ticks * count))
    if robot_limit >= count:
        return tuple(range(count))
    missed = run.links.lost.sum(axis=0)[1:]
    # Stable: of robots that missed as many, those first in the roster are taken on every machine.
    return tuple(sorted(np.argsort(-missed, kind="stable")[:robot_limit].tolist()))


class BeliefWatcher(Watcher):
    """Rebuilds beliefs from frames and deliveries while `monitor.replay.replay.play` replays the run."""

    def __init__(
        self,
        run: Run,
        footprint: Footprint,
        key: bytes | None = None,
        work: int = WORK,
        robots: Sequence[int] | None = None,
    ) -> None:
        """Start without knowledge.

        `robots` are places in the roster; None selects some, for at most `work` footprints. Without a `key` frames are
        accepted without checking their tags.
        """
        self._run = run
        self._footprint = footprint
        self._key = key
        self._robots = chosen_robots(run, work) if robots is None else tuple(robots)
        numbers = [run.numbers[index] for index in self._robots]
        # A frame may arrive that many ticks after it was sent, and is looked up by its own tick.
        self._beliefs = BeliefFollower(numbers, self._make_listener, run.links.late + 1)
        self._records = iter(run.journal.ticks)
        self._ended: dict[int, set[int]] = defaultdict(set)
        for event in run.events:
            if event.robot is not None and standing_after(event.kind) in GONE:
                self._ended[event.k].add(event.robot)
        self._sampled = set(np.unique(np.linspace(0, run.ticks - 1, SAMPLES).astype(np.int64)).tolist())
        self._ticks: list[int] = []
        self._mean: list[NDArray[np.float64]] = []
        self._mfow: list[NDArray[np.float64]] = []

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`; updates the beliefs and, at some ticks, compares them."""
        if self.hear(k) and k in self._sampled:
            self._compare_fog(k, fog)

    def hear(self, k: int) -> bool:
        """Update the selected robots' beliefs with the next tick, k; False at the journal's end."""
        record = next(self._records, None)
        if record is None:
            return False
        self._beliefs.tick(record, self._ended[k])
        return True

    def believed(self, number: int) -> Fog:
        """Return the fog that a selected robot believes now, by its number."""
        return self._beliefs.listeners[number].fog

    def result(self) -> BeliefErrors:
        """Return the comparison so far."""
        shape = (len(self._ticks), len(self._robots))
        ticks = np.array(self._ticks, dtype=np.int64)
        mean, mfow = (np.array(rows, dtype=np.float64).reshape(shape) for rows in (self._mean, self._mfow))
        return BeliefErrors(ticks, self._robots, mean, mfow, exact=False)

    def _make_listener(self, number: int) -> Listener:
        prepared = self._run.prepared
        inboxes = inboxes_of(prepared.scenario, [number], prepared.terrain.bounds, self._key)
        return Listener(self._footprint, prepared.fields[number].patrolled, inboxes, number, self._run.closings)

    def _compare_fog(self, k: int, fog: Fog) -> None:
        truth = fog.age(k)
        mean, mfow = np.full((2, len(self._robots)), np.nan)
        for column, robot in enumerate(self._robots):
            if self._run.status[k, robot] == Status.ALIVE:
                believed = self.believed(self._run.numbers[robot])
                # The fleet's area contains the robot's, so the truth is known wherever the robot believes something.
                off = np.abs(believed.age(k) - truth)[believed.patrolled.view(np.bool_)]
                mean[column], mfow[column] = off.mean(), believed.mfow(k)
        self._ticks.append(k)
        self._mean.append(mean)
        self._mfow.append(mfow)
