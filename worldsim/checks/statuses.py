"""The verdict's checks that statuses and events of robots follow from the faults, and that absent robots are silent."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from patrol.changing.ground import part_of
from patrol.exchange import FIRST_INCARNATION
from patrol.faults.kinds import Kill, OnProcesses, Pause
from patrol.journal import Event, Status
from patrol.journal.links import links_of
from patrol.journal.records import CLOSED, FORGED, IN_FORCE, OPENED, OUT_OF_FORCE, STAYS_OPEN
from patrol.scenario.controls import OPERATOR
from worldsim.checks.check import Check, JournalReading
from worldsim.faults import APPLIES, AS_IT_IS, BECOMES, BEING_STARTED, LOOKED_AT, SKIPPED, WAITING, Act

if TYPE_CHECKING:
    from patrol.journal import RobotTick, TickRecord
    from worldsim.checks.check import JudgedRun

_LOST, _ALIVE, _PAUSED = (status.name.lower() for status in (Status.LOST, Status.ALIVE, Status.PAUSED))


class ExpectedStatuses(JournalReading):
    """The statuses that a run's robots should have, tick by tick, by faults and records alone; and their events.

    In lockstep a robot that is started takes part at once, or as soon as its place is free. At any other pace the world
    waits for no process, and it may do so later. Lost robots were not planned; another check reports them.

    After each tick `away` has the numbers of the robots whose bodies are not in the world, and `appeared` of those that
    came back at their starts for this tick. `problem` is the error in this tick's statuses, or empty; from then
    on they are taken as they are. `events` are the events of robots before this tick, in order, without those of lost
    robots. `may_wait` are further events that are allowed at a pace: nothing else shows when a process came that then
    had to wait for its place.
    """

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        scenario = run.prepared.scenario
        self.away: set[int] = set(run.absent_at_first)
        self.appeared: set[int] = set()
        self.problem = ""
        self.events: list[Event] = []
        self.may_wait: list[Event] = []
        self._k = 0
        self._entries = run.entries(OnProcesses)
        self._waits = scenario.factor is None
        self._status = {number: Status.ABSENT if number in self.away else Status.ALIVE for number in self._specs}
        self._incarnations = {number: FIRST_INCARNATION - (number in self.away) for number in self._specs}
        self._coming: dict[int, str] = {}
        self._waiting: set[int] = set()

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        rows = {row.number: row for row in record.robots}
        self.appeared.clear()
        self.problem = ""
        self._k, self.events, self.may_wait = record.k, [], []
        # It was no fault's doing, so it is taken as it is; another check reports it.
        for number, row in rows.items():
            if row.status is Status.LOST and number not in self._coming:
                self._status[number] = Status.LOST
        for act in self._list_acts(record.k):
            self._apply_act(act)
        # A copy, since those that come are removed on the way.
        for number in list(self._coming):
            self._bring_in(number, rows)
        for number, row in rows.items():
            expected = self._status[number]
            if row.status is not expected:
                if not self.problem:
                    name, status = self._name(number), row.status.name.lower()
                    self.problem = f"{name} is {status} at tick {record.k}, but should be {expected.name.lower()}"
                self._take_as_it_is(number, row.status)

    def _list_acts(self, k: int) -> Iterator[Act]:
        """Yield the acts on robots before a tick, by the ticks and robots of the faults."""
        for entry in self._entries:
            if entry.begin == k:
                wreck = entry.fault.wreck if isinstance(entry.fault, Kill) else "stays"
                yield from (Act(entry.fault.kind, number, entry.id, wreck) for number in entry.who)
            if isinstance(entry.fault, Pause) and entry.end == k:
                yield from (Act("resume", number, entry.id) for number in entry.who)

    def _apply_act(self, act: Act) -> None:
        number, reason = act.number, f"{act.fault} {act.kind}"
        status = self._status[number]
        if number in self._coming or status not in APPLIES[act.kind]:
            state = BEING_STARTED if number in self._coming else AS_IT_IS[status]
            self._add_event(SKIPPED, number, f"{reason}: {self._name(number)} is {state}")
            return
        if act.kind not in ("restart", "join"):
            self._set_status(number, BECOMES[act.kind], reason)
            if act.kind == "leave" or act.wreck == "removed":
                self.away.add(number)
            return
        if act.kind == "restart" and status is not Status.DEAD:
            self._set_status(number, Status.DEAD, reason)
        self._incarnations[number] += 1
        self._coming[number] = f"{reason}: process {self._incarnations[number]}"

    def _set_status(self, number: int, status: Status, reason: str) -> None:
        self._status[number] = status
        self._add_event(status.name.lower(), number, reason)

    def _add_event(self, kind: str, number: int, detail: str) -> None:
        self.events.append(Event(self._k, kind, number, detail))

    def _bring_in(self, number: int, rows: Mapping[int, RobotTick]) -> None:
        """Let a robot that was started take part, unless it cannot yet."""
        if rows[number].status is Status.LOST:
            del self._coming[number]
            self._status[number] = Status.LOST
            return
        # At a pace only the row shows when a process came.
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
            self._set_status(number, Status.ALIVE, self._coming.pop(number))
            self._note_appearance(number)

    def _in_the_way(self, number: int, rows: Mapping[int, RobotTick]) -> list[str]:
        """Return the names of the robots that stand where the robot is to appear, if it has to appear."""
        start, radius = self._run.starts[number], self._specs[number].radius
        return [
            self._name(neighbour)
            for neighbour, row in rows.items()
            if number in self.away
            and neighbour != number
            and neighbour not in self.away
            and math.dist((start.x, start.y), (row.x, row.y)) < radius + self._specs[neighbour].radius
        ]

    def _note_appearance(self, number: int) -> None:
        if number in self.away:
            self.away.remove(number)
            self.appeared.add(number)

    def _take_as_it_is(self, number: int, status: Status) -> None:
        self._status[number] = status
        self._coming.pop(number, None)
        if status in (Status.ABSENT, Status.LEFT):
            self.away.add(number)
        elif status is Status.ALIVE:
            self._note_appearance(number)


class StatusesFollow(Check):
    """Each robot is alive, paused, dead, absent or gone when the faults make it so, and at no other time."""

    name = "statuses"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
        self._changes = 0
        self._before: tuple[Status, ...] = ()

    def _tick(self, record: TickRecord) -> None:
        self._fail(self._expected.problem)
        statuses = tuple(row.status for row in record.robots)
        self._changes += sum(new is not old for new, old in zip(statuses, self._before or statuses, strict=True))
        self._before = statuses

    def _end(self) -> str:
        return f"{self._changes} changes as planned"


class NobodyLost(Check):
    """No robot died without a fault that asked for it."""

    name = "nobody lost"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._lost: dict[int, str] = {}

    def _tick(self, record: TickRecord) -> None:
        for robot in record.robots:
            if robot.status is Status.LOST:
                self._lost.setdefault(robot.number, f"{self._name(robot.number)} at tick {record.k}")

    def _end(self) -> str:
        reported = {
            event.robot: f"{self._name(event.robot)} at tick {event.k} ({event.detail})"
            for event in self._run.journal.events
            if event.kind == _LOST and event.robot in self._run.names
        }
        if details := "; ".join({**self._lost, **reported}.values()):
            self._fail(f"lost: {details}")
        return "nobody"


class DownAreSilent(Check):
    """A robot that is dead, paused, or not there neither sends, hears nor decides, from that tick on."""

    name = "the down are silent"
    needs_no_robots = True

    def _tick(self, record: TickRecord) -> None:
        down = {row.number: row for row in record.robots if row.status is not Status.ALIVE}
        self._looked += len(down)
        if not down:
            return
        does = [(source, "sends") for source, _ in record.frames if source != FORGED]
        does += [(number, "hears") for number in np.unique(links_of(record.deliveries).destination).tolist()]
        does += [(number, "decides") for number, row in down.items() if _has_decided(row)]
        for number, action in does:
            if number in down:
                status = down[number].status.name.lower()
                self._fail(f"{self._name(number)} is {status} at tick {record.k} and {action}")
                return

    def _end(self) -> str:
        return f"in {self._looked} ticks of robots"


def _has_decided(row: RobotTick) -> bool:
    """Return True if a row holds anything of a robot's reply."""
    reported = (row.goal, row.decision_ms, row.rejected)
    return bool(row.state) or row.refused or any(value is not None for value in reported)


