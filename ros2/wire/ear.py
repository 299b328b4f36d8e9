"""Counts, ages and the newest messages of each key of a robot's Zenoh."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from patrol.net.mailbox import Payload
from ros2.wire.formats import attachment_of

_MOST_KEYS = 64
_LONGEST_KEPT, _LONGEST_RECENT = 1 << 22, 1 << 14
_RECENT = 32
_MOST_SENDERS = 16


@dataclass(slots=True)
class Overheard:
    """The messages heard under one key.

    Several recent ones are kept, as many senders may publish a topic, and one message may have been held up on its way.
    """

    first_s: float  # when the first message came, by `time.monotonic`
    last_s: float = 0.0  # when the last one came, likewise
    messages: int = 0
    size: int = 0  # bytes of the longest
    # of the message that seemed youngest: our clock less that of its sender; None where senders do not say
    age_ns: int | None = None
    senders: set[bytes] = field(default_factory=set)  # at most 16; empty where senders do not say
    newest: bytes | None = None  # the newest payload; None if it is longer than 4 MiB
    # arrival (ns since the epoch) and payload of the last 32 of at most 16 KiB
    recent: deque[tuple[int, bytes]] = field(default_factory=lambda: deque(maxlen=_RECENT))

    @property
    def rate(self) -> float:
        """Messages a second; 0 for fewer than two."""
        took = self.last_s - self.first_s
        return (self.messages - 1) / took if took > 0.0 else 0.0


class Ear:
    """Notes what is overheard, on one thread; another may look at it.

    Only the first 64 keys are kept; `more` counts the messages under others.
    """

    def __init__(self) -> None:
        self._heard: dict[str, Overheard] = {}
        self.more = 0

    @property
    def heard(self) -> dict[str, Overheard]:
        """The messages heard so far, by key."""
        return dict(self._heard)

    def note(self, key: str, payload: Payload, attached: bytes, at_s: float, now_ns: int) -> None:
        """Note a message; `at_s` is by `time.monotonic`, `now_ns` since the epoch."""
        known = self._heard.get(key)
        if known is None:
            if len(self._heard) >= _MOST_KEYS:
                self.more += 1
                return
            known = self._heard[key] = Overheard(at_s)
        known.messages += 1
        known.size = max(known.size, len(payload))
        known.last_s = at_s
        known.newest = payload.to_bytes() if len(payload) <= _LONGEST_KEPT else None
        if known.newest is not None and len(payload) <= _LONGEST_RECENT:
            known.recent.append((now_ns, known.newest))
        given = attachment_of(attached)
        if given is not None:
            age_ns = now_ns - given.sent_ns
            known.age_ns = age_ns if known.age_ns is None else min(known.age_ns, age_ns)
            if len(known.senders) < _MOST_SENDERS:
                known.senders.add(given.sender)
