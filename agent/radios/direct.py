"""A direct radio: robots hear each other over a network, and no world carries or counts their frames.

Frames go out under the sender's own key and are dropped where a queue is full: a position is worth nothing late. What
arrives between two decisions is heard at the second of them; where more has come from a sender than there is room for,
its oldest frames have gone. Whether anything in a frame is true is for the mind's inbox to judge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from agent.ports import FleetClock
from patrol.net.keys import FleetKeys, robot_of
from patrol.net.mailbox import Air, Mailbox, Post
from patrol.net.telemetry import Traffic
from patrol.radio.message import MAX_FRAME, MAX_FRAMES

ROOM = 4 * MAX_FRAMES
"""Frames of one sender that wait: what it sends in four ticks."""


class DirectRadio:
    """Radio of one robot of a fleet that talks directly (`agent.ports.Radio`).

    numbers: of the others, by the key that each sends under. clock: says when it is time to decide.
    """

    def __init__(self, mailbox: Mailbox[bytes], post: Post, numbers: Mapping[str, int], clock: FleetClock) -> None:
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
        """The frames that have arrived since the last decision, by sender and in the order of their arrival."""
        if not self._clock.decide():
            return None
        arrived: list[tuple[str, bytes]] = []
        while len(arrived) < ROOM * len(self._numbers) and (news := self._mailbox.get()) is not None:
            arrived.append(news)
        self.heard.update(key for key, _ in arrived)
        return [frame for _, frame in sorted(arrived, key=lambda news: self._numbers[news[0]])]

    def overhear(self, wait_s: float) -> bytes | None:
        """The next frame that arrives within ``wait_s``, which nobody will hear again; None when there is none."""
        news = self._mailbox.get(wait_s)
        return None if news is None else news[1]

    def traffic(self, incarnation: int, *, final: bool) -> Traffic:
        """What has been sent and heard so far."""
        heard = {robot_of(key): self.heard[key] for key in self._numbers}
        return Traffic(incarnation, self.sent, heard, self._mailbox.refused.total(), final)


def tune_in(air: Air, keys: FleetKeys, own: str, numbers: Mapping[str, int], clock: FleetClock) -> DirectRadio:
    """Put a robot on the air. numbers: of all robots of the fleet by name; clock: as for `DirectRadio`."""
    others = {keys.position(name): number for name, number in numbers.items() if name != own}
    mailbox: Mailbox[bytes] = Mailbox(others, bytes, MAX_FRAME, ROOM)
    radio = DirectRadio(mailbox, air.broadcast(keys.position(own)), others, clock)
    air.subscribe(keys.position("*"), mailbox)
    return radio