class EventsFollow(Check):
    """The events of faults and robots are those that the scenario makes, in their order, each before its tick.

    Events of zones and closures have checks of their own. Nothing but the journal knows what operators asked for and
    what was seen of a process that was paused, so of these only the place among the others is checked. Nothing is
    compared once a robot was lost: the run is invalid then, and what follows depends on why it was lost.
    """

    name = "events"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
        self._fault_ticks = {k for entry in run.timeline.entries for k in (entry.begin, entry.end)}
        scenario = run.prepared.scenario
        self._closable = set(run.prepared.closable)
        self._timed_zones = {zone.name for zone in scenario.zones if zone.times is not None}
        self._is_lost = False
        self._last: TickRecord | None = None

    def _tick(self, record: TickRecord) -> None:
        expected = self._made_by_faults(record.k) + self._expected.events
        self._compare_events(record.k, self._events_before(record.k), expected)
        self._last = record

    def _end(self) -> str:
        unread = self._run.journal.events[self._events_read :]
        if unread and not self._problem and self._last is not None and self._run.has_robots:
            self._look_after_the_last_tick(unread, self._last)
        return f"{self._events_read} events, as faults, operators and robots made them"

    def _look_after_the_last_tick(self, left: Sequence[Event], last: TickRecord) -> None:
        """Compare the events after the last tick, of which a run that was interrupted has the first few."""
        k = last.k + 1
        if k == self._run.prepared.scenario.ticks:
            self._closable = self._timed_zones = set()  # the world changes them only before a tick
            self._compare_events(k, left, [])
            return
        self._expected.tick(replace(last, k=k))
        # The record of the last tick stands for one that was never written.
        expected = [event for event in self._made_by_faults(k) + self._expected.events if event.kind != _ALIVE]
        here = [event for event in left if event.kind not in (_ALIVE, WAITING)]
        # An interrupted run has the first events only, so no more are expected than it has.
        self._compare_events(k, here, expected[: len(self._of_robots(here))])

    def _made_by_faults(self, k: int) -> list[Event]:
        timeline = self._run.timeline
        return [*timeline.endings(k), *timeline.beginnings(k)] if k in self._fault_ticks else []

    def _compare_events(self, k: int, journalled: Sequence[Event], due: Sequence[Event]) -> None:
        self._is_lost |= any(event.kind == _LOST for event in journalled)
        if self._is_lost:
            return
        for event in journalled:
            if event.k != k:
                self._fail(f"the journal has {_describe_event(event)} between ticks {k - 1} and {k}")
        for journal_event, due_event in zip_longest(self._of_robots(journalled), due):
            if journal_event != due_event:
                self._fail(_describe_difference(journal_event, due_event))
                return

    def _of_robots(self, events: Sequence[Event]) -> list[Event]:
        """Return the events that are compared."""
        selected: list[Event] = []
        before: Event | None = None
        for event in events:
            if event.kind == OPERATOR:
                compared = event.robot is not None
            elif event.kind in (IN_FORCE, OUT_OF_FORCE):
                compared = event.robot is not None or event.detail not in self._timed_zones
            elif event.kind in (CLOSED, OPENED, STAYS_OPEN):
                compared = event.robot is not None or event.detail not in self._closable
            elif event.kind == WAITING:
                compared = part_of(event) not in self._closable and event not in self._expected.may_wait
            elif event.kind == LOOKED_AT:
                # It belongs to the event of a pause or a resumption right before it; without one it is out of place.
                compared = before is None or before.kind not in (_ALIVE, _PAUSED) or before.robot != event.robot
            else:
                compared = True
            if compared:
                selected.append(event)
            before = event
        return selected


def _describe_difference(journal_event: Event | None, due_event: Event | None) -> str:
    if due_event is None:
        return f"the journal has {_describe_event(journal_event)}, which nothing made"
    if journal_event is None:
        return f"the journal lacks {_describe_event(due_event)}"
    return f"the journal has {_describe_event(journal_event)} in place of {_describe_event(due_event)}"


def _describe_event(event: Event | None) -> str:
    """Put an event into words, such as `"dead" (f1 kill) of robot 2 before tick 4`."""
    assert event is not None
    of = "" if event.robot is None else f" of robot {event.robot}"
    return f'"{event.kind}" ({event.detail}){of} before tick {event.k}'
