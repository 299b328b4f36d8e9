"""The verdict's checks of what faults do to robots: who is dead when, that the dead are silent, how processes end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED
from patrol.net.phases import FIRST_INCARNATION
from worldsim.lifecycle import LOOKED_AT, STOPPED, UNSEEN, process_name
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.robots.statuses import Roll

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Timeline

_STATUSES = {status.name.lower() for status in Status}

KILLED = -9
"""The exit code of a process that SIGKILL has ended."""


class StatusesFollow:
    """Each robot is alive, paused, dead, absent or gone when the faults make it so, and at no other time."""

    def __init__(self, prepared: Prepared, timeline: Timeline) -> None:
        self._roll = Roll(prepared, timeline)
        self._problem = ""
        self._changes = 0
        self._before: tuple[Status, ...] = ()

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        self._roll.tick(record)
        self._problem = self._problem or self._roll.problem
        statuses = tuple(row.status for row in record.robots)
        self._changes += sum(new is not old for new, old in zip(statuses, self._before or statuses, strict=True))
        self._before = statuses

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("statuses", not self._problem, self._problem or f"{self._changes} changes as planned")


class DownAreSilent:
    """A robot that is dead, paused, or not there neither sends, hears nor decides, from that tick on."""

    def __init__(self, journal: RunRecord) -> None:
        self._names = names_of(journal)
        self._problem = ""
        self._looked = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        down = {row.number: row for row in record.robots if row.status is not Status.ALIVE}
        self._looked += len(down)
        if self._problem or not down:
            return
        does = [(source, "sends") for source, _ in record.frames if source != FORGED]
        does += [(destination, "hears") for _, destination, _ in record.deliveries]
        does += [(number, "decides") for number, row in down.items() if row.state or row.decision_ms is not None]
        for number, what in does:
            if number in down:
                status = down[number].status.name.lower()
                self._problem = f"{self._names.get(number, number)} is {status} at tick {record.k} and {what}"
                return

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("the down are silent", not self._problem, self._problem or f"over {self._looked} ticks of robots")


class PausedStandStill:
    """Every process that was to be paused was seen to be stopped, when its pause began and when it ended by a resume.

    A world that only ignored it in between would tell the same.
    """

    def __init__(self, journal: RunRecord, *, processes: bool) -> None:
        """processes: whether robots were processes."""
        self._journal = journal
        self._processes = processes

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""

    def check(self) -> Check:
        """The result, once all ticks are in."""
        name = "the paused stand still"
        names = names_of(self._journal)
        looks = self._looks()
        if not self._processes:
            return Check(name, True, "there were no processes", judged=False)
        wrong = [
            f"{names.get(robot, robot)} was paused {to} tick {k}, and {seen or 'nobody looked whether it was'}"
            for k, robot, to, seen in looks
            if seen not in (STOPPED, UNSEEN)
        ]
        if wrong:
            return Check(name, False, "; ".join(wrong))
        unseen = sum(seen == UNSEEN for *_, seen in looks)
        if unseen:
            return Check(name, True, f"{unseen} of {len(looks)} times nobody could look", judged=False)
        return Check(name, True, f"{len(looks)} times they were seen to")

    def _looks(self) -> list[tuple[int, int, str, str]]:
        """Tick and robot of each beginning ("at") and end ("until") of a pause, and what was seen of the process."""
        looks: list[tuple[int, int, str, str]] = []
        status: dict[int, str] = {}
        paused, alive = Status.PAUSED.name.lower(), Status.ALIVE.name.lower()
        for event in self._journal.events:
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


class ExitCodes:
    """Every process ended as planned: by SIGKILL where a fault killed its robot, by itself with 0 everywhere else.

    None may be missing where any are told. How the process of a robot that was lost ended says nothing more; nor does
    one that was started so late that the run was over before it took part.
    """

    def __init__(self, journal: RunRecord, exit_codes: Mapping[str, int | None], timeline: Timeline) -> None:
        self._journal = journal
        self._codes = exit_codes
        self._absent = timeline.starts_absent

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""

    def check(self) -> Check:
        """The result, once all ticks are in."""
        planned = self._planned()
        wrong, judged, killed = [], 0, 0
        if self._codes:
            untold = [name for name, due in planned.items() if due is not None and name not in self._codes]
            wrong += [f"nobody knows how {name} ended" for name in untold]
        for name, code in self._codes.items():
            due = planned.get(name, 0)
            if due is None:
                continue
            judged += 1
            killed += due == KILLED
            if code != due:
                ended = "did not end" if code is None else f"ended with {code}"
                wrong.append(f"{name} {ended}" + (f", not with {due} as planned" if due else ""))
        good = f"{judged - killed} processes ended with 0" + (f", {killed} were killed as planned" if killed else "")
        return Check("exit codes", not wrong, "; ".join(wrong) or (good if self._codes else "there were no processes"))

    def _planned(self) -> dict[str, int | None]:
        """The exit codes due by process, None where any will do."""
        codes: dict[str, int | None] = {}
        for number, name in names_of(self._journal).items():
            there = number not in self._absent
            incarnation = FIRST_INCARNATION if there else FIRST_INCARNATION - 1
            if there:
                codes[process_name(name, incarnation)] = 0
            for event in self._journal.events:
                if event.robot != number:
                    continue
                match event.kind:
                    case "alive" | "lost" if not there:
                        incarnation += 1
                        there = event.kind == "alive"
                        codes[process_name(name, incarnation)] = 0 if there else None
                    case "lost":
                        there = False
                        codes[process_name(name, incarnation)] = None
                    case "dead" if there:
                        there = False
                        codes[process_name(name, incarnation)] = KILLED
                    case "left":
                        there = False
            codes[process_name(name, incarnation + 1)] = None
        return codes
