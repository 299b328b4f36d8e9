"""The verdict's check of closures: nobody enters them, and they close and open as the scenario asks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from patrol.closures.points import IN_IT, WAITING, WAITS, closure_of
from patrol.faults.kinds import Close, OnClosure
from patrol.journal.records import CLOSED, OPENED, STAYS_OPEN
from patrol.random import Purpose, draw
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses
from worldsim.verdict.robots.zone_checks import is_inside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from patrol.journal import Event, RobotTick, TickRecord
    from patrol.scenario import ClosureSpec
    from worldsim.verdict.common.check import JudgedRun, Readings

SLACK = 1e-6
"""Depth (m) of a body in a closure from which on it is in it."""


class ClosuresKept(Check):
    """No body is in a closure that is closed, by its polygon, and each closes and opens when it is to.

    The times are recomputed from the scenario and its faults, operators' included. A closure may close later than it is
    to as long as a body is in its way: no farther from the polygon than its radius and the diagonal of a point, by
    which the closed points may reach beyond the polygon. Each change of a closure is one event.
    """

    name = "closures"
    needs = (RobotsThere, ExpectedStatuses, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._expected = readings[ExpectedStatuses]
        self._ground = readings[ClosedGround]
        self._closed = self._ground.closed
        self._specs = scenario.closures
        self._corners = {spec.name: np.array(spec.polygon, dtype=np.float64) for spec in scenario.closures}
        self._seed = scenario.seed
        self._radii = {spec.number: spec.radius for spec in scenario.roster}
        self._names = run.names
        self._diagonal = math.sqrt(2.0) * scenario.point
        self._by_draws = [False] * len(self._specs)
        self._faults = [(entry, entry.fault) for entry in run.timeline.entries if isinstance(entry.fault, OnClosure)]
        self._was_closed: set[str] = set()
        self._was_waiting: set[str] = set()
        self._turns = self._ticks = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has closures."""
        return bool(run.prepared.scenario.closures)

    def _tick(self, record: TickRecord) -> None:
        here = [robot for robot in record.robots if robot.number not in self._expected.away]
        self._ticks += 1
        for number, spec in enumerate(self._specs):
            wanted = self._is_wanted(number, spec, record.k)
            is_closed = spec.name in self._closed.names
            self._turns += is_closed != (spec.name in self._was_closed)
            if is_closed and not wanted:
                self._fail(f"{spec.name} is closed at tick {record.k}, when it is to be open")
            waits_for: list[RobotTick] = []
            if wanted and not is_closed:
                waits_for = [robot for robot in here if self._depth(robot, spec.name) > -self._diagonal]
                if spec.name in self._was_closed or not waits_for:
                    self._fail(f"{spec.name} is open at tick {record.k}, when it is to be closed and nobody is in it")
            if is_closed:
                for robot in here:
                    if self._depth(robot, spec.name) > SLACK:
                        where = f"({robot.x:.3f}, {robot.y:.3f})"
                        name = self._names[robot.number]
                        self._fail(f"{name} is in {spec.name} at tick {record.k}, which is closed, at {where}")
            self._check_events(spec.name, record.k, is_closed, waits_for)
        self._was_closed, self._was_waiting = set(self._closed.names), set(self._closed.waiting)

    def _check_events(self, name: str, k: int, is_closed: bool, waits_for: Sequence[RobotTick]) -> None:
        """Check that the events of a closure before a tick are those that its change calls for."""
        events = [event for event in self._ground.closure_events if closure_of(event) == name]
        was_closed, was_waiting = name in self._was_closed, name in self._was_waiting
        if is_closed != was_closed:
            due = CLOSED if is_closed else OPENED
        elif bool(waits_for) != was_waiting:
            due = WAITING if waits_for else STAYS_OPEN
        else:
            due = ""
        if [event.kind for event in events] != [due] * bool(due):
            kinds = " and ".join(event.kind for event in events) or "nothing"
            self._fail(f"before tick {k} the journal has {kinds} of {name}, and should have {due or 'nothing'}")
        elif due == WAITING and not self._names_who_waits(events[0], name, waits_for):
            self._fail(f"before tick {k}, {events[0].detail}: these are not the robots that stand there")

    def _names_who_waits(self, event: Event, name: str, near: Sequence[RobotTick]) -> bool:
        """Return True if an event names all robots in a closure, and no others but near ones, in their order."""
        listed = event.detail.removeprefix(f"{name}{WAITS}").removesuffix(IN_IT).split(", ")
        named = [robot for robot in near if self._names[robot.number] in listed]
        return (
            bool(named)
            and event.detail == f"{name}{WAITS}{', '.join(self._names[robot.number] for robot in named)}{IN_IT}"
            and event.robot == named[0].number
            and all(robot in named for robot in near if self._depth(robot, name) > SLACK)
        )

    def _depth(self, robot: RobotTick, name: str) -> float:
        """Return how far a body reaches into a closure, m."""
        return self._radii[robot.number] - _gap(self._corners[name], robot)

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
