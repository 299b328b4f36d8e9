"""Mailboxes: where messages wait between the thread that receives them and the thread that reads them.

The receiving thread decodes each message and puts it into a `Mailbox`; the mailbox's owner takes messages out with a
time limit. A message that is too long, malformed, under an unknown key or one too many is dropped and counted on
arrival, so that it never wakes the owner. Room is per key, so that a flood on one key takes no room from the others.

Nothing here depends on Zenoh: `runtime.net.link` and `runtime.net.multicast` fill mailboxes.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from patrol.radio.message import CONTACT, MAX_FRAME, Rejected, decode

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
    """A query that waits for an answer."""

    payload: bytes
    answer: Post  # sends the answer, once; a long answer waits for its receiver


class Payload(Protocol):
    """The payload of a message, which may not have been copied out of Zenoh yet."""

    def __len__(self) -> int:
        """Return the number of bytes."""
        ...

    def __bytes__(self) -> bytes:
        """Return the bytes."""
        ...


class Mailbox(Generic[T]):
    """Messages that have arrived and wait to be taken, in order within a key and fairly between keys.

    One thread puts, another gets. `decode` turns a payload of at most `longest` bytes into a message, or raises
    ValueError. When more than `room` messages of a key wait, the oldest is dropped; a message is dropped itself when
    the payloads of all keys would exceed `room_bytes`. `refused` counts dropped messages by reason: unknown, oversized,
    malformed, overflow.
    """

    def __init__(
        self,
        keys: Collection[str],
        decode: Callable[[bytes], T],
        longest: int,
        room: int = _ROOM,
        room_bytes: int | None = None,
    ) -> None:
        self.refused: Counter[str] = Counter()
        self._decode = decode
        self._longest = longest
        self._room_bytes = room_bytes
        self._bytes = 0
        self._waiting: dict[str, deque[tuple[T, int]]] = {key: deque(maxlen=room) for key in keys}
        self._ready: deque[str] = deque()
        self._changed = threading.Condition()

    @property
    def waiting(self) -> int:
        """Number of messages that wait; read from any thread."""
        return sum(len(waiting) for waiting in self._waiting.values())

    def deliver(self, key: str, payload: Payload) -> None:
        """Decode one message and put it in; called on the receiving thread."""
        if len(payload) > self._longest:
            self.refused["oversized"] += 1
            return
        if self._room_bytes is not None and self._bytes + len(payload) > self._room_bytes:
            self.refused["overflow"] += 1
            return
        try:
            message = self._decode(bytes(payload))
        except ValueError:
            self.refused["malformed"] += 1
            return
        # Decoded on the receiving thread: what is malformed never wakes the owner.
        self.put(key, message, len(payload))

    def put(self, key: str, message: T, size: int = 0) -> None:
        """Put one decoded message in, with the length of its payload in bytes; called from any thread.

        For example, with room for 256 the 257th message that waits under a key pushes the first one out.
        """
        waiting = self._waiting.get(key)
        if waiting is None:
            self.refused["unknown"] += 1
            return
        with self._changed:
            # A key is in the line once, however many of its messages wait.
            if not waiting:
                self._ready.append(key)
                self._changed.notify()
            elif len(waiting) == waiting.maxlen:
                self.refused["overflow"] += 1
                self._bytes -= waiting[0][1]
            self._bytes += size
            waiting.append((message, size))

    def get(self, timeout_s: float = 0.0) -> tuple[str, T] | None:
        """Take the next message out, with its key; None when none came within `timeout_s`."""
        with self._changed:
            if not self._ready and timeout_s > 0.0:
                self._changed.wait(timeout_s)
            if not self._ready:
                return None
            key = self._ready.popleft()
            waiting = self._waiting[key]
            message, size = waiting.popleft()
            self._bytes -= size
            # To the end of the line: a sender of many messages does not keep others waiting.
            if waiting:
                self._ready.append(key)
            return key, message


class Air(Protocol):
    """A carrier of positions: a link to Zenoh, a multicast group or a serial line."""

    def broadcast(self, key: str) -> Post:
        """Make a publisher for a direct radio: sends at once, to all others; a message is lost rather than late."""
        ...

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put messages into a mailbox."""
        ...

    def close(self) -> bool:
        """Close it; False when that takes too long."""
        ...


class Carrier:
    """The common base of a group and a serial line: its own senders' keys, and its listeners' mailboxes."""

    def __init__(self) -> None:
        self._own: set[str] = set()
        self._subscriptions: list[tuple[str, Mailbox[Any]]] = []

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put messages into a mailbox, under one key or, where it ends in ``*``, under all that begin like it."""
        self._subscriptions.append((key, mailbox))

    def _deliver_frame(self, key: str, frame: bytes) -> None:
        """Deliver a frame of another end.

        For example, the key ``fleet/radio/r1`` goes to subscriptions of this key, and of ``fleet/radio/*``.
        """
        if key in self._own:
            return
        for pattern, mailbox in list(self._subscriptions):
            if key == pattern or (pattern.endswith("*") and key.startswith(pattern[:-1])):
                mailbox.deliver(key, frame)


class FrameMailbox(Mailbox[bytes]):
    """Frames that wait, without positions of another robot than the key's: certificates guard keys alone.

    `numbers` are the senders' numbers by key. When more than `room` frames of a sender wait, the oldest is dropped.
    """

    def __init__(self, numbers: Mapping[str, int], room: int = 256) -> None:
        super().__init__(numbers, bytes, MAX_FRAME, room)
        self._numbers = numbers

    def put(self, key: str, message: bytes, size: int = 0) -> None:
        """Put one frame in; called from any thread.

        Bytes that are no frame are put in too, for the reader to refuse.
        """
        try:
            claimed = decode(message).robot
        except Rejected:
            claimed = CONTACT
        if claimed not in (CONTACT, self._numbers.get(key, claimed)):
            self.refused["forged"] += 1
            return
        super().put(key, message, size)
