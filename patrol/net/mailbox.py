"""Mailboxes: where messages wait between the thread that receives them and the thread that reads them.

The receiving thread decodes each message and puts it into a `Mailbox`; the mailbox's owner takes messages out with a
time limit. A message that is too long, malformed, under an unknown key or one too many is dropped and counted on
arrival, so that it never wakes the owner. Room is per key, so that a flood on one key takes no room from the others.

Nothing here depends on Zenoh: `patrol.net.link` and `patrol.net.multicast` fill mailboxes.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

_ROOM = 256

T = TypeVar("T")

Post = Callable[[bytes], None]
"""Sends one payload under the key it was made for."""


@dataclass(frozen=True, slots=True)
class Presence:
    """The news that a liveliness token has come or gone."""

    present: bool


@dataclass(frozen=True, slots=True)
class Question:
    """Something that somebody asks for. answer: sends the answer, once; a long one waits for who takes it in."""

    payload: bytes
    answer: Post


class Payload(Protocol):
    """What a message holds before it is copied out of Zenoh."""

    def __len__(self) -> int:
        """How many bytes."""
        ...

    def to_bytes(self) -> bytes:
        """The bytes."""
        ...


class Mailbox(Generic[T]):
    """Messages that have arrived and wait to be taken, in order within a key and fairly between keys.

    keys: those it accepts. decode: turns a payload into a message, or raises ValueError. longest: bytes of the longest
    payload that it looks at. room: messages that wait per key; when there are more the oldest is dropped. `refused`
    counts what was dropped: unknown, oversized, malformed, overflow. One thread puts, another gets.
    """

    def __init__(self, keys: Collection[str], decode: Callable[[bytes], T], longest: int, room: int = _ROOM) -> None:
        self.refused: Counter[str] = Counter()
        self._decode = decode
        self._longest = longest
        self._waiting: dict[str, deque[T]] = {key: deque(maxlen=room) for key in keys}
        self._ready: deque[str] = deque()
        self._changed = threading.Condition()

    def deliver(self, key: str, payload: Payload) -> None:
        """Decode one message and let it in; called on Zenoh's thread."""
        if len(payload) > self._longest:
            self.refused["oversized"] += 1
            return
        try:
            message = self._decode(payload.to_bytes())
        except ValueError:
            self.refused["malformed"] += 1
            return
        self.put(key, message)

    def put(self, key: str, message: T) -> None:
        """Let one message in; called from any thread."""
        waiting = self._waiting.get(key)
        if waiting is None:
            self.refused["unknown"] += 1
            return
        with self._changed:
            if not waiting:
                self._ready.append(key)
                self._changed.notify()
            elif len(waiting) == waiting.maxlen:
                self.refused["overflow"] += 1
            waiting.append(message)

    def get(self, timeout_s: float = 0.0) -> tuple[str, T] | None:
        """The next message and its key, or None when none came in time."""
        with self._changed:
            if not self._ready and timeout_s > 0.0:
                self._changed.wait(timeout_s)
            if not self._ready:
                return None
            key = self._ready.popleft()
            waiting = self._waiting[key]
            message = waiting.popleft()
            if waiting:
                self._ready.append(key)
            return key, message


class Air(Protocol):
    """What positions travel by: a `Link`, or a `patrol.net.multicast.Group`."""

    def broadcast(self, key: str) -> Post:
        """What a direct radio sends with: at once, to all others, and lost rather than late."""
        ...

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Let messages under a key expression into a mailbox."""
        ...

    def close(self) -> bool:
        """Close it; False when that takes too long."""
        ...
