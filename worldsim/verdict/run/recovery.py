"""The verdict's check of recovery: after the faults the patrol is as it was."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.journal.records import RobotTick, Status, TickRecord
from patrol.pose import Pose
from worldsim.faults import FAULT_EVENT
from worldsim.truth import Truth
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun, Readings

WITHIN = 5.0
"""Longest time to see every point again, in fault-free mean MFoW."""


class Recovers(Check):
    """Once the faults are over, every patrolled point is seen again within 5 x the fault-free mean MFoW.

    The time counts from the first tick in which no fault is active any more and the whole fleet is there: the process
    of a robot that the last fault starts may take some ticks to come. It is judged only where that happens, there is a
    fault-free run of the same seed to compare with, and the run goes on for long enough.
    """

    name = "recovery"
    needs = (RobotsThere, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._names = {spec.number: spec.name for spec in scenario.roster}
        self._spares = scenario.spares
        self._healed = run.timeline.healed
        self._ground = readings[ClosedGround]
        self._missing = ""
        self._truth: Truth | None = None
        self._whole_at = 0
        self._seen_at: int | None = None
        self._last = -1

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has faults."""
        return bool(run.prepared.scenario.faults)

    def _tick(self, record: TickRecord) -> None:
        self._last = record.k
        if self._healed is None or record.k < self._healed or self._seen_at is not None:
            return
        if self._truth is None:
            gone = [row for row in record.robots if row.status is not Status.ALIVE and not self._stays_away(row)]
            if gone:
                status = "away" if gone[0].status is Status.LEFT else gone[0].status.name.lower()
                self._missing = f"{self._names.get(gone[0].number, gone[0].number)} is still {status}"
                return
            self._missing = ""
            self._whole_at = record.k
            self._truth = Truth(self._ground.footprint, self._run.prepared.patrolled)
        poses = [(row.number, Pose(row.x, row.y, row.heading)) for row in record.robots if row.status is Status.ALIVE]
        self._truth.observe(record.k, poses)
        if self._truth.fog.seen == self._truth.fog.points:
            self._seen_at = record.k

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        step = self._run.step
        took_s = None if self._seen_at is None else (self._seen_at - self._whole_at) * step
        took = "not every point was seen again" if took_s is None else f"every point was seen again in {took_s:g} s"
        limit_s = math.ceil(WITHIN * (self._run.baseline_s or 0.0) / step) * step
        why = self._why_not(took, took_s, limit_s)
        if why:
            return self._not_judged(f"not judged: {why}")
        ok = took_s is not None and took_s <= limit_s
        return CheckResult(self.name, ok, f"{took}; at most {limit_s:g} s are allowed")

    def _good(self) -> str:
        return ""

    def _stays_away(self, row: RobotTick) -> bool:
        """Return True if a robot is spare and has not joined."""
        return row.status is Status.ABSENT and row.number in self._spares

    def _why_not(self, took: str, took_s: float | None, limit_s: float) -> str:
        """Why recovery cannot be judged, empty when it can."""
        healed = self._healed
        asked = [event.k for event in self._run.journal.events if event.kind == FAULT_EVENT]
        why = ""
        if healed is None:
            why = "a fault lasts to the end"
        elif asked and asked[-1] > healed:
            why = f"a fault was added at tick {asked[-1]}"
        elif self._last < healed:
            why = "the run ended before all faults were over"
        elif self._missing:
            why = f"{self._missing} at the end, after all faults"
        elif self._run.baseline_s is None:
            why = f"{took}; there is no fault-free run to compare with"
        elif took_s is None and (self._last - self._whole_at) * self._run.step < limit_s:
            why = f"the run goes on for less than {limit_s:g} s after the faults, {WITHIN:g} x the fault-free MFoW"
        return why
