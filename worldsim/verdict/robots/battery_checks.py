"""The verdict's check of batteries: the charge recomputed from commands and places, and batteries that got empty.

It does not use `patrol.energy.batteries`, by which the world keeps the charge.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import command_of
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun, Readings

NOTHING_J = 1e-3
"""What is left in a battery that is empty, at most, J."""

DIGITS = 6
"""Decimals of a distance to a dock, m: the last bit of a distance does not decide which of two robots is nearer."""

_ON = (Status.ALIVE, Status.PAUSED)


class BatteriesLast(Check):
    """A robot drives only while there is charge in its battery; one whose battery gets empty is named.

    That a battery gets empty is no error of the run: its numbers are right, and the robot stands from then on. So it is
    a warning.
    """

    name = "batteries"
    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._names = run.names
        self._step = run.step
        self._places = np.array([dock.place for dock in scenario.docks], dtype=np.float64).reshape(-1, 2)
        self._reaches = np.array([dock.radius for dock in scenario.docks], dtype=np.float64)
        robots = [(spec.number, spec.model, spec.battery) for spec in scenario.roster if spec.battery is not None]
        self._numbers = [number for number, _, _ in robots]
        self._models = {number: model for number, model, _ in robots}
        kinds = [battery for _, _, battery in robots]
        self._capacity = np.array([3600.0 * kind.capacity for kind in kinds])
        self._first = np.array([kind.start for kind in kinds]) * self._capacity
        self._per_s = np.array([kind.idle for kind in kinds])
        self._per_m = np.array([kind.drive for kind in kinds])
        self._gained_per_s = np.array([kind.charge for kind in kinds])
        self._left = self._first.copy()
        self._least = self._left / self._capacity
        self._was_on: NDArray[np.bool_] | None = None
        self._empty: dict[int, int] = {}

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a robot has a battery."""
        return any(spec.battery is not None for spec in run.prepared.scenario.roster)

    def _tick(self, record: TickRecord) -> None:
        by_number = {row.number: row for row in record.robots}
        rows = [by_number[number] for number in self._numbers]
        is_on = np.array([row.status in _ON for row in rows])
        if self._was_on is not None:
            returned = is_on & ~self._was_on
            self._left[returned] = self._first[returned]
        self._was_on = is_on
        ways = np.array([self._way_of(row) for row in rows])
        for wrong in np.flatnonzero((ways > 0.0) & is_on & (self._left < NOTHING_J)):
            self._fail(f"{self._names[self._numbers[wrong]]} drives at tick {record.k} although its battery is empty")
        change = np.where(is_on, -self._per_s * self._step - self._per_m * ways, 0.0)
        for at in self._charging(rows, is_on & (ways == 0.0)):
            change[at] += self._gained_per_s[at] * self._step
        before, self._left = self._left, np.minimum(self._left + change, self._capacity)
        self._left[self._left < NOTHING_J] = 0.0
        self._least = np.minimum(self._least, self._left / self._capacity)
        for emptied in np.flatnonzero((self._left == 0.0) & (before > 0.0)):
            self._empty.setdefault(self._numbers[emptied], record.k)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        warnings = tuple(
            f"the battery of {self._names[number]} was empty at tick {k} ({k * self._step:g} s)"
            for number, k in sorted(self._empty.items(), key=lambda pair: (pair[1], pair[0]))
        )
        detail = self._problem or "; ".join(warnings) or self._good()
        return CheckResult(self.name, not self._problem, detail, warnings=warnings)

    def _good(self) -> str:
        at = int(self._least.argmin())
        name, percent = self._names[self._numbers[at]], 100.0 * self._least[at]
        return f"none got empty; the least charge was {percent:.0f} %, of {name}"

    def _way_of(self, row: RobotTick) -> float:
        if row.bumped:
            return 0.0
        return command_of(self._models[row.number], row.c0, row.c1).speed_mps * self._step

    def _charging(self, rows: list[RobotTick], stands: NDArray[np.bool_]) -> set[int]:
        """Return the indices of the robots that docks charge: at each dock the nearest one that stands there."""
        if not len(self._places) or not stands.any():
            return set()
        spots = np.array([(row.x, row.y) for row in rows])
        away = np.hypot(spots[:, None, 0] - self._places[None, :, 0], spots[:, None, 1] - self._places[None, :, 1])
        away = away.round(DIGITS)
        away[~stands] = np.inf
        nearest = away.argmin(axis=0)
        return {int(at) for dock, at in enumerate(nearest) if away[at, dock] <= self._reaches[dock]}
