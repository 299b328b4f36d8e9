"""The verdict's check of the fog."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.common.true_fog import TrueFog

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class FogIsTrue(Check):
    """MFoW, mean fog and points seen are what the poses give, recomputed from the beginning.

    A fog keeps sums from look to look; those of the last tick are also counted point by point.
    """

    name = "fog"
    needs = (RobotsThere, TrueFog)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._fog = readings[TrueFog].fog
        self._ticks = 0
        self._last: TickRecord | None = None

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the fog is to be verified."""
        return run.verify_fog

    def _tick(self, record: TickRecord) -> None:
        self._ticks += 1
        self._last = record
        fog = self._fog
        self._compare(record, (fog.mfow(record.k), fog.mean(record.k), fog.seen))

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        if self._last is not None and not self._problem:
            k, seen_at = self._last.k, self._fog.last_seen[self._fog.patrolled != 0]
            since = np.maximum(seen_at, 0)
            mean = k - int(since.sum(dtype=np.int64)) / since.size
            self._compare(self._last, (k - int(since.min()), mean, int(np.count_nonzero(seen_at >= 0))))
        return super().result()

    def _compare(self, record: TickRecord, figures: tuple[int, float, int]) -> None:
        step, recorded = self._run.step, (record.mfow, record.fog_mean, record.seen)
        if figures != recorded:
            shown = [f"MFoW {m * step:g} s, mean {a * step:g} s, {n} seen" for m, a, n in (figures, recorded)]
            self._fail(f"tick {record.k}: the poses give {shown[0]}; recorded is {shown[1]}")

    def _good(self) -> str:
        return f"recomputed over {self._ticks} ticks"
