"""The verdict's check of direct radio: what robots report of the frames that they sent and heard."""

from __future__ import annotations

from typing import TYPE_CHECKING

from worldsim.radio.reported import links_of, reported, totals
from worldsim.verdict.checks import Check

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.run_record import RunRecord


class DirectLinks:
    """By what robots say themselves nobody has heard more of a robot than it has sent.

    What became of the other frames nobody knows, so there is no more to judge.
    """

    def __init__(self, journal: RunRecord) -> None:
        self._journal = journal

    def tick(self, record: TickRecord) -> None:
        """A tick says nothing of links."""

    def check(self) -> Check:
        """The result, once the journal has ended."""
        said = reported(self._journal)
        problems = [
            f"{hearer} heard {count} frames of {sender}, which sent {said[sender]['sent']}"
            for hearer, says in said.items()
            for sender, count in says["heard"].items()
            if sender in said and said[sender]["final"] and count > said[sender]["sent"]
        ]
        if problems:
            return Check("links add up", False, problems[0])
        sums = totals(links_of(said).values())
        measured = "no two robots say what they heard"
        if sums["sent"]:
            measured = f"robots say that they heard {sums['delivered']} of {sums['sent']} frames"
        why = "with direct radio nobody knows a frame's fate"
        return Check("links add up", True, f"not judged: {why}; {measured}", judged=False)
