"""A direct radio: robots hear each other over a network, and no world carries or counts their frames.

Each robot sends under its own key. Frames that find a full queue are dropped, because a late position is worthless.
Frames that arrive between two decisions are heard at the second of them; where a sender has sent more than fits, its
oldest frames are dropped, and so are those that the network has held up for long. The mind's inbox judges whether a
frame is true.

Receivers judge a position's tick by their own count. A robot whose count is off rejects the others' positions, or is
rejected by them; it is named. A robot's frames that come much later than most of its last ones are late, whatever it
counts.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from statistics import median_low
from typing import Protocol

from agent.ports import FleetClock
from patrol.radio.message import CONTACT, MAX_FRAMES, Rejected, decode
from runtime.messages.telemetry import Traffic
from runtime.net.mailbox import Air, FrameMailbox, Mailbox, Post
from runtime.reporting.vitals import DROPPED, Vitals
from runtime.security.keys import FleetKeys, robot_of

REMEMBERED = 9
"""Number of frames of each robot by which its count is judged: a few, because some are delayed on the way."""

LONG = 64
"""Number of frames of each robot that tell how late another one is: far more than a link delivers at once, and so many
that a few forged ones make none late."""

LATE_S = 1.0
"""Delay from which a position is not used, s of wall time. Links that repeat what was lost, or hold it back, deliver
some seconds late, and receivers take a position to be of the tick in which it comes."""

APART = 2
"""Largest difference of two counts that is not reported, ticks."""


class Skew:
    """The lead in ticks of other robots' counts over this robot's own, by the positions that they send.

    `late` counts the frames that came too late.
    """

    def __init__(self, names: Mapping[int, str], step_s: float, key: bytes | None = None) -> None:
        """Judge the robots of a fleet; `step_s` is the wall time of a tick.

        With the key of the fleet's tags, frames without the right tag say nothing; it is None where the fleet uses
        none.
        """
        self.late = 0
        self._names = names
        self._key = key
        self._late = max(2 * APART, math.ceil(LATE_S / step_s))
        self._k = -1
        self._leads: dict[int, deque[int]] = {number: deque(maxlen=LONG) for number in names}
        self._heard_k: dict[int, int] = {}  # when a frame of each was heard last

    def hear(self, k: int, frames: Iterable[bytes]) -> list[bool]:
        """Take in the frames heard, before the inbox rejects any of them; return which are late.

        A frame is late by the median of its sender's last ones, not by this robot's count: clocks may differ. Where
        this robot has skipped ticks, frames have waited for it: none is late, and the last one of each sender counts.
        """
        has_skipped, self._k = k != self._k + 1, k
        senders = [self._sender_of(frame) for frame in frames]
        if has_skipped:
            for number, lead in dict(filter(None, senders)).items():
                leads = self._leads[number]
                if leads and abs(lead - median_low(leads)) > self._late:  # a clock was set
                    leads.clear()
                self._note(number, lead)
            return [False] * len(senders)
        return [sender is not None and self._is_late(*sender) for sender in senders]

    def advance(self, ticks: int) -> None:
        """Take note that this robot counts so many ticks more from the next one on."""
        self._k += ticks
        self._leads = {number: deque((lead - ticks for lead in leads), LONG) for number, leads in self._leads.items()}

    def _sender_of(self, frame: bytes) -> tuple[int, int] | None:
        """Return the number of the robot that sent a frame, and its lead; None for contacts and strangers."""
        try:
            position = decode(frame, self._key)
        except Rejected:
            return None
        if position.robot == CONTACT or position.robot not in self._leads:
            return None
        return position.robot, position.sequence - self._k

    def _note(self, number: int, lead: int) -> None:
        self._leads[number].append(lead)
        self._heard_k[number] = self._k

    def _is_late(self, number: int, lead: int) -> bool:
        self._note(number, lead)
        is_late = lead < median_low(self._leads[number]) - self._late
        self.late += is_late
        return is_late

    @property
    def ticks(self) -> dict[str, int]:
        """The lead of each robot's count in ticks (negative: behind), by name, for robots heard often enough.

        `LONG` ticks after a robot was heard last, what it has said no longer counts.
        """
        lately = {number for number, k in self._heard_k.items() if self._k - k < LONG}
        newest = {number: list(leads)[-REMEMBERED:] for number, leads in self._leads.items() if number in lately}
        return {self._names[number]: median_low(leads) for number, leads in newest.items() if len(leads) == REMEMBERED}

    def complaint(self) -> str | None:
        """Return one line about the robots that count differently; None when there are none."""
        leads = {name: lead for name, lead in self.ticks.items() if abs(lead) > APART}
        if not leads:
            return None
        counts = ", ".join(
            f"{name} is {abs(lead)} ticks {'ahead' if lead > 0 else 'behind'}" for name, lead in leads.items()
        )
        return f"ticks differ: {counts}, so positions are refused; set NTP and the same epoch on all robots"


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
        """Return the counts of frames sent and heard so far."""
        heard_frames = {robot_of(key): self.heard[key] for key in self._numbers}
        refused = self._mailbox.refused.total() + self.skew.late
        return Traffic(incarnation, self.sent, heard_frames, refused, final)


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
    neighbours = {keys.position(name): number for name, number in numbers.items() if name != own}
    mailbox = FrameMailbox(neighbours, ROOM)
    radio = DirectRadio(mailbox, air.broadcast(keys.position(own)), neighbours, clock, Skew(names, step_s, key))
    air.subscribe(keys.position("*"), mailbox)
    return radio
