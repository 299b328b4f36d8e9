"""The one link to Zenoh: a client of a router, whose subscriptions fill mailboxes.

Messages arrive on Zenoh's own thread, which puts them into a `patrol.net.mailbox.Mailbox`.

Socket buffers are small: with the system's, a flood of a million tiny messages a second left 300 000 of them between a
tick and its reader, which received the tick seconds late; with small ones the delay is a tenth of a second.
"""

from __future__ import annotations

import errno
import json
import threading
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import zenoh

from patrol.errors import BadInput
from patrol.net.keys import is_group
from patrol.net.mailbox import Air, Mailbox, Post, Presence, Question
from patrol.net.multicast import GroupDown, open_group
from patrol.net.zenoh_errors import first_line as _first_line
from patrol.net.zenoh_errors import system_error as _system_error

LEASE_S = 60.0
"""A client that is silent for so long is gone for the router; longer than a paused robot may take to answer."""

CLOSE_S = 2.0
"""How long closing may take; under loss it has been seen to take longer."""

SEE_S = 5.0
"""How long the router may take to say whose tokens there are."""

TELL_S = (1.0, 5.0)
"""When somebody who waits says so for the first time, and how long after that again."""

RADIO_LEASE_S = 2.0
"""The same for a link that carries nothing but positions."""

ECHO_S = 3600.0
MOST_ANSWERS = 16
"""How long to wait for a router that does not answer; answers to one query that are looked at."""

_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
_SOCKET = 65536
_QUEUE = 16
"""Messages that may wait to be sent, the most that Zenoh allows. With its 2 a busy machine dropped, of what may be, one
in seven from the third of a burst on: at a pace, only the first two robots of a fleet received every pose."""
_DROP_US = 100
"""How long to wait, of what may be dropped, for one who does not read; everybody behind waits too."""

_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
_CLOSE_US = 1_000_000
"""How long a router waits, of what must not be dropped, for one who does not read, and then closes its connection. All
others wait as well: with Zenoh's 5 s, twice over, three that stopped one after the other cost a fleet its robots."""


class LinkDown(Exception):
    """No router answered in time, or none can be here; one line says which."""


class PortBusy(LinkDown):
    """No router can listen here, since another program listens on the port."""


