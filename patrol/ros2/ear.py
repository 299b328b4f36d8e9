"""What is overheard on a robot's Zenoh: of each key how much came, how old it was, and the newest message."""

from __future__ import annotations

from dataclasses import dataclass

from patrol.net.mailbox import Payload
from patrol.ros2.formats import attachment_of

_MOST_KEYS = 256
_LONGEST_KEPT = 1 << 18
_MOST_SENDERS = 16


@dataclass(slots=True)
class Overheard:
    """What was overheard under one key.

    Attributes:
        messages: How many.
        size: Bytes of them.
        first_s: When the first came, by `time.monotonic`, s.
        last_s: When the last came.
        age_ns: How old the message was that seemed youngest: our clock less that of its sender; None where senders do
            not say.
        senders: The different senders, at most 16; empty where senders do not say.
        newest: The newest payload; empty if it is longer than 256 KiB.
    """

    messages: int
    size: int
    first_s: float
    last_s: float
    age_ns: int | None
    senders: set[bytes]
    newest: bytes

    @property
    def rate(self) -> float:
        """Messages a second; 0 for fewer than two."""
        took = self.last_s - self.first_s
        return (self.messages - 1) / took if took > 0.0 else 0.0


class Ear:
    """Notes what is overheard; one thread notes, and another reads what is complete.

    Attributes:
        more: How many messages came under keys beyond the first 256.
    """

    def __init__(self) -> None:
        self._heard: dict[str, Overheard] = {}
        self.more = 0

    @property
    def heard(self) -> dict[str, Overheard]:
        """What was overheard so far, by key."""
        return dict(self._heard)

    def note(self, key: str, payload: Payload, attached: bytes, at_s: float, now_ns: int) -> None:
        """Note a message.

        Args:
            key: Its key.
            payload: Its payload, not yet copied.
            attached: Its attachment.
            at_s: The time, by `time.monotonic`, s.
            now_ns: The time, ns since the epoch.
        """
        given = attachment_of(attached)
        age_ns = None if given is None else now_ns - given.sent_ns
        known = self._heard.get(key)
        newest = payload.to_bytes() if len(payload) <= _LONGEST_KEPT else b""
        if known is None:
            if len(self._heard) >= _MOST_KEYS:
                self.more += 1
                return
            known = self._heard[key] = Overheard(0, 0, at_s, at_s, None, set(), b"")
        known.messages += 1
        known.size += len(payload)
        known.last_s = at_s
        known.newest = newest
        if age_ns is not None:
            known.age_ns = age_ns if known.age_ns is None else min(known.age_ns, age_ns)
        if given is not None and len(known.senders) < _MOST_SENDERS:
            known.senders.add(given.sender)
