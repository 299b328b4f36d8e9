"""A direct radio: robots hear each other over a network, and no world carries or counts their frames.

Each robot sends under its own key. Frames that find a full queue are dropped, because a late position is worthless.
Frames that arrive between two decisions are heard at the second of them; where a sender has sent more than fits, its
oldest frames are dropped, and so are those that the network has held up for long (`agent.radios.skew`). The mind's
inbox judges whether a frame is true.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Protocol

from agent.ports import FleetClock
from agent.radios.skew import Skew
from patrol.net.frames import FrameMailbox
from patrol.net.keys import FleetKeys, robot_of
from patrol.net.mailbox import Air, Mailbox, Post
from patrol.net.messages.telemetry import Traffic
from patrol.process.reporting.vitals import DROPPED, Vitals
from patrol.radio.message import MAX_FRAMES

ROOM = 4 * MAX_FRAMES
"""Number of waiting frames per sender: what a robot sends in four ticks."""


class Counting(FleetClock, Protocol):
    """A fleet clock that knows which tick it is."""

    @property
    def k(self) -> int:
        """The tick."""
        ...


class DirectRadio:
    """Radio of one robot of a fleet that talks directly (`agent.ports.Radio`).

    `sent` counts the frames sent so far, `heard` those heard so far, by the sender's key.
    """

    def __init__(
        self, mailbox: Mailbox[bytes], post: Post, numbers: Mapping[str, int], clock: Counting, skew: Skew
    ) -> None:
        """Start with nothing sent or heard; `tune_in` connects everything.

        `numbers` holds the others' numbers, by the key under which each sends.
        """
        self.skew = skew
        self.sent = 0
        self.heard: Counter[str] = Counter()
        self._mailbox = mailbox
        self._post = post
        self._numbers = numbers
        self._clock = clock

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Send this robot's position and its contacts."""
        for frame in frames:
            self._post(frame)
            self.sent += 1

    def hear(self) -> list[bytes] | None:
        """Return the frames that have arrived in time since the last decision, by sender and in order of arrival.

        It is None when there is nothing to decide.
        """
        if not self._clock.decide():
            return None
        arrived: list[tuple[str, bytes]] = []
        while len(arrived) < ROOM * len(self._numbers) and (news := self._mailbox.get()) is not None:
            arrived.append(news)
        arrived.sort(key=lambda news: self._numbers[news[0]])
        late = self.skew.hear(self._clock.k, [frame for _, frame in arrived])
        in_time = [news for news, is_late in zip(arrived, late, strict=True) if not is_late]
        self.heard.update(key for key, _ in in_time)
        return [frame for _, frame in in_time]

    def show(self, vitals: Vitals) -> None:
        """Add the frames that wait and those that were dropped to this process's figures."""
        vitals.probe_mailbox(self._mailbox)
        vitals.probe(DROPPED, lambda: {"late": self.skew.late})

    def overhear(self, wait_s: float) -> bytes | None:
        """Return the next frame, which `hear` will not return again; None when none arrives in time."""
        news = self._mailbox.get(wait_s)
        return None if news is None else news[1]

    def traffic(self, incarnation: int, *, final: bool) -> Traffic:
        """Return the counts of what has been sent and heard so far."""
        heard = {robot_of(key): self.heard[key] for key in self._numbers}
        refused = self._mailbox.refused.total() + self.skew.late
        return Traffic(incarnation, self.sent, heard, refused, final)


def tune_in(
    air: Air,
    keys: FleetKeys,
    own: str,
    numbers: Mapping[str, int],
    clock: Counting,
    step_s: float,
    key: bytes | None = None,
) -> DirectRadio:
    """Connect the robot named `own` to the direct radio; `numbers` holds those of the whole fleet, by name.

    `step_s` is the wall time of a tick; `key` is that of the fleet's tags, or None.
    """
    names = {number: name for name, number in numbers.items() if name != own}
    others = {keys.position(name): number for name, number in numbers.items() if name != own}
    mailbox = FrameMailbox(others, ROOM)
    radio = DirectRadio(mailbox, air.broadcast(keys.position(own)), others, clock, Skew(names, step_s, key))
    air.subscribe(keys.position("*"), mailbox)
    return radio