class Link:
    """A session with a router. Everything declared on it lives until `close`.

    Args:
        session: an open Zenoh session.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: list[Any] = []

    @property
    def connected(self) -> bool:
        """Whether a router is at the other end now; clients find back to one that returns by themselves."""
        return bool(self._session.info.routers_zid())

    def post(self, key: str, *, waits: bool = True) -> Post:
        """A publisher for ticks and answers: sends at once, ahead of all else.

        Args:
            key: to publish under.
            waits: whether to wait where a queue is full, or to drop. One receiver that has stopped reading then holds
                up its router, and with it everything that this link sends to anybody.
        """
        control = zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP
        publisher = self._session.declare_publisher(
            key,
            congestion_control=control,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )
        self._declared.append(publisher)
        return publisher.put

    def broadcast(self, key: str) -> Post:
        """A publisher for a direct radio: sends at once, to all others; a message is lost rather than late.

        Args:
            key: to publish under.
        """
        publisher = self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
            reliability=zenoh.Reliability.BEST_EFFORT,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        self._declared.append(publisher)
        return publisher.put

    def publisher(self, key: str) -> Post:
        """A publisher for observers: drops a message where a queue is full, so that it never holds up a tick.

        Args:
            key: to publish under.
        """
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.DATA_LOW
        )
        self._declared.append(publisher)
        return publisher.put

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put messages into a mailbox.

        Args:
            key: a key expression.
            mailbox: where they wait.
        """

        def receive(sample: zenoh.Sample) -> None:
            mailbox.deliver(str(sample.key_expr), sample.payload)

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_subscriber(key, handler))

    def watch(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put liveliness tokens into a mailbox: those that exist now, and every change.

        Args:
            key: a key expression.
            mailbox: where `Presence` messages wait.
        """

        def receive(sample: zenoh.Sample) -> None:
            mailbox.put(str(sample.key_expr), Presence(sample.kind == zenoh.SampleKind.PUT))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.liveliness().declare_subscriber(key, handler, history=True))

    def sees(self, key: str) -> bool:
        """Whether anybody holds the liveliness token of a key now.

        Args:
            key: a key expression.
        """
        return any(reply.ok is not None for reply in self._session.liveliness().get(key, timeout=SEE_S))

    def attend(self, key: str, longest: int, mailbox: Mailbox[Question]) -> None:
        """Put queries into a mailbox, to be answered later.

        Args:
            key: the key that is queried.
            longest: bytes of the longest payload that is accepted.
            mailbox: where they wait.
        """

        def receive(query: zenoh.Query) -> None:
            payload = query.payload
            if payload is not None and len(payload) > longest:
                mailbox.refused["oversized"] += 1
            else:
                mailbox.put(key, Question(b"" if payload is None else payload.to_bytes(), _answers(query, key)))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_queryable(key, handler))

    def ask(self, key: str, payload: bytes, wait_s: float) -> bytes | None:
        """The first answer to a query.

        Args:
            key: to query.
            payload: of the query.
            wait_s: how long to wait.

        Returns:
            the answer, or None when none came in time.
        """
        replies = self._session.get(key, payload=payload, timeout=wait_s, priority=zenoh.Priority.DATA_HIGH)
        return next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), None)

    def answers(self, key: str, payload: bytes, wait_s: float, longest: int) -> Iterator[bytes]:
        """All answers to a query, as they come: one that claims to be complete does not keep out the others.

        Args:
            key: to query.
            payload: of the query.
            wait_s: how long to wait.
            longest: bytes of the longest answer; longer ones are left out, and what follows `MOST_ANSWERS`.
        """
        everyone, each = zenoh.QueryTarget.ALL, zenoh.ConsolidationMode.NONE
        replies = self._session.get(key, payload=payload, timeout=wait_s, target=everyone, consolidation=each)
        for reply in islice(replies, MOST_ANSWERS):
            if reply.ok is not None and len(reply.ok.payload) <= longest:
                yield reply.ok.payload.to_bytes()

    def echo(self, key: str) -> Callable[[], bool]:
        """Ask the router for a liveliness token, whoever holds it; its answer shows that the router is at work.

        Args:
            key: of the token.

        Returns:
            whether the router has answered.
        """
        back = threading.Event()
        handler: Any = zenoh.handlers.Callback(lambda _: None, back.set, indirect=False)
        self._session.liveliness().get(key, handler=handler, timeout=ECHO_S)
        return lambda: back.is_set() and self.connected  # it comes back as well when the link is cut

    def live(self, key: str) -> None:
        """Declare a liveliness token, which ends with this process or its link.

        Args:
            key: of the token.
        """
        self._declared.append(self._session.liveliness().declare_token(key))

    def close(self, limit_s: float = CLOSE_S) -> bool:
        """Close the session; what is closed already stays so.

        Args:
            limit_s: how long to wait.

        Returns:
            False when closing takes longer than the limit, after which only ending the process helps.
        """
        if self._session.is_closed():
            return True
        closing = threading.Thread(target=self._close, daemon=True)
        closing.start()
        closing.join(limit_s)
        return not closing.is_alive()

    def _close(self) -> None:
        for declared in reversed(self._declared):
            declared.undeclare()
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]


def _answers(query: zenoh.Query, key: str) -> Post:
    def answer(payload: bytes) -> None:
        with query:
            query.reply(key, payload)

    return answer


def open_link(
    router: str,
    wait_s: float,
    waiting: Callable[[float], None] = lambda _waited: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Link:
    """Join a router.

    Args:
        router: its locator, such as ``tcp/127.0.0.1:7447``.
        wait_s: how long to wait for it.
        waiting: called as `TELL_S` says, with the seconds waited, while no router answers.
        stopped: whether to give up.

    Raises:
        LinkDown: when no router has answered after `wait_s`, or `stopped` says so.
    """
    return _open(client_config(router, LEASE_S), router, wait_s, waiting, stopped)


def open_links(
    router: str, radio: str | None, wait_s: float, say: Callable[[str], None], stopped: Callable[[], bool]
) -> tuple[Link, Air] | None:
    """Open the link to the router and the one for positions.

    Args:
        router: the router's locator.
        radio: where robots hear each other, or None for the same router.
        wait_s: how long to wait for each.
        say: takes a line now and then while the process waits.
        stopped: whether to give up.

    Returns:
        both links, which may be the same; None when `stopped` says so.

    Raises:
        BadInput: when nobody has answered after `wait_s`.
    """

    def waiting_for(what: str) -> Callable[[float], None]:
        return lambda waited: say(f"waiting for {what} ({waited:.0f} s)")

    try:
        link = open_link(router, wait_s, waiting_for(f"a router at {router}"), stopped)
    except LinkDown as down:
        if stopped():
            return None
        raise BadInput(f"{down}; start one with: python -m fogwatch.router --listen {router}") from None
    if radio is None:
        return link, link
    try:
        if is_group(radio):
            return link, open_group(radio)
        # A link that has been cut delivers on its return what is long out of date; with a short lease it is a new one.
        config = client_config(radio, RADIO_LEASE_S)
        return link, _open(config, radio, wait_s, waiting_for(f"a router at {radio}"), stopped)
    except (LinkDown, GroupDown) as down:
        link.close()
        if stopped():
            return None
        raise BadInput(f"--radio {radio}: {down}") from None


def _open(
    config: zenoh.Config, router: str, wait_s: float, waiting: Callable[[float], None], stopped: Callable[[], bool]
) -> Link:
    box: list[zenoh.Session | Exception] = []
    done = threading.Event()

    def join() -> None:
        try:
            box.append(zenoh.open(config))
        except zenoh.ZError as error:
            box.append(error)
        done.set()

    threading.Thread(target=join, daemon=True).start()
    began = time.monotonic()
    tell_at = TELL_S[0]
    while not done.wait(0.1):
        waited = time.monotonic() - began
        if stopped() or waited >= wait_s:
            raise LinkDown(f"no router answers at {router}")
        if waited >= tell_at:
            tell_at = waited + TELL_S[1]
            waiting(waited)
    opened = box[0]
    if isinstance(opened, Exception):
        raise LinkDown(f"cannot reach a router at {router} ({_first_line(opened)})")
    return Link(opened)


def open_router(listen: str) -> Link:
    """Be a router.

    Args:
        listen: the locator to listen at.

    Raises:
        LinkDown: in one line, when it cannot listen there.
    """
    try:
        return Link(zenoh.open(router_config(listen)))
    except zenoh.ZError as error:
        if _system_error(error) == errno.EADDRINUSE:
            raise PortBusy(f"{listen}: the port is busy; choose another") from None
        raise LinkDown(f"{listen}: cannot listen there ({_first_line(error)})") from None


def client_config(router: str, lease_s: float) -> zenoh.Config:
    """A client of one router, which waits for it and reconnects to it.

    Args:
        router: its locator.
        lease_s: how long the client may be silent before the router drops it.
    """
    return _config(
        {
            "mode": "client",
            "connect/endpoints": [router],
            "connect/timeout_ms": -1,
            "connect/exit_on_failure": False,
            "connect/retry": _RETRY,
            "listen/endpoints": [],
            "transport/link/tx/lease": round(lease_s * 1000),
        }
    )


def router_config(listen: str) -> zenoh.Config:
    """A router that listens at one locator.

    Args:
        listen: the locator.
    """
    return _config({"mode": "router", "listen/endpoints": [listen], "connect/endpoints": [], _CLOSE: _CLOSE_US})


def _config(values: dict[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    quiet = {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tcp/so_rcvbuf": _SOCKET,
        "transport/link/tcp/so_sndbuf": _SOCKET,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": _DROP_US,
        "transport/link/tx/queue/size/interactive_high": _QUEUE,
    }
    for key, value in {**quiet, **values}.items():
        config.insert_json5(key, json.dumps(value))
    return config
