"""The ground of a judged run as it is in each tick, its true fog, and the check of the fog."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from patrol.changing.ground import ChangingFootprint, ClosedPoints
from patrol.changing.open_ground import by_driver
from patrol.ground.fog import Fog
from patrol.journal import Status
from patrol.pose import Pose
from patrol.prepare import sensor_footprint
from patrol.radio.message import as_received
from worldsim.checks.check import Check, JournalReading
from worldsim.checks.statuses import ExpectedStatuses

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import Terrain
    from patrol.journal import Event, TickRecord
    from worldsim.checks.check import JudgedRun


class ClosedGround(JournalReading):
    """The ground, tick by tick, by the journal's events of what closes and opens.

    `ground_events` are those just before this tick.
    """

    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self.closed = ClosedPoints(run.prepared.closable, run.prepared.terrain)
        self.ground_events: Sequence[Event] = ()

    @cached_property
    def footprint(self) -> Footprint:
        """The robots' sensor on the ground as it is."""
        footprint = sensor_footprint(self._run.prepared.scenario, self._run.prepared.terrain)
        if isinstance(footprint, ChangingFootprint):
            footprint.close(self.closed.grid)
        return footprint

    @property
    def terrain(self) -> Terrain:
        """The ground as it is, for bodies."""
        return self.footprint.terrain if self.closed.points else self._run.prepared.terrain

    def tick(self, record: TickRecord) -> None:
        """Take in the events before a tick."""
        if not self.closed.points:
            return
        self.ground_events = [event for event in self._events_before(record.k) if self.closed.take(event)]
        if self.ground_events and isinstance(self.footprint, ChangingFootprint):
            self.footprint.close(self.closed.grid)


class TrueFog(JournalReading):
    """The fog after the latest tick: recomputed from the poses, or the world's own if it is not verified."""

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._footprint = run.reading(ClosedGround).footprint
        self.fog = Fog(run.prepared.patrolled) if run.fog is None else run.fog

    def tick(self, record: TickRecord) -> None:
        """Let the living robots look around."""
        for row in record.robots if self._run.fog is None else ():
            if row.status is Status.ALIVE:
                pose = as_received(Pose(row.x, row.y, row.heading))
                self.fog.observe(self._footprint.visible(pose), record.k)


class GroundOpen(JournalReading):
    """The ground that is open to view, tick by tick: `open_ground` has what each robot can get to and see."""

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._ground, self._expected = run.reading(ClosedGround), run.reading(ExpectedStatuses)
        self.open_ground = run.prepared.open_ground()

    def tick(self, record: TickRecord) -> None:
        """Take in the places of the robots."""
        here = [row for row in record.robots if row.number not in self._expected.away]
        places, wrecks = by_driver(here)
        self.open_ground.tick(record.k, self._ground.terrain, self._ground.closed.names, places, wrecks)


class FogIsTrue(Check):
    """MFoW, mean fog and points seen are those of the poses, recomputed from the beginning.

    A fog keeps sums from look to look; those of the last tick are also counted point by point.
    """

    name = "fog"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._fog = run.reading(TrueFog).fog
        self._ticks = 0
        self._last: TickRecord | None = None

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the fog is to be verified."""
        return run.verify_fog

    def _tick(self, record: TickRecord) -> None:
        self._ticks += 1
        self._last = record
        self._compare_figures(record, (self._fog.mfow(record.k), self._fog.mean(record.k), self._fog.seen))

    def _end(self) -> str:
        if self._last is not None and not self._problem:
            k, seen_at = self._last.k, self._fog.last_seen[self._fog.patrolled != 0]
            # Ground that was never seen counts from the run's beginning.
            since = np.maximum(seen_at, 0)
            mean = k - int(since.sum(dtype=np.int64)) / since.size
            self._compare_figures(self._last, (k - int(since.min()), mean, int(np.count_nonzero(seen_at >= 0))))
        return f"recomputed over {self._ticks} ticks"

    def _compare_figures(self, record: TickRecord, figures: tuple[int, float, int]) -> None:
        recorded = (record.mfow, record.fog_mean, record.seen)
        if figures != recorded:
            step = self._step
            shown = [f"MFoW {m * step:g} s, mean {a * step:g} s, {n} seen" for m, a, n in (figures, recorded)]
            self._fail(f"tick {record.k}: the poses give {shown[0]}; recorded is {shown[1]}")
