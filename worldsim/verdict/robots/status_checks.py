"""The verdict's checks of robots' statuses: that they follow from the faults, and what robots that are not alive do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from patrol.faults.kinds import Pause
from patrol.journal import Status, TickRecord
from patrol.journal.links import links_of
from patrol.journal.records import FORGED
from worldsim.faults import LOOKED_AT, STOPPED, UNSEEN
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from patrol.journal import RobotTick
    from worldsim.verdict.common.check import JudgedRun, Readings

_STATUSES = {status.name.lower() for status in Status}


class NobodyLost(Check):
    """No robot died without a fault that asked for it."""

    name = "nobody lost"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.names
        self._lost: dict[int, str] = {}

    def _tick(self, record: TickRecord) -> None:
        for robot in record.robots:
            if robot.status is Status.LOST and robot.number not in self._lost:
                self._lost[robot.number] = f"{self._names.get(robot.number, robot.number)} at tick {record.k}"

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        reported = {
            event.robot: f"{self._names[event.robot]} at tick {event.k} ({event.detail})"
            for event in self._run.journal.events
            if event.kind == Status.LOST.name.lower() and event.robot in self._names
        }
        details = "; ".join({**self._lost, **reported}.values())
        if details:
            self._fail(f"lost: {details}")
        return super().result()

    def _good(self) -> str:
        return "nobody"


class StatusesFollow(Check):
    """Each robot is alive, paused, dead, absent or gone when the faults make it so, and at no other time."""

    name = "statuses"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._expected = readings[ExpectedStatuses]
        self._changes = 0
        self._before: tuple[Status, ...] = ()

    def _tick(self, record: TickRecord) -> None:
        self._fail(self._expected.problem)
        statuses = tuple(row.status for row in record.robots)
        self._changes += sum(new is not old for new, old in zip(statuses, self._before or statuses, strict=True))
        self._before = statuses

    def _good(self) -> str:
        return f"{self._changes} changes as planned"


class DownAreSilent(Check):
    """A robot that is dead, paused, or not there neither sends, hears nor decides, from that tick on."""

    name = "the down are silent"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.names
        self._looked = 0

    def _tick(self, record: TickRecord) -> None:
        down = {row.number: row for row in record.robots if row.status is not Status.ALIVE}
        self._looked += len(down)
        if not down:
            return
        does = [(source, "sends") for source, _ in record.frames if source != FORGED]
        hearing = np.unique(links_of(record.deliveries).destination).tolist()
        does += [(destination, "hears") for destination in hearing]
        does += [(number, "decides") for number, row in down.items() if _has_decided(row)]
        for number, what in does:
            if number in down:
                status = down[number].status.name.lower()
                self._fail(f"{self._names.get(number, number)} is {status} at tick {record.k} and {what}")
                return

    def _good(self) -> str:
        return f"in {self._looked} ticks of robots"


def _has_decided(row: RobotTick) -> bool:
    """Return True if a row holds anything of a robot's reply."""
    reported = (row.goal, row.decision_ms, row.rejected)
    return bool(row.state) or row.refused or any(value is not None for value in reported)


class PausedStandStill(Check):
    """Every process that was to be paused was seen to be stopped, when its pause began and when a resume ended it.

    A world that only ignored the process in between would leave the same journal otherwise.
    """

    name = "the paused stand still"

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a fault pauses robots."""
        return any(isinstance(entry.fault, Pause) for entry in run.timeline.entries)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        names = self._run.names
        if not self._run.processes:
            return self._not_judged("the run had no processes")
        looks = self._looks()
        wrong = [
            f"{names.get(robot, robot)} was paused {to} tick {k}, but {seen or 'its process was not inspected'}"
            for k, robot, to, seen in looks
            if seen not in (STOPPED, UNSEEN)
        ]
        if wrong:
            return CheckResult(self.name, False, "; ".join(wrong))
        unseen = sum(seen == UNSEEN for *_, seen in looks)
        if unseen:
            return self._not_judged(f"in {unseen} of {len(looks)} inspections the state of the process was unknown")
        return CheckResult(self.name, True, f"{len(looks)} inspections found the process stopped")

    def _good(self) -> str:
        return ""

    def _looks(self) -> list[tuple[int, int, str, str]]:
        """Tick and robot of each beginning ("at") and end ("until") of a pause, and what was seen of the process."""
        looks: list[tuple[int, int, str, str]] = []
        status: dict[int, str] = {}
        paused, alive = Status.PAUSED.name.lower(), Status.ALIVE.name.lower()
        for event in self._run.journal.events:
            if event.robot is None:
                continue
            if event.kind == LOOKED_AT and looks and (*looks[-1][:2], looks[-1][3]) == (event.k, event.robot, ""):
                looks[-1] = (*looks[-1][:3], event.detail)
            if event.kind == paused:
                looks.append((event.k, event.robot, "at", ""))
            elif event.kind == alive and status.get(event.robot) == paused:
                looks.append((event.k, event.robot, "until", ""))
            if event.kind in _STATUSES:
                status[event.robot] = event.kind
        return looks
