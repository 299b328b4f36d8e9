"""The robots that should be alive, paused, dead or away in each tick, by faults and records alone; and their events."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from patrol.exchange import FIRST_INCARNATION
from patrol.faults.kinds import Kill, OnProcesses, Pause
from patrol.journal import Event, RobotTick, Status, TickRecord
from patrol.pose import Pose
from worldsim.faults import APPLIES, AS_IT_IS, BECOMES, BEING_STARTED, SKIPPED, WAITING, Act
from worldsim.robots.bodies import overlap
from worldsim.verdict.common.check import JournalReading
from worldsim.verdict.common.faults import absent_at_first
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun, Readings


class ExpectedStatuses(JournalReading):
    """The statuses that a run's robots should have, tick by tick.

    In lockstep a robot that is started takes part at once, or as soon as its place is free. At any other pace the world
    waits for no process, and it may do so later. Lost robots were not planned; another check reports them.

    After each tick `away` has the numbers of the robots whose bodies are not in the world, and `appeared` of those that
    came back at their starts for this tick. `problem` is what is wrong with this tick's statuses, or empty; from then
    on they are taken as they are. `events` are the events of robots before this tick, in order, without those of lost
    robots. `may_wait` are further events that are allowed at a pace: nothing else shows when a process came that then
    had to wait for its place.
    """

    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self.away: set[int] = set()
        self.appeared: set[int] = set()
        self.problem = ""
        self.events: list[Event] = []
        self.may_wait: list[Event] = []
        self._k = 0
        self._entries = [entry for entry in run.timeline.entries if isinstance(entry.fault, OnProcesses)]
        self._waits = scenario.factor is None
        self._specs = {spec.number: spec for spec in scenario.roster}
        self._starts = {spec.number: pose for spec, pose in zip(scenario.roster, run.prepared.starts, strict=True)}
        self._status = dict.fromkeys(self._specs, Status.ALIVE)
        self._incarnations = dict.fromkeys(self._specs, FIRST_INCARNATION)
        self._coming: dict[int, str] = {}
        self._waiting: set[int] = set()
        for number in absent_at_first(run.timeline) | scenario.spares:
            self._status[number] = Status.ABSENT
            self._incarnations[number] -= 1
            self.away.add(number)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        rows = {row.number: row for row in record.robots}
        self.appeared.clear()
        self.problem = ""
        self._k, self.events, self.may_wait = record.k, [], []
        for number, row in rows.items():
            if row.status is Status.LOST and number not in self._coming:
                self._status[number] = Status.LOST
        for act in self._acts(record.k):
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

    def _acts(self, k: int) -> Iterator[Act]:
        """Yield the acts on robots before a tick, by the ticks and robots of the faults."""
        for entry in self._entries:
            if entry.begin == k:
                wreck = entry.fault.wreck if isinstance(entry.fault, Kill) else "stays"
                yield from (Act(entry.fault.kind, number, entry.id, wreck) for number in entry.who)  # type: ignore[arg-type]
            if isinstance(entry.fault, Pause) and entry.end == k:
                yield from (Act("resume", number, entry.id) for number in entry.who)

    def _act(self, act: Act) -> None:
        number, reason = act.number, f"{act.fault} {act.kind}"
        status = self._status[number]
        if number in self._coming or status not in APPLIES[act.kind]:
            state = BEING_STARTED if number in self._coming else AS_IT_IS[status]
            self._tell(SKIPPED, number, f"{reason}: {self._specs[number].name} is {state}")
            return
        if act.kind not in ("restart", "join"):
            self._become(number, BECOMES[act.kind], reason)
            if act.kind == "leave" or act.wreck == "removed":
                self.away.add(number)
            return
        if act.kind == "restart" and status is not Status.DEAD:
            self._become(number, Status.DEAD, reason)
        self._incarnations[number] += 1
        self._coming[number] = f"{reason}: process {self._incarnations[number]}"

    def _become(self, number: int, status: Status, reason: str) -> None:
        self._status[number] = status
        self._tell(status.name.lower(), number, reason)

    def _tell(self, kind: str, number: int, detail: str) -> None:
        self.events.append(Event(self._k, kind, number, detail))

    def _bring_in(self, number: int, rows: Mapping[int, RobotTick]) -> None:
        """A robot that was started takes part, unless it cannot yet."""
        if rows[number].status is Status.LOST:
            del self._coming[number]
            self._status[number] = Status.LOST
            return
        has_come = self._waits or rows[number].status is Status.ALIVE
        if in_the_way := self._in_the_way(number, rows):
            waits = Event(self._k, WAITING, number, f"its start is taken by {', '.join(in_the_way)}")
            if has_come and number not in self._waiting:
                self._waiting.add(number)
                self.events.append(waits)
            elif not has_come:
                self.may_wait.append(waits)
        elif has_come:
            self._waiting.discard(number)
            self._become(number, Status.ALIVE, self._coming.pop(number))
            if number in self.away:
                self.away.remove(number)
                self.appeared.add(number)

    def _in_the_way(self, number: int, rows: Mapping[int, RobotTick]) -> list[str]:
        """Return the names of the robots that stand where the robot is to appear, if it has to appear."""
        if number not in self.away:
            return []
        start, radius = self._starts[number], self._specs[number].radius
        return [
            self._specs[other].name
            for other, row in rows.items()
            if other != number
            and other not in self.away
            and overlap(start, radius, Pose(row.x, row.y, row.heading), self._specs[other].radius)
        ]

    def _take_as_it_is(self, number: int, status: Status) -> None:
        self._status[number] = status
        self._coming.pop(number, None)
        if status in (Status.ABSENT, Status.LEFT):
            self.away.add(number)
        elif number in self.away and status is Status.ALIVE:
            self.away.remove(number)
            self.appeared.add(number)
