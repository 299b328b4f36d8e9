"""The verdict's check of direct radio: the counts that robots report of frames sent and heard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worldsim.radio.reported import links_of, reported, totals
from worldsim.verdict.common.check import Check, CheckResult

if TYPE_CHECKING:
    from worldsim.verdict.common.check import JudgedRun


class DirectLinks(Check):
    """No robot has heard more frames of another than that one has sent, by the robots' own counts.

    With direct radio the fate of the other frames is unknown, so there is no more to judge.
    """

    name = "links add up"

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if robots hear each other directly."""
        return not run.by_ether

    def result(self) -> CheckResult:
        """Return the result, once the journal has ended."""
        counts = reported(self._run.journal)
        problems = [
            f"{hearer} heard {count} frames of {sender}, which sent {counts[sender]['sent']}"
            for hearer, report in counts.items()
            for sender, count in report["heard"].items()
            if sender in counts and counts[sender]["final"] and count > counts[sender]["sent"]
        ]
        if problems:
            return CheckResult(self.name, False, problems[0])
        sums = totals(links_of(counts).values())
        measured = "no two robots reported their counts"
        if sums["sent"]:
            measured = f"robots report that they heard {sums['delivered']} of {sums['sent']} frames"
        return self._not_judged(f"not judged: with direct radio the fate of a frame is unknown; {measured}")

    def _good(self) -> str:
        return ""
