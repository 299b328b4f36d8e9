"""The verdict's checks of the journal itself: whether it is complete and unaltered."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.journal import TraceHash
from worldsim.run_record import COMPLETED, INTERRUPTED
from worldsim.verdict.common.check import Check, CheckResult

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class Complete(Check):
    """Every tick is there, in order, and the run ended by its end record."""

    name = "complete"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._next = 0

    def _tick(self, record: TickRecord) -> None:
        if record.k != self._next:
            self._fail(f"tick {record.k} follows tick {self._next - 1}")
        self._next = record.k + 1

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        end = self._run.journal.end
        if self._run.journal.truncated:
            self._fail(f"the journal is damaged after tick {self._next - 1}")
        elif end is None:
            self._fail(f"the journal stops after tick {self._next - 1} without an end record")
        elif end.reason not in (COMPLETED, INTERRUPTED):
            self._fail(f"the run ended after {self._next} ticks: {end.reason}")
        elif end.reason == COMPLETED and self._next != self._due:
            self._fail(f"{self._next} of {self._due} ticks")
        return super().result()

    @property
    def _due(self) -> int:
        scenario = self._run.journal.header.scenario
        return round(float(scenario["duration"]) / float(scenario["step"]))

    def _good(self) -> str:
        return f"{self._next} of {self._due} ticks" + (", interrupted" if self._next < self._due else "")


class TraceAgrees(Check):
    """The trace hash recomputed from the ticks is the recorded one."""

    name = "trace"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._trace = TraceHash(run.prepared.scenario.spares)

    def _tick(self, record: TickRecord) -> None:
        self._trace.tick(record)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        found, end = self._trace.hexdigest(), self._run.journal.end
        recorded = end.trace_hash if end else "missing"
        if found != recorded:
            self._fail(f"the ticks' hash is {found}, the recorded one is {recorded}")
        return super().result()

    def _good(self) -> str:
        return self._trace.hexdigest()
