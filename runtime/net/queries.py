"""Questions to all that may answer, for a caller that can tell right answers from others."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import zenoh

from runtime.net.mailbox import Mailbox

_OVER = ""
"""The key of the mailbox's message that no more answers come."""
AGAIN_S = 0.2
"""Time between a question without an answer and the next, s."""
_ROOM = 256
_MORE_S = 1.0
"""Waiting time, after the query's own, for Zenoh's word that it is over, s."""


def all_answers(session: zenoh.Session, key: str, payload: bytes, longest: int, wait_s: float) -> Iterator[bytes]:
    """Give the answers of all that answer a query, as they come (`answers_of`, for one key)."""
    return (answer for _, answer in answers_of(session, (key,), payload, longest, wait_s))


def answers_until(
    session: zenoh.Session, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
) -> Iterator[tuple[str, bytes]]:
    """Give answers as `answers_of` does, and ask again under keys without an answer.

    A query ends at once where no process is connected that could answer, also when that process has just come back, or
    while this one changes from a router that is lost to another.
    """
    unanswered = dict.fromkeys(keys)
    until = time.monotonic() + wait_s
    while unanswered and (left_s := until - time.monotonic()) > 0.0:
        for key, answer in answers_of(session, tuple(unanswered), payload, longest, left_s):
            # Several processes may answer under one key; each answer is passed on.
            unanswered.pop(key, None)
            yield key, answer
        if unanswered:
            time.sleep(max(min(AGAIN_S, until - time.monotonic()), 0.0))


def answers_of(
    session: zenoh.Session, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
) -> Iterator[tuple[str, bytes]]:
    """Yield the answers to one query under several keys, asked at once: each answer's key, and the answer.

    By default, Zenoh sends a query to the process that seems nearest, which may be the wrong one. So this one goes to
    all, and no answer replaces another. Answers of more than `longest` bytes are dropped.
    """
    waiting: Mailbox[bytes] = Mailbox([*keys, _OVER], bytes, longest, max(_ROOM, len(keys)))

    def ask(key: str) -> None:
        def receive(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                waiting.deliver(key, reply.ok.payload)

        session.get(
            key,
            zenoh.handlers.Callback(receive, lambda: waiting.put(_OVER, b""), indirect=False),
            payload=payload,
            timeout=wait_s,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.DATA_HIGH,
        )

    for key in keys:
        ask(key)
    unanswered = len(keys)
    # When all queries are over, what waits is still taken out.
    while (arrived := waiting.get(wait_s + _MORE_S if unanswered else 0.0)) is not None:
        if arrived[0] == _OVER:
            unanswered -= 1
        else:
            yield arrived
