"""The check that the other checks build on: that a journal's ticks hold the scenario's robots."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from worldsim.verdict.common.check import Check

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class RobotsThere(Check):
    """Every tick holds the scenario's robots, in roster order, each somewhere on the terrain.

    Checks that compute from poses need this one: they get no more ticks once it has failed.
    """

    name = "robots there"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._terrain = run.prepared.terrain
        self._roster = [spec.number for spec in run.prepared.scenario.roster]
        self._names = [spec.name for spec in run.prepared.scenario.roster]

    @property
    def usable(self) -> bool:
        """True if nothing was wrong so far."""
        return not self._problem

    def _tick(self, record: TickRecord) -> None:
        if [row.number for row in record.robots] != self._roster:
            self._fail(f"tick {record.k} does not hold the scenario's robots")
            return
        for name, row in zip(self._names, record.robots, strict=True):
            if not (self._terrain.contains(row.x, row.y) and math.isfinite(row.heading)):
                where = f"({row.x}, {row.y}; {row.heading} rad)"
                self._fail(f"{name} is not on the terrain at tick {record.k}: {where}")
                return

    def _good(self) -> str:
        return f"all {len(self._roster)} robots in every tick"
