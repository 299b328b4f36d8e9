"""The client of a world's feed: batches of its journal, requests for the fog so far, and controls."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from monitor.observation.source import Answer
from patrol.wire import read, read_sparingly
from runtime.messages.feed import FOG, MAX_ANSWER, MAX_BATCH, TICKS, Batch
from runtime.messages.telemetry import EVENTS, MAX_NOTICE, WAITS, Notice
from runtime.net.mailbox import Mailbox, Presence
from runtime.security.control_auth import ControlClient, Unanswered
from runtime.security.keys import WORLD, FleetKeys

if TYPE_CHECKING:
    from runtime.net.link import Link

ROOM = 512
"""Capacity of the queue of batches. A slower viewer misses some and requests the fog again."""
ROOM_BYTES = 1 << 26
"""Bytes of the batches that wait: more than two of the longest."""
FOG_S = 20.0
WAITS_S = 7.0
"""How long a notice that the world waits counts, s; the world repeats it."""
CONTROL_S = 15.0
"""Longest wait for a world's answer, s of wall time: for the fog so far, and for a control."""


class FeedClient:
    """The connection of a viewer with a world.

    `may_control` is True if this viewer has the right to control the fleet, and `present` if the world is connected.
    """

    def __init__(self, link: Link, keys: FleetKeys, token: str | None = None) -> None:
        """Subscribe to the feed; the token gives the right to control the fleet."""
        self._link = link
        self._keys = keys
        self._token = token
        self.may_control = token is not None
        self.present = False
        ticks, world = keys.truth(TICKS), keys.alive(WORLD)
        self._mailbox: Mailbox[Batch | Presence] = Mailbox(
            [ticks, world], partial(read_sparingly, Batch), MAX_BATCH, ROOM, ROOM_BYTES
        )
        self._waits, self._waits_at = "", 0.0
        self._notices = Mailbox([keys.truth(EVENTS)], partial(read, Notice), MAX_NOTICE)
        link.subscribe(ticks, self._mailbox)
        link.subscribe(keys.truth(EVENTS), self._notices)
        link.watch(world, self._mailbox)

    def batch(self, timeout_s: float) -> Batch | None:
        """Return the next batch; None after `timeout_s` of wall time without one."""
        # One mailbox for both, so that a batch and the news of its world keep their order.
        arrived = self._mailbox.get(timeout_s)
        while arrived is not None and isinstance(arrived[1], Presence):
            self.present = arrived[1].present
            arrived = self._mailbox.get(0.0)
        if arrived is None or isinstance(arrived[1], Presence):
            return None
        if arrived[1].records:
            self._waits = ""  # what it waited for has come, or is given up
        return arrived[1]

    @property
    def waits(self) -> str:
        """Whom the world waits for, as it says; empty if it does not say that it waits."""
        while (news := self._notices.get()) is not None:
            if news[1].kind == WAITS:
                self._waits, self._waits_at = f"{WAITS} {news[1].detail}", time.monotonic()
        return self._waits if time.monotonic() < self._waits_at + WAITS_S else ""

    def so_far(self) -> Iterable[bytes]:
        """The encoded state of the run so far, requested from the world: the answers, of which others may be false."""
        return self._link.answers(self._keys.truth(FOG), b"", MAX_ANSWER, FOG_S)

    def control(self, control: Mapping[str, Any]) -> Answer:
        """Send a control to the world; its answer."""
        client = ControlClient(self._link, self._keys, self._token or "", time.monotonic, os.urandom)
        try:
            operated = client.ask(control, CONTROL_S)
        except Unanswered as unanswered:
            return Answer(False, str(unanswered))
        text = "; ".join(part for part in (operated.answer.text, operated.warning) if part)
        return Answer(operated.answer.done, text)

    def close(self) -> None:
        """Close the connection."""
        self._link.close()
