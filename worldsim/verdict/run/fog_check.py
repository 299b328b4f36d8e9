"""The verdict's check of the fog."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worldsim.verdict.common.check import Check
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.common.true_fog import TrueFog

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class FogIsTrue(Check):
    """MFoW, mean fog and points seen are what the poses give, recomputed from the beginning."""

    name = "fog"
    needs = (RobotsThere, TrueFog)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._fog = readings[TrueFog].fog
        self._ticks = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the fog is to be verified."""
        return run.verify_fog

    def _tick(self, record: TickRecord) -> None:
        self._ticks += 1
        fog, step = self._fog, self._run.step
        found = (fog.mfow(record.k), fog.mean(record.k), fog.seen)
        recorded = (record.mfow, record.fog_mean, record.seen)
        if found != recorded:
            shown = [f"MFoW {m * step:g} s, mean {a * step:g} s, {n} seen" for m, a, n in (found, recorded)]
            self._fail(f"tick {record.k}: the poses give {shown[0]}; recorded is {shown[1]}")

    def _good(self) -> str:
        return f"recomputed over {self._ticks} ticks"
