"""The ports of a mailbox that the world needs, so that its parts can be tested without a network."""

from __future__ import annotations

from collections import Counter
from typing import Protocol, TypeVar

T_co = TypeVar("T_co", covariant=True)


class Mailbox(Protocol[T_co]):
    """The reading side of a mailbox of `runtime.net`."""

    def get(self, timeout_s: float = 0.0) -> tuple[str, T_co] | None:
        """Take out the next message, and return its key and it; None when none comes in time."""
        ...


class CountingMailbox(Mailbox[T_co], Protocol[T_co]):
    """A mailbox that counts dropped messages."""

    refused: Counter[str]


class AnswersMailbox(CountingMailbox[T_co], Protocol[T_co]):
    """A mailbox that also says how many messages are in it."""

    @property
    def waiting(self) -> int:
        """Number of messages that wait to be taken."""
        ...
