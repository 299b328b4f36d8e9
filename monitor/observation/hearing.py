"""Which robots of a direct radio do not hear which others: a link is lost that no position heard here shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from runtime.messages.telemetry import Traffic

ENOUGH = 10
"""A robot that reports none of so many frames of a sender does not hear it. Where 30 % are lost, all ten are in one of
170 000 cases."""
_SHOWN = 8


class Hearing:
    """Compares the frames that robots report to have heard with those heard here."""

    def __init__(self) -> None:
        self._sent: Counter[str] = Counter()
        self._reports: dict[str, Traffic] = {}
        self._sent_before: dict[str, dict[str, int]] = {}
        self._unheard: dict[str, list[str]] = {}

    def sent(self, sender: str) -> None:
        """Count a frame of a sender that has been heard here."""
        self._sent[sender] += 1

    def take(self, robot: str, traffic: Traffic | None) -> None:
        """Take in the counts of frames that a robot reports to have heard; None without a direct radio."""
        if traffic is None:
            return
        before, sent_before = self._reports.get(robot), self._sent_before.get(robot, {})
        if before is None or before.incarnation != traffic.incarnation:
            # A robot that was started again counts from zero, so its counts before say nothing.
            sent_before = {}
        self._reports[robot] = traffic
        self._sent_before[robot] = {
            sender: sent_before[sender]
            # A count that has not grown keeps the moment at which it last did.
            if before is not None and sender in sent_before and count <= before.heard.get(sender, 0)
            else self._sent[sender]
            for sender, count in traffic.heard.items()
        }
        self._unheard[robot] = [
            sender for sender, sent in self._sent_before[robot].items() if self._sent[sender] >= sent + ENOUGH
        ]

    def wrong(self, robot: str, present: Collection[str]) -> str:
        """Say which of the robots that are present a robot does not hear, by its last report; empty if none."""
        names = sorted(name for name in self._unheard.get(robot, ()) if name != robot and name in present)
        suffix = ", ..." if len(names) > _SHOWN else ""
        return f"does not hear {', '.join(names[:_SHOWN])}{suffix}" if names else ""
