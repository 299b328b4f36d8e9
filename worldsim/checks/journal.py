"""The verdict's checks of the journal itself, of the times of faults, and of facts only of runs of processes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from patrol.exchange import FIRST_INCARNATION
from patrol.faults.kinds import Fault, Lasting, Pause
from patrol.faults.targets import WORDS
from patrol.journal import Status, TraceHash
from worldsim.checks.check import Check
from worldsim.faults import LOOKED_AT, STOPPED, UNSEEN, process_name
from worldsim.run_record import COMPLETED, INTERRUPTED, links_of, reported, totals

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry

_ROUNDING = 1e-9
"""Times that are this near to a tick, or to half of one, count as it, in ticks."""

KILLED = -9
"""The exit code of a process that SIGKILL has ended."""

SILENT = "router_silent_s"
"""The note in a journal's end of how long the router did not answer, s of wall time."""

LONG_S = 3.0
"""Silence from which on it is named, s of wall time; a router that is started again takes less."""

_STATUSES = {status.name.lower() for status in Status}


class Complete(Check):
    """Every tick is there, in order, and the run ended by its end record."""

    name = "complete"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._next = 0

    def _tick(self, record: TickRecord) -> None:
        if record.k != self._next:
            self._fail(f"tick {record.k} follows tick {self._next - 1}")
        self._next = record.k + 1

    def _end(self) -> str:
        journal, end = self._run.journal, self._run.journal.end
        expected = round(float(journal.header.scenario["duration"]) / float(journal.header.scenario["step"]))
        if journal.truncated:
            self._fail(f"the journal is damaged after tick {self._next - 1}")
        elif end is None:
            self._fail(f"the journal stops after tick {self._next - 1} without an end record")
        elif end.reason not in (COMPLETED, INTERRUPTED):
            self._fail(f"the run ended after {self._next} ticks: {end.reason}")
        elif end.reason == COMPLETED and self._next != expected:
            self._fail(f"{self._next} of {expected} ticks")
        return f"{self._next} of {expected} ticks" + (", interrupted" if self._next < expected else "")


class TraceAgrees(Check):
    """The trace hash recomputed from the ticks is the recorded one."""

    name = "trace"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._trace = TraceHash(run.prepared.scenario.spares)

    def _tick(self, record: TickRecord) -> None:
        self._trace.tick(record)

    def _end(self) -> str:
        digest, end = self._trace.hexdigest(), self._run.journal.end
        recorded = end.trace_hash if end else "missing"
        if digest != recorded:
            self._fail(f"the ticks' hash is {digest}, the recorded one is {recorded}")
        return digest


class FaultsOnTime(Check):
    """Each fault begins and ends in the ticks of its `at` and `for`, and acts on the robots that it names.

    World and verdict take these from the same timeline, so nothing that happens in a run could reveal an error. Robots
    that are drawn are not drawn again.
    """

    name = "fault times"
    kinds = (Fault,)
    needs_no_robots = True

    def _end(self) -> str:
        self._fail(
            "; ".join(
                f"{entry.id} is scheduled from tick {entry.begin} "
                + ("to the end of the run" if entry.end is None else f"to before tick {entry.end}")
                + ", which is not what its `at` and `for` say"
                for entry in self._entries
                if not (_begins_on_time(entry, self._step) and _ends_on_time(entry, self._step))
            )
        )
        numbers = {name: number for number, name in self._run.names.items()}
        for entry in self._entries:
            # Sorted: a fault may name robots in any order.
            if any(sorted(robots) != sorted(numbers[name] for name in names) for names, robots in _list_named(entry)):
                self._fail(f"{entry.id} acts on other robots than it names")
        return f"{len(self._entries)} faults scheduled by their `at` and `for`"


def _begins_on_time(entry: Entry, step: float) -> bool:
    """Return True if a fault begins in the first tick that is not before its `at`."""
    begin_tick = entry.fault.at / step - _ROUNDING
    return entry.begin >= begin_tick and (entry.begin == 0 or entry.begin - 1 < begin_tick)


def _ends_on_time(entry: Entry, step: float) -> bool:
    """Return True if a fault goes on for its `for`, rounded to ticks, half a tick up, and at least one tick.

    For example, with steps of 0.5 s, 3 ticks for 1.25 s, 2 ticks for 1.2 s, and 1 tick for 0.1 s.
    """
    fault = entry.fault
    if not isinstance(fault, Lasting):
        return entry.end == entry.begin
    if entry.end is None or fault.lasts is None:
        return entry.end is None and fault.lasts is None
    ticks = entry.end - entry.begin
    excess = fault.lasts / step + _ROUNDING - ticks
    return excess < 0.5 and (ticks == 1 or (ticks > 1 and excess >= -0.5))


def _list_named(entry: Entry) -> Iterator[tuple[Sequence[str], Sequence[int]]]:
    """Yield the robots that a fault names, not those that it asks for by number, and those that it acts on."""
    fields = {"who": entry.who, "victims": entry.who, "sources": entry.sources, "targets": entry.targets}
    for field, robots in fields.items():
        who = getattr(entry.fault, field, None)
        if isinstance(who, tuple):
            yield who, robots
        elif isinstance(who, str) and who not in WORDS:
            yield (who,), robots


