"""The verdict's look at the router between the world and robots that the world does not wait for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worldsim.verdict.common.check import Check, CheckResult

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun

SILENT = "router_silent_s"
"""The note in a journal's end of how long the router did not answer, s of wall time."""


LONG_S = 3.0
"""Silence from which on it is named, s of wall time; a router that is started again takes less."""


class RouterAnswers(Check):
    """The router of a run that keeps to the clock was never silent for long.

    While it does not, ticks go on, and robots neither hear nor are told anything: their numbers are right, but they are
    those of a fleet that was cut off. So a silence is a warning.
    """

    name = "router"

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True for processes that the world does not wait for."""
        end = run.journal.end
        is_noted = end is not None and SILENT in end.notes
        return run.prepared.scenario.factor is not None and (run.processes or is_noted)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        end = self._run.journal.end
        notes = {} if end is None else end.notes
        silent_s = float(notes.get(SILENT, 0.0))
        if silent_s < LONG_S:
            return CheckResult(self.name, True, self._good())
        missed = sum(notes.get("late_commands", {}).values())
        line = (
            f"the router did not answer for {silent_s:.0f} s of wall time, in which robots stood still and heard "
            f"nothing; over the whole run {missed} commands did not come in time"
        )
        return CheckResult(self.name, True, line, warnings=(line,))

    def _good(self) -> str:
        return f"no silence of {LONG_S:g} s or more"
