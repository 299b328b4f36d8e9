"""The messages of a link: queued between Zenoh's thread and the reader's, or counted as they are overheard."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from threading import Condition
from typing import Generic, TypeVar

from ros2.wire.formats import attachment_of
from runtime.net.mailbox import Payload

# Any node may send, and a flood of keys or bytes must not fill the memory.
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
    """Notes overheard messages on one thread; another may look at them.

    Only the first 64 keys are kept.
    """

    def __init__(self) -> None:
        self._heard: dict[str, Overheard] = {}

    @property
    def heard(self) -> dict[str, Overheard]:
        """The messages heard so far, by key."""
        return dict(self._heard)

    def note(self, key: str, payload: Payload, attached: bytes, at_s: float, now_ns: int) -> None:
        """Note a message; `at_s` is by `time.monotonic`, `now_ns` since the epoch."""
        overheard = self._heard.get(key)
        if overheard is None:
            if len(self._heard) >= _MOST_KEYS:
                return
            overheard = self._heard[key] = Overheard(at_s)
        overheard.messages += 1
        overheard.size = max(overheard.size, len(payload))
        overheard.last_s = at_s
        overheard.newest = bytes(payload) if len(payload) <= _LONGEST_KEPT else None
        if overheard.newest is not None and len(payload) <= _LONGEST_RECENT:
            overheard.recent.append((now_ns, overheard.newest))
        attachment = attachment_of(attached)
        if attachment is not None:
            age_ns = now_ns - attachment.sent_ns
            overheard.age_ns = age_ns if overheard.age_ns is None else min(overheard.age_ns, age_ns)
            if len(overheard.senders) < _MOST_SENDERS:
                overheard.senders.add(attachment.sender)


T = TypeVar("T")

_MOST_SAID = 16


@dataclass(frozen=True, slots=True)
class Received(Generic[T]):
    """A message, and how it came."""

    message: T
    at_s: float  # when it was received, by `time.monotonic`
    # since the epoch, by the clock of its sender or of the sender's bridge; None where nothing says
    sent_ns: int | None = None
    sequence: int | None = None  # counts the sender's messages; None where the format does not say
    sender: bytes = b""  # stands for the sender; empty where the format does not say


class RosMailbox(Generic[T]):
    """The newest messages of a topic; when `room` of them wait, the oldest makes room for the next.

    `newest` is the newest message ever received, taken out or not; `received` counts the usable ones, those that had to
    make room included. `refused` counts the messages that cannot be used, by reason (oversized, malformed, type, hash),
    and `said` has one line about the first of each.
    """

    def __init__(self, room: int = 1) -> None:
        self.refused: Counter[str] = Counter()
        self.said: dict[str, str] = {}
        self.newest: Received[T] | None = None
        self.received = 0
        self._waiting: deque[Received[T]] = deque(maxlen=room)
        self._changed = Condition()

    def put(self, received: Received[T]) -> None:
        """Put a message in; called from any thread."""
        with self._changed:
            self._waiting.append(received)
            self.newest = received
            self.received += 1
            self._changed.notify()

    def refuse(self, reason: str, line: str) -> None:
        """Count a message that cannot be used; called from any thread."""
        with self._changed:
            self.refused[reason] += 1
            if len(self.said) < _MOST_SAID:
                self.said.setdefault(reason, line)

    def take(self, timeout_s: float = 0.0) -> Received[T] | None:
        """Take the oldest waiting message out; None when none comes within `timeout_s`."""
        with self._changed:
            if not self._waiting and timeout_s > 0.0:
                self._changed.wait_for(lambda: bool(self._waiting), timeout_s)
            return self._waiting.popleft() if self._waiting else None