class ExitCodes(Check):
    """Every process ended as planned: by SIGKILL where a fault killed its robot, with exit code 0 everywhere else.

    Where there are exit codes, none may be missing. Those of robots that were lost are not judged, nor is that of a
    process that was started so late that the run was over before it took part.
    """

    name = "exit codes"
    needs_no_robots = True

    def _end(self) -> str:
        codes, planned = self._run.exit_codes, self._plan_exit_codes()
        if not codes:
            return "the run had no processes"
        missing = [name for name, planned_code in planned.items() if planned_code is not None and name not in codes]
        wrong = [f"the exit code of {name} is unknown" for name in missing]
        judged = {name: planned_code for name in codes if (planned_code := planned.get(name, 0)) is not None}
        for name, planned_code in judged.items():
            if codes[name] != planned_code:
                ended = "did not end" if codes[name] is None else f"ended with {codes[name]}"
                wrong.append(f"{name} {ended}" + (f", not with {planned_code} as planned" if planned_code else ""))
        self._fail("; ".join(wrong))
        killed = list(judged.values()).count(KILLED)
        as_planned = f", {killed} were killed as planned" if killed else ""
        return f"{len(judged) - killed} processes ended with 0{as_planned}"

    def _plan_exit_codes(self) -> dict[str, int | None]:
        """Return the exit codes due by process, None where any will do."""
        codes: dict[str, int | None] = {}
        for number, name in self._run.names.items():
            is_alive = number not in self._run.absent_at_first
            incarnation = FIRST_INCARNATION if is_alive else FIRST_INCARNATION - 1
            if is_alive:
                codes[process_name(name, incarnation)] = 0
            for event in self._run.journal.events:
                if event.robot != number:
                    continue
                match event.kind:
                    case "alive" | "lost" if not is_alive:
                        incarnation += 1
                        is_alive = event.kind == "alive"
                        codes[process_name(name, incarnation)] = 0 if is_alive else None
                    case "lost":
                        is_alive = False
                        codes[process_name(name, incarnation)] = None
                    case "dead" if is_alive:
                        is_alive = False
                        codes[process_name(name, incarnation)] = KILLED
                    case "left":
                        is_alive = False
            # A process may have been started so late that no event tells of it.
            codes[process_name(name, incarnation + 1)] = None
        return codes


class PausedStandStill(Check):
    """Every process that was to be paused was seen to be stopped, when its pause began and when a resume ended it.

    A world that only ignored the process in between would leave the same journal otherwise.
    """

    name = "the paused stand still"
    kinds = (Pause,)
    needs_no_robots = True

    def _end(self) -> str:
        if not self._run.processes:
            self._unknown = "the run had no processes"
        looks = self._list_looks()
        self._fail(
            "; ".join(
                f"{self._name(robot)} was paused {to} tick {k}, but {finding or 'its process was not inspected'}"
                for k, robot, to, finding in looks
                if finding not in (STOPPED, UNSEEN)
            )
        )
        unseen = sum(finding == UNSEEN for *_, finding in looks)
        if unseen and not self._problem:
            self._unknown = f"in {unseen} of {len(looks)} inspections the state of the process was unknown"
        return f"{len(looks)} inspections found the process stopped"

    def _list_looks(self) -> list[tuple[int, int, str, str]]:
        """Return tick and robot of each begin ("at") and end ("until") of a pause, and what was seen of the process."""
        looks: list[tuple[int, int, str, str]] = []
        status: dict[int, str] = {}
        paused, alive = Status.PAUSED.name.lower(), Status.ALIVE.name.lower()
        for event in self._run.journal.events:
            if event.robot is None:
                continue
            # The look of a pause comes right after the pause's own event, so it belongs to the last entry.
            if event.kind == LOOKED_AT and looks and (*looks[-1][:2], looks[-1][3]) == (event.k, event.robot, ""):
                looks[-1] = (*looks[-1][:3], event.detail)
            if event.kind == paused:
                looks.append((event.k, event.robot, "at", ""))
            elif event.kind == alive and status.get(event.robot) == paused:
                looks.append((event.k, event.robot, "until", ""))
            if event.kind in _STATUSES:
                status[event.robot] = event.kind
        return looks


class RouterAnswers(Check):
    """The router of a run that keeps to the clock was never silent for long.

    While it does not, ticks go on, and robots neither hear nor are told anything: their numbers are right, but they are
    those of a fleet that was cut off. So a silence is a warning.
    """

    name = "router"
    needs_no_robots = True

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True for processes that the world does not wait for."""
        return run.prepared.scenario.factor is not None and (run.processes or SILENT in run.notes)

    def _end(self) -> str:
        silent_s = float(self._run.notes.get(SILENT, 0.0))
        if silent_s < LONG_S:
            return f"no silence of {LONG_S:g} s or more"
        missed = sum(self._run.notes.get("late_commands", {}).values())
        line = (
            f"the router did not answer for {silent_s:.0f} s of wall time, in which robots stood still and heard "
            f"nothing; over the whole run {missed} commands did not come in time"
        )
        self._warnings = [line]
        return line


class DirectLinks(Check):
    """No robot has heard more frames of another than that one has sent, by the robots' own counts.

    With direct radio the fate of the other frames is unknown, so there is no more to judge.
    """

    name = "links add up"
    needs_no_robots = True

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if robots hear each other directly."""
        return not run.by_ether

    def _end(self) -> str:
        counts = reported(self._run.journal)
        for hearer, report in counts.items():
            for sender, count in report["heard"].items():
                # A sender that did not report at its end may have sent more than it last said.
                if sender in counts and counts[sender]["final"] and count > counts[sender]["sent"]:
                    self._fail(f"{hearer} heard {count} frames of {sender}, which sent {counts[sender]['sent']}")
        sums = totals(links_of(counts).values())
        measured = "no two robots reported their counts"
        if sums["sent"]:
            measured = f"robots report that they heard {sums['delivered']} of {sums['sent']} frames"
        if not self._problem:
            self._unknown = f"not judged: with direct radio the fate of a frame is unknown; {measured}"
        return ""
