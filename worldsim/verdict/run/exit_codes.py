"""The verdict's check of how the processes of a run ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.exchange import FIRST_INCARNATION
from worldsim.faults import process_name
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import absent_at_first

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun, Readings

KILLED = -9
"""The exit code of a process that SIGKILL has ended."""


class ExitCodes(Check):
    """Every process ended as planned: by SIGKILL where a fault killed its robot, with exit code 0 everywhere else.

    Where there are exit codes, none may be missing. Those of robots that were lost are not judged, nor is that of a
    process that was started so late that the run was over before it took part.
    """

    name = "exit codes"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._judged = self._killed = 0

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        codes, planned = self._run.exit_codes, self._planned()
        self._judged = self._killed = 0
        wrong = []
        if codes:
            missing = [name for name, due in planned.items() if due is not None and name not in codes]
            wrong += [f"the exit code of {name} is unknown" for name in missing]
        for name, code in codes.items():
            due = planned.get(name, 0)
            if due is None:
                continue
            self._judged += 1
            self._killed += due == KILLED
            if code != due:
                ended = "did not end" if code is None else f"ended with {code}"
                wrong.append(f"{name} {ended}" + (f", not with {due} as planned" if due else ""))
        self._fail("; ".join(wrong))
        return super().result()

    def _good(self) -> str:
        if not self._run.exit_codes:
            return "the run had no processes"
        killed = f", {self._killed} were killed as planned" if self._killed else ""
        return f"{self._judged - self._killed} processes ended with 0{killed}"

    def _planned(self) -> dict[str, int | None]:
        """Return the exit codes due by process, None where any will do."""
        codes: dict[str, int | None] = {}
        absent = absent_at_first(self._run.timeline) | self._run.prepared.scenario.spares
        for number, name in self._run.names.items():
            there = number not in absent
            incarnation = FIRST_INCARNATION if there else FIRST_INCARNATION - 1
            if there:
                codes[process_name(name, incarnation)] = 0
            for event in self._run.journal.events:
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
