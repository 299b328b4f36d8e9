"""The verdict's look at robots whose moves are cancelled often, because they would touch something."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from patrol.journal import Status
from worldsim.verdict.common.check import Check, CheckResult

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings

BUMPS_A_MINUTE = 0.5
LEAST_BUMPS = 5
"""A robot bumps often if its moves are cancelled more often than this, and at least so many times in the run.

The rate lies between the two columns of bumps in docs/results/swaps.md, a minute and robot: at most 0.25 where robots
keep right (one row: 0.7), and 0.5 to 10 in the same patrols before they did (one row: 0). The least number spares a
short run the warning for a single meeting in a door, which may cost a few bumps.
"""


class BumpsRare(Check):
    """Warns of robots that bump often.

    A world lets no bodies overlap, so the run's numbers are right; but the robots would have touched each other, or a
    wall, at the speed at which they drove. So this check fails no run.
    """

    name = "bumps"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._alive: Counter[int] = Counter()
        self._bumps: Counter[int] = Counter()

    def _tick(self, record: TickRecord) -> None:
        self._alive.update(row.number for row in record.robots if row.status is Status.ALIVE)
        self._bumps.update(row.number for row in record.robots if row.bumped)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        often = []
        for number, name in self._run.names.items():
            bumps, minutes = self._bumps[number], self._alive[number] * self._run.step / 60.0
            if bumps >= LEAST_BUMPS and bumps > BUMPS_A_MINUTE * minutes:
                often.append(f"{name} {bumps / minutes:.1f} a minute, {bumps} times in all")
        if not often:
            return CheckResult(self.name, True, self._good())
        line = f"robots bumped often, so that moves were cancelled: {'; '.join(often)}"
        return CheckResult(self.name, True, line, warnings=(line,))

    def _good(self) -> str:
        return f"{self._bumps.total()} moves were cancelled"
