"""The world as a listener to a fleet whose robots hear each other directly.

The world carries no frame of such a fleet. It hears those that reach it too, and each robot reports how many it has
sent and heard. So a frame's fate on a link is unknown, but how many of a link's frames were heard is measured by the
robots that should have heard them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from patrol.exchange import FIRST_INCARNATION
from patrol.radio.message import CONTACT, Rejected, decode
from runtime.messages.telemetry import Traffic
from runtime.security.keys import FleetKeys, robot_of

if TYPE_CHECKING:
    from worldsim.mailbox import AnswersMailbox

ROOM = 64
"""Frames of one robot that can wait for the world to read them."""

MAX_TRAFFIC = 1024
"""Length of the longest telemetry, bytes for each robot of the fleet."""

LAST_REPORTS_S = 2.0
"""Longest wait for the last telemetry of robots that are leaving, s."""


@dataclass(slots=True)
class _Counts:
    """The counts that the processes of one robot have reported: `last` of the newest, the sums of those before it.

    A process that was killed has not counted its last frames: `is_whole` is False after one.
    """

    senders: frozenset[str]
    last: Traffic | None = None
    is_whole: bool = True
    sent: int = 0
    refused: int = 0
    heard: Counter[str] = field(default_factory=Counter)

    def take(self, traffic: Traffic) -> None:
        """Take the next report; one of an older process comes too late."""
        last = self.last
        before = FIRST_INCARNATION - 1 if last is None else last.incarnation
        # Reports travel apart from the frames, so an old process's may come after the new one's.
        if traffic.incarnation < before:
            return
        if traffic.incarnation > before:
            self.is_whole &= traffic.incarnation == before + 1 and (last is None or last.final)
            if last is not None:
                self.sent += last.sent
                self.refused += last.refused
                # Counts begin anew with each process, so the old one's are added up.
                self.heard.update(last.heard)
        counts = {sender: count for sender, count in traffic.heard.items() if sender in self.senders}
        self.last = replace(traffic, heard=counts)

    @property
    def has_left(self) -> bool:
        """True if no more reports will come."""
        return self.last is not None and self.last.final

    def total(self) -> dict[str, Any]:
        """Return the sums, for the journal; where they are not final they may lack the last frames."""
        last = self.last
        assert last is not None
        counts = {sender: self.heard[sender] + count for sender, count in sorted(last.heard.items())}
        refused, final = self.refused + last.refused, last.final and self.is_whole
        return {"sent": self.sent + last.sent, "heard": counts, "refused": refused, "final": final}


class Listener:
    """The world's ear on a direct radio, with the counts that robots report of it.

    `missed` counts, by robot number, the frames that reached the world too late, or out of order.
    """

    def __init__(
        self,
        keys: FleetKeys,
        numbers: Mapping[str, int],
        positions: AnswersMailbox[bytes],
        telemetry: AnswersMailbox[Traffic],
        now: Callable[[], float],
    ) -> None:
        """Listen to a fleet."""
        self.missed: Counter[int] = Counter()
        self._numbers = {keys.position(name): number for name, number in numbers.items()}
        self._positions = positions
        self._telemetry = telemetry
        self._now = now
        self._counts = {name: _Counts(frozenset(numbers) - {name}) for name in numbers}

    def frames(self, k: int) -> dict[int, list[bytes]]:
        """Take the frames of a tick that have reached the world by now, by robot number.

        Of each robot its position comes first. Frames of another tick have come too late, or are false; they are
        counted as missed, and so are contacts without a position.
        """
        frames: dict[int, list[bytes]] = {}
        # No more than waits now, so that a flood of frames keeps no tick open.
        for _ in range(self._positions.waiting):
            if (arrived := self._positions.get()) is None:
                break
            number = self._numbers[arrived[0]]
            origin = _robot_of(arrived[1], k)
            # A position must come before contacts, and there is one position only.
            if origin is None or (origin == CONTACT) is (number not in frames):
                self.missed[number] += 1
            else:
                frames.setdefault(number, []).append(arrived[1])
        self._take_reports()
        return frames

    def notes(self) -> dict[str, Any]:
        """Return notes for the journal's end: each robot's last report, and frames that the world itself has missed.

        Waits up to `LAST_REPORTS_S` for robots that are leaving now.
        """
        until = self._now() + LAST_REPORTS_S
        self._take_reports()
        while (
            not all(counts.has_left for counts in self._counts.values()) and (remaining_s := until - self._now()) > 0.0
        ):
            self._take_reports(remaining_s)
        totals = {name: counts.total() for name, counts in self._counts.items() if counts.last is not None}
        missed = {robot_of(key): self.missed[number] for key, number in self._numbers.items()}
        return {"direct": {"said": totals, "missed": missed}}

    def _take_reports(self, wait_s: float = 0.0) -> None:
        """Take the reports that wait now; where none does, wait so long for one, s."""
        for _ in range(max(1, self._telemetry.waiting)):
            if (arrived := self._telemetry.get(wait_s)) is None:
                break
            self._counts[robot_of(arrived[0])].take(arrived[1])


def _robot_of(frame: bytes, k: int) -> int | None:
    """Return the robot number in a frame of tick k; None for any other frame."""
    try:
        position = decode(frame)
    except Rejected:
        return None
    return position.robot if position.sequence == k else None
