"""A fleet whose robots hear each other directly: what the world can still know of their radio.

It carries no frame. It overhears those that reach it too, and each robot says how many it has sent and heard. So a
frame's fate on a link is unknown; how many of a link's frames were heard is measured, by those who should have.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from patrol.net.keys import FleetKeys, robot_of
from patrol.net.telemetry import Traffic
from patrol.radio.message import CONTACT, Rejected, decode

if TYPE_CHECKING:
    from worldsim.mailbox import Mailbox

ROOM = 64
"""Frames of one robot that wait for the world to look at them."""

MAX_TRAFFIC = 1024
"""Bytes of the longest telemetry, for each robot of the fleet."""

LAST_WORDS_S = 2.0
"""How long the world waits for what robots have to say when they leave."""


@dataclass(slots=True)
class _Said:
    """What the processes of one robot have said together; the newest process speaks, the others have."""

    senders: frozenset[str]
    last: Traffic | None = None
    sent: int = 0
    refused: int = 0
    heard: Counter[str] = field(default_factory=Counter)

    def take(self, traffic: Traffic) -> None:
        """The next that it says; what an older process says comes too late."""
        if self.last is not None and traffic.incarnation < self.last.incarnation:
            return
        if self.last is not None and traffic.incarnation > self.last.incarnation:
            self.sent += self.last.sent
            self.refused += self.last.refused
            self.heard.update(self.last.heard)
        heard = {sender: count for sender, count in traffic.heard.items() if sender in self.senders}
        self.last = replace(traffic, heard=heard)

    @property
    def has_left(self) -> bool:
        """Whether there is no more to come."""
        return self.last is not None and self.last.final

    def total(self) -> dict[str, Any]:
        """For the journal; what is not final may lack the frames of its last moments."""
        last = self.last
        assert last is not None
        heard = {sender: self.heard[sender] + count for sender, count in sorted(last.heard.items())}
        refused = self.refused + last.refused
        return {"sent": self.sent + last.sent, "heard": heard, "refused": refused, "final": last.final}


class Ear:
    """What the world hears of a direct radio, and what robots say of it.

    numbers: of the robots by name. positions: the frames, by the senders' keys. telemetry: `Traffic`, by the robots'.
    """

    def __init__(
        self,
        keys: FleetKeys,
        numbers: Mapping[str, int],
        positions: Mailbox[bytes],
        telemetry: Mailbox[Traffic],
        now: Callable[[], float],
    ) -> None:
        self.missed: Counter[int] = Counter()
        self._numbers = {keys.position(name): number for name, number in numbers.items()}
        self._positions = positions
        self._telemetry = telemetry
        self._now = now
        self._said = {name: _Said(frozenset(numbers) - {name}) for name in numbers}

    def overhear(self, k: int) -> dict[int, list[bytes]]:
        """The frames of tick k that have reached the world by now, of each robot its position first.

        Frames of another tick have come too late, or say what is not so; they are counted as missed, and so are
        contacts without a position.
        """
        frames: dict[int, list[bytes]] = {}
        while (arrived := self._positions.get()) is not None:
            number = self._numbers[arrived[0]]
            place = _place(arrived[1], k)
            if place is None or (place == CONTACT) is (number not in frames):
                self.missed[number] += 1
            else:
                frames.setdefault(number, []).append(arrived[1])
        self._listen()
        return frames

    def notes(self) -> dict[str, Any]:
        """For the journal's end: what each robot said last, and what the world itself has missed.

        Waits, not for long, for robots that are leaving now.
        """
        until = self._now() + LAST_WORDS_S
        self._listen()
        while not all(said.has_left for said in self._said.values()) and (left := until - self._now()) > 0.0:
            self._listen(left)
        said = {name: said.total() for name, said in self._said.items() if said.last is not None}
        missed = {robot_of(key): self.missed[number] for key, number in self._numbers.items()}
        return {"direct": {"said": said, "missed": missed}}

    def _listen(self, wait_s: float = 0.0) -> None:
        while (arrived := self._telemetry.get(wait_s)) is not None:
            self._said[robot_of(arrived[0])].take(arrived[1])
            wait_s = 0.0


def _place(frame: bytes, k: int) -> int | None:
    """The robot number in a frame of tick k; None for any other frame."""
    try:
        position = decode(frame)
    except Rejected:
        return None
    return position.robot if position.sequence == k else None
