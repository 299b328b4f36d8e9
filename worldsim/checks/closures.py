"""The verdict's check of closures, by their polygons instead of the grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from patrol.changing.ground import IN_IT, WAITING, WAITS, part_of
from patrol.faults.kinds import Close, OnGround
from patrol.journal import RobotTick, TickRecord
from patrol.journal.records import CLOSED, OPENED, STAYS_OPEN
from patrol.random import Purpose, draw
from worldsim.checks.check import Check, active
from worldsim.checks.ground import ClosedGround
from worldsim.checks.places import is_inside, is_within
from worldsim.checks.statuses import ExpectedStatuses

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from patrol.closures.spec import ClosureSpec
    from patrol.journal import Event
    from worldsim.checks.check import JudgedRun

SLACK_M = 1e-6
"""Depth in a closure from which on a body is in it, m."""


class ClosuresKept(Check):
    """No body is in a closure that is closed, by its polygon, and each closes and opens when it is to.

    The times are recomputed from the scenario and its faults, operators' included. A closure may close later than it is
    to as long as a body is in its way: no farther from the polygon than its radius and the diagonal of a point, by
    which the closed points may reach beyond the polygon. Each change of a closure is one event.
    """

    name = "closures"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        scenario = run.prepared.scenario
        self._expected = run.reading(ExpectedStatuses)
        self._ground = run.reading(ClosedGround)
        self._closed = self._ground.closed
        self._closures = scenario.closures
        self._corners = {spec.name: np.array(spec.polygon, dtype=np.float64) for spec in scenario.closures}
        self._diagonal = math.sqrt(2.0) * scenario.point
        self._by_draws = [False] * len(self._closures)
        self._faults = [(entry, entry.fault) for entry in run.timeline.entries if isinstance(entry.fault, OnGround)]
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
        for number, spec in enumerate(self._closures):
            wanted = self._is_wanted(number, spec, record.k)
            is_closed = spec.name in self._closed.names
            self._turns += is_closed != (spec.name in self._was_closed)
            if is_closed and not wanted:
                self._fail(f"{spec.name} is closed at tick {record.k}, when it is to be open")
            waits_for: list[RobotTick] = []
            if wanted and not is_closed:
                waits_for = [robot for robot in here if self._measure_depth(robot, spec.name) > -self._diagonal]
                if spec.name in self._was_closed or not waits_for:
                    self._fail(f"{spec.name} is open at tick {record.k}, when it is to be closed and nobody is in it")
            if is_closed:
                for robot in here:
                    # The check is by the polygon, though closed points reach a little beyond it.
                    if self._measure_depth(robot, spec.name) > SLACK_M:
                        where = f"({robot.x:.3f}, {robot.y:.3f})"
                        name = self._name(robot.number)
                        self._fail(f"{name} is in {spec.name} at tick {record.k}, which is closed, at {where}")
            self._check_events(spec.name, record.k, is_closed, waits_for)
        self._was_closed, self._was_waiting = set(self._closed.names), set(self._closed.waiting)

    def _check_events(self, name: str, k: int, is_closed: bool, waits_for: Sequence[RobotTick]) -> None:
        """Check that the events of a closure before a tick are those that its change calls for."""
        events = [event for event in self._ground.ground_events if part_of(event) == name]
        was_closed, was_waiting = name in self._was_closed, name in self._was_waiting
        if is_closed != was_closed:
            expected_kind = CLOSED if is_closed else OPENED
        elif bool(waits_for) != was_waiting:
            expected_kind = WAITING if waits_for else STAYS_OPEN
        else:
            expected_kind = ""
        if [event.kind for event in events] != [expected_kind] * bool(expected_kind):
            kinds = " and ".join(event.kind for event in events) or "nothing"
            self._fail(
                f"before tick {k} the journal has {kinds} of {name}, and should have {expected_kind or 'nothing'}"
            )
        elif expected_kind == WAITING and not self._names_robots_inside(events[0], name, waits_for):
            self._fail(f"before tick {k}, {events[0].detail}: these are not the robots that stand there")

    def _names_robots_inside(self, event: Event, name: str, near: Sequence[RobotTick]) -> bool:
        """Return True if an event names all robots in a closure, and no others but near ones, in their order."""
        listed = event.detail.removeprefix(f"{name}{WAITS}").removesuffix(IN_IT).split(", ")
        named = [robot for robot in near if self._name(robot.number) in listed]
        return (
            bool(named)
            and event.detail == f"{name}{WAITS}{', '.join(self._name(robot.number) for robot in named)}{IN_IT}"
            and event.robot == named[0].number
            and all(robot in named for robot in near if self._measure_depth(robot, name) > SLACK_M)
        )

    def _measure_depth(self, robot: RobotTick, name: str) -> float:
        """Return how far a body reaches into a closure, m."""
        return self._specs[robot.number].radius - _measure_gap(self._corners[name], robot)

    def _is_wanted(self, number: int, spec: ClosureSpec, k: int) -> bool:
        rate = (spec.opens if self._by_draws[number] else spec.closes) or 0.0
        drawn = draw(self._run.prepared.scenario.seed, Purpose.GROUND, number, k)
        # One draw a tick and closure, in any case, so that faults do not change what comes after them.
        self._by_draws[number] ^= 1.0 - drawn > math.exp(-rate * self._step)
        in_force = [(e.begin, e.index, f) for e, f in self._faults if active(e, k) and f.part == spec.name]
        if in_force:
            return isinstance(max(in_force)[-1], Close)
        return self._by_draws[number] if spec.closed is None else is_within(spec.closed, k * self._step)

    def _end(self) -> str:
        return f"{len(self._closures)} closures closed or opened {self._turns} times in {self._ticks} ticks, as asked"


def _measure_gap(corners: NDArray[np.float64], robot: RobotTick) -> float:
    """Return the distance of a body's centre from a polygon, m; 0 inside.

    For example, 0.5 for a centre at (1.5, 0.5) beside the square from (0, 0) to (1, 1).
    """
    if is_inside(corners, robot.x, robot.y):
        return 0.0
    here = np.array((robot.x, robot.y))
    side = np.roll(corners, -1, axis=0) - corners
    # Two corners at the same place make a side without length.
    square = np.maximum((side**2).sum(axis=1), 1e-18)
    share = np.clip(((here - corners) * side).sum(axis=1) / square, 0.0, 1.0)
    return float(np.hypot(*(corners + share[:, None] * side - here).T).min())
