"""The verdict's check that no message was put in between the world and a robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from worldsim.faults import process_name
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.run.router_answers import SILENT

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun, Readings

_NOTE = "transcripts"


class TranscriptsAgree(Check):
    """Each robot has sent all replies that the world acted on, and the world all phases that the robot acted on.

    Both have kept the hashes of what they sent and acted on (`patrol.security.transcripts`), and the journal's end
    holds those of both. The last ticks of a process that was killed or lost are not compared, because it cannot report
    them. Where reports are missing although process and router were there, other traffic may have crowded them out: a
    warning.
    """

    name = "transcripts"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._messages = 0
        self._left_out: list[str] = []
        self._gone: list[str] = []

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the robots were processes."""
        return run.processes or _NOTE in _notes(run)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        notes = _notes(self._run)
        if _NOTE not in notes:
            ended = self._run.journal.end is not None
            lacks = "holds none, as those of earlier versions" if ended else "has no end, where it holds them"
            return self._not_judged(f"not judged: the journal {lacks}")
        self._messages = 0
        self._left_out = []
        self._gone = []
        try:
            problems = [problem for note in notes[_NOTE] for problem in self._compare(note)]
        except (TypeError, KeyError, ValueError, OverflowError):
            problems = ["what the journal holds cannot be read"]
        self._fail("; ".join(problems))
        return replace(super().result(), warnings=tuple(self._gone))

    def _compare(self, note: Any) -> Iterator[str]:
        """Give the differences between the transcripts of one process and the world."""
        asked, messages, missed = int(note["asked"]), int(note["messages"]), int(note["missed"])
        name = process_name(self._run.names.get(note["robot"], str(note["robot"])), int(note["incarnation"]))
        self._messages += messages
        compared = -1
        for first, last, heard, world_sent, sent, acted_on in sorted(note["spans"]):
            compared = max(compared, int(last))
            ticks = f"{name}: in ticks {int(first)} to {int(last)}"
            if heard != world_sent:
                yield f"{ticks} the robot acted on phases that the world had not sent"
            if sent != acted_on:
                yield f"{ticks} the world acted on replies that the robot had not sent"
        if missed:
            self._left_out.append(f"{missed} replies of {name}, whose reports were lost")
        if compared < asked:
            self._left_out.append(f"{name} from tick {compared + 1}")
        if SILENT in _notes(self._run):
            return  # the router was down, and with it reports were lost
        if missed:
            self._gone.append(f"{name}: no report has come of {missed} replies that the world acted on")
        if note.get("closed") is False and self._run.exit_codes.get(name) == 0:
            self._gone.append(f"{name} ended in order, and its last report has not come")

    def _good(self) -> str:
        left_out = f"; not compared: {', '.join(self._left_out)}" if self._left_out else ""
        return f"the same by the robots and the world, {self._messages} messages{left_out}"


def _notes(run: JudgedRun) -> Mapping[str, Any]:
    return {} if run.journal.end is None else run.journal.end.notes
