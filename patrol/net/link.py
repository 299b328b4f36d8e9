"""The one link to Zenoh: a client of a router, with mailboxes that any number of subscriptions fill.

Messages arrive on Zenoh's own thread, which decodes them and puts them into a `Mailbox`; whoever owns the mailbox takes
them out with a time limit. What is too long, malformed, unknown or more than there is room for is dropped there and
counted, so that it never wakes the owner. Room is per key, so that a flood on one takes nothing from the others.

Socket buffers are small: with the system's, a flood of a million tiny messages a second left 300 000 of them between a
tick and its reader, who then heard it seconds late; so it is a tenth of a second.
"""

from __future__ import annotations

import errno
import json
import re
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import zenoh

from patrol.errors import BadInput
from patrol.net.keys import is_group
from patrol.net.multicast import GroupDown, open_group

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

_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
_ROOM = 256
_SOCKET = 65536
_QUEUE = 16
"""Messages that may wait to be sent, the most that Zenoh allows. With its 2 a busy machine dropped, of what may be, one
in seven from the third of a burst on: at a pace only the first two robots of a fleet were told every pose."""
_DROP_US = 100
"""How long to wait, of what may be dropped, for one who does not read; everybody behind waits too."""

T = TypeVar("T")

Post = Callable[[bytes], None]
"""Sends one payload under the key it was made for."""


class LinkDown(Exception):
    """No router answered in time, or none can be here; one line says which."""


class PortBusy(LinkDown):
    """No router can listen here, since another program listens on the port."""


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


class Link:
    """A session with a router. Everything declared on it lives until `close`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._declared: list[Any] = []

    @property
    def connected(self) -> bool:
        """Whether a router is at the other end now; clients find back to one that returns by themselves."""
        return bool(self._session.info.routers_zid())

    def post(self, key: str, *, waits: bool = True) -> Post:
        """What ticks and answers are sent with: at once, ahead of all else.

        waits: whether to wait where a queue is full, or to drop. One receiver that has stopped reading then holds up
        its router, and with it everything that this link sends to anybody.
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
        """What a direct radio sends with: at once, to all others, and lost rather than late."""
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

    def show(self, key: str) -> Post:
        """What eyes are shown: dropped where a queue is full, so that it never holds up a tick."""
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.DATA_LOW
        )
        self._declared.append(publisher)
        return publisher.put

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Let messages under a key expression into a mailbox."""

        def receive(sample: zenoh.Sample) -> None:
            mailbox.deliver(str(sample.key_expr), sample.payload)

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_subscriber(key, handler))

    def watch(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Let the liveliness tokens under a key expression into a mailbox: those there are, and every change."""

        def receive(sample: zenoh.Sample) -> None:
            mailbox.put(str(sample.key_expr), Presence(sample.kind == zenoh.SampleKind.PUT))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.liveliness().declare_subscriber(key, handler, history=True))

    def sees(self, key: str) -> bool:
        """Whether anybody holds the liveliness token of a key now."""
        return any(reply.ok is not None for reply in self._session.liveliness().get(key, timeout=SEE_S))

    def attend(self, key: str, longest: int, mailbox: Mailbox[Question]) -> None:
        """Let the questions under a key into a mailbox, to be answered at leisure."""

        def receive(query: zenoh.Query) -> None:
            payload = query.payload
            if payload is not None and len(payload) > longest:
                mailbox.refused["oversized"] += 1
            else:
                mailbox.put(key, Question(b"" if payload is None else payload.to_bytes(), _answers(query, key)))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_queryable(key, handler))

    def ask(self, key: str, payload: bytes, wait_s: float) -> bytes | None:
        """The first answer to a question, or None when nobody has one in time."""
        replies = self._session.get(key, payload=payload, timeout=wait_s, priority=zenoh.Priority.DATA_HIGH)
        return next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), None)

    def live(self, key: str) -> None:
        """Declare a liveliness token, which ends with this process or its link."""
        self._declared.append(self._session.liveliness().declare_token(key))

    def close(self, limit_s: float = CLOSE_S) -> bool:
        """Close the session; False when that takes longer than the limit, after which only ending the process helps.

        What is closed already stays so.
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
            query.reply(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    return answer


def open_link(
    router: str,
    wait_s: float,
    waiting: Callable[[float], None] = lambda _waited: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Link:
    """Join the router at a locator such as ``tcp/127.0.0.1:7447``.

    waiting: called as `TELL_S` says, with the seconds waited, while no router answers. Raises LinkDown when none has
    after wait_s, or when `stopped` says so.
    """
    return _open(client_config(router, LEASE_S), router, wait_s, waiting, stopped)


def open_links(
    router: str, radio: str | None, wait_s: float, say: Callable[[str], None], stopped: Callable[[], bool]
) -> tuple[Link, Air] | None:
    """The link to the router and the one for positions, the same unless `radio` says where; None when told to stop.

    say: takes a line now and then while somebody is waited for. Raises BadInput when nobody has answered after wait_s.
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
        raise LinkDown(f"no router at {router} ({_first_line(opened)})")
    return Link(opened)


def open_router(listen: str) -> Link:
    """Be a router at a locator; LinkDown, in one line, when that is not to be had."""
    try:
        return Link(zenoh.open(router_config(listen)))
    except zenoh.ZError as error:
        if _system_error(error) == errno.EADDRINUSE:
            raise PortBusy(f"{listen}: the port is busy; choose another") from None
        raise LinkDown(f"{listen}: cannot listen there ({_first_line(error)})") from None


def _system_error(error: Exception) -> int | None:
    """The system's error number, which Zenoh gives in its text alone; None where there is none."""
    found = re.search(r"\(os error (\d+)\)", str(error))
    return int(found[1]) if found else None


def _first_line(error: Exception) -> str:
    """What Zenoh says, without where in its sources it says so."""
    text = str(error).partition(" at /")[0].partition("\n")[0]
    system = re.search(r": ([^:\[\]]+) \(os error \d+\)", text)
    return system[1] if system else text


def client_config(router: str, lease_s: float) -> zenoh.Config:
    """A client of one router, that waits for it and finds back to it."""
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
    """A router that listens at one locator."""
    return _config({"mode": "router", "listen/endpoints": [listen], "connect/endpoints": []})


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
