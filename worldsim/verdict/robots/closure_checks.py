"""The verdict's check of closures: nobody enters them, and they close and open as the scenario asks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from patrol.random import Purpose, draw
from patrol.scenario.faults.kinds import Close, OnClosure
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses
from worldsim.verdict.robots.zone_checks import is_inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from patrol.journal import RobotTick, TickRecord
    from patrol.scenario import ClosureSpec
    from worldsim.verdict.common.check import JudgedRun, Readings

SLACK = 1e-6
"""Depth (m) of a body in a closure from which on it is in it."""


class ClosuresKept(Check):
    """No body is in a closure that is closed, by its polygon, and each closes and opens when it is to.

    The times are recomputed from the scenario and its faults, operators' included. A closure may close later than it is
    to as long as a body is in its way: no farther from the polygon than its radius and the diagonal of a point, by
    which the closed points may reach beyond the polygon.
    """

    name = "closures"
    needs = (RobotsThere, ExpectedStatuses, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._expected = readings[ExpectedStatuses]
        self._closed = readings[ClosedGround].closed
        self._specs = scenario.closures
        self._corners = [np.array(closure.polygon, dtype=np.float64) for closure in scenario.closures]
        self._seed = scenario.seed
        self._radii = {spec.number: spec.radius for spec in scenario.roster}
        self._names = run.names
        self._diagonal = math.sqrt(2.0) * scenario.point
        self._by_draws = [False] * len(self._specs)
        self._faults = [(entry, entry.fault) for entry in run.timeline.entries if isinstance(entry.fault, OnClosure)]
        self._was_closed: set[str] = set()
        self._turns = self._ticks = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has closures."""
        return bool(run.prepared.scenario.closures)

    def _tick(self, record: TickRecord) -> None:
        here = [robot for robot in record.robots if robot.number not in self._expected.away]
        self._ticks += 1
        for number, (spec, corners) in enumerate(zip(self._specs, self._corners, strict=True)):
            wanted = self._is_wanted(number, spec, record.k)
            is_closed = spec.name in self._closed.names
            self._turns += is_closed != (spec.name in self._was_closed)
            if is_closed and not wanted:
                self._fail(f"{spec.name} is closed at tick {record.k}, when it is to be open")
            elif wanted and not is_closed:
                late = spec.name not in self._was_closed and any(
                    _gap(corners, robot) < self._radii[robot.number] + self._diagonal for robot in here
                )
                if not late:
                    self._fail(f"{spec.name} is open at tick {record.k}, when it is to be closed and nobody is in it")
            if is_closed:
                for robot in here:
                    if _gap(corners, robot) < self._radii[robot.number] - SLACK:
                        where = f"({robot.x:.3f}, {robot.y:.3f})"
                        name = self._names[robot.number]
                        self._fail(f"{name} is in {spec.name} at tick {record.k}, which is closed, at {where}")
        self._was_closed = set(self._closed.names)

    def _is_wanted(self, number: int, spec: ClosureSpec, k: int) -> bool:
        step = self._run.step
        rate = (spec.opens if self._by_draws[number] else spec.closes) or 0.0
        self._by_draws[number] ^= 1.0 - draw(self._seed, Purpose.CLOSURE, number, k) > math.exp(-rate * step)
        newest, decides = -1, None
        for entry, fault in self._faults:
            in_force = entry.begin <= k and (entry.end is None or entry.end > k)
            if in_force and fault.closure == spec.name and entry.begin >= newest:
                newest, decides = entry.begin, fault
        if decides is not None:
            return isinstance(decides, Close)
        if spec.closed is not None:
            begun = [first for first, _ in spec.closed if first <= k * step]
            ended = [end for _, end in spec.closed if end <= k * step]
            return len(begun) > len(ended)
        return self._by_draws[number]

    def _good(self) -> str:
        return f"{len(self._specs)} closures closed or opened {self._turns} times in {self._ticks} ticks, as asked"


def _gap(corners: NDArray[np.float64], robot: RobotTick) -> float:
    """Return the distance of a body's centre from a polygon, m; 0 inside."""
    if is_inside(corners, robot.x, robot.y):
        return 0.0
    here = np.array((robot.x, robot.y))
    side = np.roll(corners, -1, axis=0) - corners
    square = np.maximum((side**2).sum(axis=1), 1e-18)
    share = np.clip(((here - corners) * side).sum(axis=1) / square, 0.0, 1.0)
    return float(np.hypot(*(corners + share[:, None] * side - here).T).min())
