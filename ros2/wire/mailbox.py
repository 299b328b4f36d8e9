"""The queue of messages between Zenoh's thread, which decodes them, and the thread that reads them."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass
from threading import Condition
from typing import Generic, TypeVar

T = TypeVar("T")

_MOST_SENDERS = 16
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

    `refused` counts the messages that cannot be used, by reason (oversized, malformed, type, hash), and `said` has one
    line about the first of each. `passed_over` counts the messages that had to make room.
    """

    def __init__(self, room: int = 1) -> None:
        self.refused: Counter[str] = Counter()
        self.said: dict[str, str] = {}
        self.passed_over = 0
        self._waiting: deque[Received[T]] = deque(maxlen=room)
        self._newest: Received[T] | None = None
        self._senders: dict[bytes, int] = {}
        self._received = 0
        self._changed = Condition()

    @property
    def newest(self) -> Received[T] | None:
        """The newest message ever received, taken out or not."""
        return self._newest

    @property
    def received(self) -> int:
        """The number of usable messages that came, those that were passed over included."""
        return self._received

    @property
    def senders(self) -> int:
        """The number of different senders, counted up to 16."""
        return len(self._senders)

    def put(self, received: Received[T]) -> None:
        """Put a message in; called from any thread."""
        with self._changed:
            if len(self._waiting) == self._waiting.maxlen:
                self.passed_over += 1
            self._waiting.append(received)
            self._newest = received
            self._received += 1
            if len(self._senders) < _MOST_SENDERS:
                self._senders.setdefault(received.sender, 1)
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
