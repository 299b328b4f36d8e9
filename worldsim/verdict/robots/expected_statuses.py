"""The robots that should be alive, paused, dead or away in each tick, by faults and records alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import Pose
from worldsim.faults.lifecycle import APPLIES
from worldsim.robots.bodies import overlap
from worldsim.verdict.common.check import JournalReading
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from worldsim.faults.timeline import Act
    from worldsim.verdict.common.check import JudgedRun, Readings


class ExpectedStatuses(JournalReading):
    """The statuses that a run's robots should have, tick by tick.

    In lockstep a robot that is started takes part at once, or as soon as its place is free. At any other pace the world
    waits for no process, and it may do so later. Lost robots were not planned; another check reports them.

    Attributes:
        away: Numbers of the robots whose bodies are not in the world.
        appeared: Numbers of those that came back at their starts for this tick.
        problem: What is wrong with this tick's statuses, or nothing; from then on they are taken as they are.
    """

    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self.away: set[int] = set()
        self.appeared: set[int] = set()
        self.problem = ""
        self._timeline = run.timeline
        self._waits = scenario.factor is None
        self._specs = {spec.number: spec for spec in scenario.roster}
        self._starts = {spec.number: pose for spec, pose in zip(scenario.roster, run.prepared.starts, strict=True)}
        self._status = dict.fromkeys(self._specs, Status.ALIVE)
        self._coming: list[int] = []
        for number in self._timeline.starts_absent:
            self._status[number] = Status.ABSENT
            self.away.add(number)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick.

        Args:
            record: The tick's record.
        """
        rows = {row.number: row for row in record.robots}
        self.appeared.clear()
        self.problem = ""
        for number, row in rows.items():
            if row.status is Status.LOST and number not in self._coming:
                self._status[number] = Status.LOST
        for act in self._timeline.acts(record.k):
            self._act(act)
        for number in list(self._coming):
            self._bring_in(number, rows)
        for number, row in rows.items():
            due = self._status[number]
            if row.status is not due:
                if not self.problem:
                    name, found = self._specs[number].name, row.status.name.lower()
                    self.problem = f"{name} is {found} at tick {record.k}, but should be {due.name.lower()}"
                self._take_as_it_is(number, row.status)

    def _act(self, act: Act) -> None:
        number = act.number
        if number in self._coming or self._status[number] not in APPLIES[act.kind]:
            return
        match act.kind:
            case "kill":
                self._status[number] = Status.DEAD
                if act.wreck == "removed":
                    self.away.add(number)
            case "pause":
                self._status[number] = Status.PAUSED
            case "resume":
                self._status[number] = Status.ALIVE
            case "leave":
                self._status[number] = Status.LEFT
                self.away.add(number)
            case "restart":
                self._status[number] = Status.DEAD
                self._coming.append(number)
            case "join":
                self._coming.append(number)

    def _bring_in(self, number: int, rows: Mapping[int, RobotTick]) -> None:
        """A robot that was started takes part, unless it cannot yet."""
        if rows[number].status is Status.LOST:
            self._coming.remove(number)
            self._status[number] = Status.LOST
        elif (self._waits or rows[number].status is Status.ALIVE) and self._has_room(number, rows):
            self._coming.remove(number)
            self._status[number] = Status.ALIVE
            if number in self.away:
                self.away.remove(number)
                self.appeared.add(number)

    def _has_room(self, number: int, rows: Mapping[int, RobotTick]) -> bool:
        """Return True if the place where the robot is to appear is free, if it has to appear."""
        if number not in self.away:
            return True
        start, radius = self._starts[number], self._specs[number].radius
        return not any(
            overlap(start, radius, Pose(row.x, row.y, row.heading), self._specs[other].radius)
            for other, row in rows.items()
            if other != number and other not in self.away
        )

    def _take_as_it_is(self, number: int, status: Status) -> None:
        self._status[number] = status
        if number in self._coming:
            self._coming.remove(number)
        if status in (Status.ABSENT, Status.LEFT):
            self.away.add(number)
        elif number in self.away and status is Status.ALIVE:
            self.away.remove(number)
            self.appeared.add(number)
