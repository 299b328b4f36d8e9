"""Questions to everybody who may answer, for a caller who can tell right answers from others."""

from __future__ import annotations

from collections.abc import Iterator

import zenoh

from patrol.net.mailbox import Mailbox

_OVER = ""
"""The key of the mailbox's message that no more answers come."""
_MORE_S = 1.0
"""How much longer than the query itself to wait for Zenoh's word that it is over, s."""


def all_answers(session: zenoh.Session, key: str, payload: bytes, longest: int, wait_s: float) -> Iterator[bytes]:
    """The answers of all who answer a query, as they come.

    A query goes by itself to whoever seems nearest, who need not be whom it is for. So this one goes to all, and the
    answer of one replaces that of no other.

    Args:
        session: An open Zenoh session.
        key: To query.
        payload: Of the query.
        longest: Bytes of the longest answer that is wanted; longer ones are dropped.
        wait_s: How long to wait for answers, s.

    Yields:
        The answers.
    """
    waiting: Mailbox[bytes] = Mailbox([key, _OVER], bytes, longest)

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
    left_s = wait_s + _MORE_S
    while (arrived := waiting.get(left_s)) is not None:
        if arrived[0] == _OVER:
            left_s = 0.0
        else:
            yield arrived[1]
