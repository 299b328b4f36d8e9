"""The verdict's check of the journal's events: that they are those of the faults and of the robots' statuses."""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

from patrol.closures.points import WAITING, closure_of
from patrol.journal import Event, Status
from patrol.journal.records import CLOSED, IN_FORCE, OPENED, OUT_OF_FORCE, STAYS_OPEN
from patrol.scenario.controls import OPERATOR
from worldsim.faults import LOOKED_AT
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings

_LOST, _ALIVE, _PAUSED = (status.name.lower() for status in (Status.LOST, Status.ALIVE, Status.PAUSED))


class EventsFollow(Check):
    """The events of faults and robots are those that the scenario makes, in their order, each before its tick.

    Events of zones and closures have checks of their own. Nothing but the journal knows what operators asked for and
    what was seen of a process that was paused, so of these only the place among the others is checked. Nothing is
    compared once a robot was lost: the run is invalid then, and what follows depends on why it was lost.
    """

    name = "events"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._expected = readings[ExpectedStatuses]
        self._fault_ticks = {k for entry in run.timeline.entries for k in (entry.begin, entry.end)}
        scenario = run.prepared.scenario
        self._closures = {closure.name for closure in scenario.closures}
        self._timed_zones = {zone.name for zone in scenario.zones if zone.times is not None}
        self._read = 0
        self._is_lost = False
        self._last: TickRecord | None = None

    def _tick(self, record: TickRecord) -> None:
        events = self._run.journal.events
        first = self._read
        while self._read < len(events) and events[self._read].k <= record.k:
            self._read += 1
        self._compare(record.k, events[first : self._read], self._made_by_faults(record.k) + self._expected.events)
        self._last = record

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        left = self._run.journal.events[self._read :]
        if left and not self._problem and self._last is not None and self.needed[0].usable:
            self._look_after_the_last_tick(left, self._last)
        return super().result()

    def _look_after_the_last_tick(self, left: Sequence[Event], last: TickRecord) -> None:
        """Compare the events after the last tick, of which a run that was interrupted has the first few."""
        k = last.k + 1
        if k == self._run.prepared.scenario.ticks:
            self._closures = self._timed_zones = set()  # the world changes them only before a tick
            self._compare(k, left, [])
            return
        self._expected.tick(replace(last, k=k))
        due = [event for event in self._made_by_faults(k) + self._expected.events if event.kind != _ALIVE]
        here = [event for event in left if event.kind not in (_ALIVE, WAITING)]
        self._compare(k, here, due[: len(self._of_robots(here))])

    def _made_by_faults(self, k: int) -> list[Event]:
        timeline = self._run.timeline
        return [*timeline.endings(k), *timeline.beginnings(k)] if k in self._fault_ticks else []

    def _compare(self, k: int, journalled: Sequence[Event], due: Sequence[Event]) -> None:
        self._is_lost |= any(event.kind == _LOST for event in journalled)
        if self._is_lost:
            return
        for event in journalled:
            if event.k != k:
                self._fail(f"the journal has {_shown(event)} between ticks {k - 1} and {k}")
        for journal_event, due_event in zip_longest(self._of_robots(journalled), due):
            if journal_event != due_event:
                self._fail(_difference(journal_event, due_event))
                return

    def _of_robots(self, events: Sequence[Event]) -> list[Event]:
        """Return the events that are compared."""
        kept: list[Event] = []
        before: Event | None = None
        for event in events:
            if event.kind == OPERATOR:
                compared = event.robot is not None
            elif event.kind in (IN_FORCE, OUT_OF_FORCE):
                compared = event.robot is not None or event.detail not in self._timed_zones
            elif event.kind in (CLOSED, OPENED, STAYS_OPEN):
                compared = event.robot is not None or event.detail not in self._closures
            elif event.kind == WAITING:
                compared = closure_of(event) not in self._closures and event not in self._expected.may_wait
            elif event.kind == LOOKED_AT:
                compared = before is None or before.kind not in (_ALIVE, _PAUSED) or before.robot != event.robot
            else:
                compared = True
            if compared:
                kept.append(event)
            before = event
        return kept

    def _good(self) -> str:
        return f"{self._read} events, as faults, operators and robots made them"


def _difference(journal_event: Event | None, due_event: Event | None) -> str:
    if due_event is None:
        return f"the journal has {_shown(journal_event)}, which nothing made"
    if journal_event is None:
        return f"the journal lacks {_shown(due_event)}"
    return f"the journal has {_shown(journal_event)} in place of {_shown(due_event)}"


def _shown(event: Event | None) -> str:
    """Put an event into words, such as `"dead" (f1 kill) of robot 2 before tick 4`."""
    assert event is not None
    of = "" if event.robot is None else f" of robot {event.robot}"
    return f'"{event.kind}" ({event.detail}){of} before tick {event.k}'
