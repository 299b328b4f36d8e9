"""The one link to Zenoh: a client of a router, or a member of a mesh, whose subscriptions fill mailboxes.

Messages arrive on Zenoh's own thread, which puts them into a `runtime.net.mailbox.Mailbox`.
"""

from __future__ import annotations

import atexit
import errno
import json
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import zenoh

from runtime.net.mailbox import Mailbox, Post, Presence, Question
from runtime.net.neighbours import Neighbours
from runtime.net.queries import all_answers, answers_until
from runtime.net.settings import client_settings, router_settings
from runtime.security.keys import address_of
from runtime.security.mesh import everywhere
from runtime.security.roles import Kind

if TYPE_CHECKING:
    from runtime.security.credentials import Credentials, RouterSecurity
    from runtime.security.mesh import Mesh


def system_error(error: Exception) -> int | None:
    """Return the number of the system's error in the text of a Zenoh error; None without one.

    For example, 98 for "Can not bind: Address already in use (os error 98) at /...".
    """
    match = re.search(r"\(os error (\d+)\)", str(error))
    return None if match is None else int(match[1])


def first_line(error: Exception) -> str:
    """Return Zenoh's text without the place in its sources.

    For example, "Address already in use" for "Can not bind: Address already in use (os error 98) at /...".
    """
    text = str(error).partition(" at /")[0].partition("\n")[0]
    system = re.search(r": ([^:\[\]]+) \(os error \d+\)", text)
    return system[1] if system else text


LEASE_S = 600.0
"""A client that is silent for so long is gone for the router; longer than a paused robot may take to answer, and than a
host may be cut off. One whose process ends is gone at once, since its connection ends."""

CLOSE_S, MESH_CLOSE_S = 2.0, 0.3
"""Longest wait for closing, s; under loss closing has taken longer. In a mesh Zenoh closes only when its attempts to
connect to members that are not there have ended, up to 10 s later; by then all that was declared has gone."""

CLOSING, AT_END_S = "closing", 12.0
"""The name of the threads that close sessions, and the longest wait for them when the interpreter ends, s."""

SEE_S = 5.0
"""Longest wait for the router's list of tokens, s."""

TELL_S = (1.0, 5.0)
"""Waiting time before a process first says that it waits, and between later times, s."""

ECHO_S = 3600.0
"""Longest wait for a router that does not answer, s."""

MSGPACK = zenoh.Encoding.ZENOH_BYTES.with_schema("msgpack")
"""What tools that show a fleet's messages need to know to show more than bytes. Every message carries it, so it is
short."""

SETTLE_S = 1.0
"""How long a process that looks at a mesh waits for the other robots and the world, after it has met the first, s."""

KNOCK_S = 1.0
"""Longest wait for a connection where no router has answered, s."""

_ADMISSION = (
    "its credentials are missing, wrong or expired, or the router hangs; give --credentials FOLDER, made by: fogwatch "
    "fleet init (for a run of this machine, name the run's folder)"
)


class LinkDown(Exception):
    """No router answered in time, or none can be here; one line says which."""


class NotAdmitted(LinkDown):
    """A router is there, and does not let this process in."""


class PortBusy(LinkDown):
    """No router can listen here, since another program listens on the port."""


class Link:
    """A session with a router, or with the others of a mesh. Everything declared on it lives until `close`.

    `mesh` is the fleet that it is a member of, where the members meet without a router; else None.
    """

    def __init__(self, session: zenoh.Session, mesh: Mesh | None = None) -> None:
        self.mesh = mesh
        self._session = session
        self._declared: list[Any] = []

    @property
    def connected(self) -> bool:
        """True if a router is at the other end now, to which clients find back by themselves; always in a mesh."""
        return self.mesh is not None or bool(self._session.info.routers_zid())

    @cached_property
    def neighbours(self) -> Neighbours:
        """The members that it is connected to, by the names of their certificates."""
        neighbours = Neighbours(self._session)
        self._declared.append(neighbours.listener)
        return neighbours

    @property
    def connections(self) -> int:
        """Number of processes at the other ends now: of a router, those that are connected to it."""
        return len(self._session.info.transports())

    def post(self, key: str, *, waits: bool = True, together: bool = False) -> Post:
        """Make a publisher for ticks and answers: sends at once, ahead of all else.

        Where a queue is full, it waits, or drops the message if `waits` is False. While it waits, one receiver that has
        stopped reading holds up its router, and with it everything that this link sends.

        `together` is for a sender to many at a time: what is sent while an earlier message still waits travels with it,
        in pieces of up to 64 KiB. Each message on its own takes a place in the queue: of a burst to 50 robots, a busy
        machine dropped all messages after the 16th (`runtime.net.settings`).
        """
        control = zenoh.CongestionControl.BLOCK if waits else zenoh.CongestionControl.DROP
        publisher = self._session.declare_publisher(
            key,
            congestion_control=control,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            encoding=MSGPACK,
            express=not together,
        )
        self._declared.append(publisher)
        return publisher.put

    def broadcast(self, key: str) -> Post:
        """Make a publisher for a direct radio: sends at once, to all others; a message is lost rather than late.

        Positions of many robots that wait on their way travel together, as those of `post` may. Otherwise a router on a
        busy machine dropped all after the 16th of those that were sent at the same time.
        """
        publisher = self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            encoding=MSGPACK,
            express=False,
            reliability=zenoh.Reliability.BEST_EFFORT,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        self._declared.append(publisher)
        return publisher.put

    def publisher(self, key: str) -> Post:
        """Make a publisher for observers: drops a message where a queue is full, so that it never holds up a tick."""
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.DATA_LOW, encoding=MSGPACK
        )
        self._declared.append(publisher)
        return publisher.put

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put messages into a mailbox."""

        def receive(sample: zenoh.Sample) -> None:
            mailbox.deliver(str(sample.key_expr), sample.payload)

        # On Zenoh's own thread: a thread of Python's in between would delay every message.
        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_subscriber(key, handler))

    def watch(self, key: str, mailbox: Mailbox[Any]) -> None:
        """Put liveliness tokens into a mailbox, as `Presence`: those that exist now, and every change."""

        def receive(sample: zenoh.Sample) -> None:
            mailbox.put(str(sample.key_expr), Presence(sample.kind == zenoh.SampleKind.PUT))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        # `history` gives tokens that were there before, or robots that came first would never be seen.
        self._declared.append(self._session.liveliness().declare_subscriber(key, handler, history=True))

    def sees(self, key: str) -> bool:
        """Return True if any process holds the liveliness token of a key now."""
        return any(reply.ok is not None for reply in self._session.liveliness().get(key, timeout=SEE_S))

    def seen(self, key: str, most: int) -> list[str]:
        """List the keys of liveliness tokens that are held now, at most `most` of them."""
        replies = self._session.liveliness().get(key, timeout=SEE_S)
        return [str(reply.ok.key_expr) for reply in islice(replies, most) if reply.ok is not None]

    def attend(self, key: str, longest: int, mailbox: Mailbox[Question]) -> None:
        """Put queries into a mailbox, to be answered later; payloads of more than `longest` bytes are refused."""

        def receive(query: zenoh.Query) -> None:
            payload = query.payload
            if payload is not None and len(payload) > longest:
                mailbox.refused["oversized"] += 1
            else:
                mailbox.put(key, Question(b"" if payload is None else payload.to_bytes(), _make_answer(query, key)))

        handler = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_queryable(key, handler))

    def ask(self, key: str, payload: bytes, wait_s: float) -> bytes | None:
        """Return the first answer to a query, or None when none came within `wait_s`."""
        replies = self._session.get(key, payload=payload, timeout=wait_s, priority=zenoh.Priority.DATA_HIGH)
        return next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), None)

    def answers(self, key: str, payload: bytes, longest: int, wait_s: float) -> Iterator[bytes]:
        """Give all answers to a query (`runtime.net.queries.all_answers`)."""
        return all_answers(self._session, key, payload, longest, wait_s)

    def answers_until(
        self, keys: Sequence[str], payload: bytes, longest: int, wait_s: float
    ) -> Iterator[tuple[str, bytes]]:
        """Give all answers to a query under several keys at once (`runtime.net.queries.answers_until`)."""
        return answers_until(self._session, keys, payload, longest, wait_s)

    def echo(self, key: str) -> Callable[[], bool]:
        """Ask the router for a liveliness token of any holder; its answer shows that the router is at work.

        The function returned tells whether the router has answered; in a mesh, which has none, it is always True.
        """
        if self.mesh is not None:
            return lambda: True
        back = self.pulse(key)
        return lambda: back() and self.connected  # it comes back as well when the link is cut

    def pulse(self, key: str) -> Callable[[], bool]:
        """Ask the router's own tables for a liveliness token; they answer also when the link is cut.

        The function returned tells whether they have answered.
        """
        back = threading.Event()
        handler: Any = zenoh.handlers.Callback(lambda _: None, back.set, indirect=False)
        self._session.liveliness().get(key, handler=handler, timeout=ECHO_S)
        return back.is_set

    def live(self, key: str) -> None:
        """Declare a liveliness token, which ends with this process or its link."""
        self._declared.append(self._session.liveliness().declare_token(key))

    def close(self, limit_s: float | None = None) -> bool:
        """Close the session; return False when that takes longer than the limit or than Zenoh allows.

        Then only ending the process helps. What is closed already stays so. The limit is `CLOSE_S` or `MESH_CLOSE_S`
        unless given.
        """
        usual_s = CLOSE_S if self.mesh is None else MESH_CLOSE_S
        return close_session(self._session, self._declared, usual_s if limit_s is None else limit_s)


def close_session(session: zenoh.Session, declared: list[Any], limit_s: float) -> bool:
    """Close a session; return False when that takes longer than the limit or than Zenoh allows.

    Then only ending the process helps. A session that is closed already stays so. What was declared on it, in order, is
    undeclared, and the list emptied.
    """
    closed = threading.Event()

    def close() -> None:
        with suppress(zenoh.ZError):  # Zenoh gives up by itself when the other side does not answer
            for declaration in reversed(declared):
                declaration.undeclare()
            declared.clear()
            session.close()  # type: ignore[no-untyped-call]
            closed.set()

    if session.is_closed():
        return True
    # Zenoh may hang here. A thread can be left behind, a call cannot.
    closing = threading.Thread(target=close, name=CLOSING, daemon=True)
    closing.start()
    closing.join(limit_s)
    return closed.is_set()


def is_closing() -> bool:
    """Return True if a session still closes: an interpreter that ends waits for its thread, and `os._exit` does not."""
    return bool(_closing_threads())


def _closing_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == CLOSING]


@atexit.register
def _await_closing() -> None:
    """Wait for the threads that close sessions, which abort an interpreter that ends."""
    until = time.monotonic() + AT_END_S
    for thread in _closing_threads():
        thread.join(max(0.0, until - time.monotonic()))


def _make_answer(query: zenoh.Query, key: str) -> Post:
    def answer(payload: bytes) -> None:
        with query, suppress(zenoh.ZError):  # the link has been closed meanwhile, or the asking process has gone
            query.reply(key, payload)

    return answer


def open_link(
    router: str,
    wait_s: float,
    waiting: Callable[[float], None] = lambda _waited: None,
    stopped: Callable[[], bool] = lambda: False,
    credentials: Credentials | None = None,
) -> Link:
    """Join a router, or the other members of a mesh.

    Robots and worlds of a mesh do not wait for others; whatever watches or controls it waits for the first.

    Several routers, with commas between them, are tried in turn. While none answers, `waiting` is called with the
    seconds waited, as often as `TELL_S` says. LinkDown is raised when none has answered after `wait_s`, or `stopped`
    returns True. Credentials are None for a router that asks for none.
    """
    settings = client_settings(router, LEASE_S, credentials)
    if credentials is None or credentials.mesh is None:
        return Link(open_session(settings, router, wait_s, waiting, stopped))
    link = _open_listening(settings, credentials.listens_at, mesh=credentials.mesh)
    if credentials.role.kind not in (Kind.VIEWER, Kind.OPERATOR):
        return link
    # The link closes if no member answers, or if the wait is broken off.
    with ExitStack() as undone:
        undone.callback(link.close)
        if not _wait_until(link.neighbours.await_any, wait_s, waiting, stopped):
            raise LinkDown(f"no member of fleet {credentials.fleet} answers at {router}")
        patrolling = (Kind.ROBOT, Kind.WORLD)
        names = [name for name, role in credentials.mesh.members.items() if role.kind in patrolling]
        link.neighbours.await_all(names, SETTLE_S)
        undone.pop_all()
    return link


def open_session(
    settings: Mapping[str, object],
    router: str,
    wait_s: float,
    waiting: Callable[[float], None],
    stopped: Callable[[], bool],
) -> zenoh.Session:
    """Open a session with a router, for uses of Zenoh that a `Link` does not offer.

    The settings are Zenoh's, by dotted name (`client_settings`); all else is as for `open_link`. Raises NotAdmitted, a
    LinkDown, when the router does not let this process in.
    """
    box: list[zenoh.Session | Exception] = []
    is_open = threading.Event()

    def join() -> None:
        try:
            box.append(zenoh.open(_make_config(settings)))
        except zenoh.ZError as error:
            box.append(error)
        is_open.set()

    # Zenoh waits without a limit, so another thread opens and this one watches the time.
    # A daemon, or a hanging attempt would keep the process from ending.
    threading.Thread(target=join, daemon=True).start()
    if not _wait_until(is_open.wait, wait_s, waiting, stopped):
        # Zenoh reports both in the same way, but a port that is open says that a router has refused.
        # After the wait: asking takes up to `KNOCK_S`.
        if not stopped() and listens(router):
            raise NotAdmitted(f"a router at {router} does not let this process in: {_ADMISSION}")
        raise LinkDown(f"no router answers at {router}")
    opened = box[0]
    if isinstance(opened, Exception):
        raise LinkDown(f"cannot reach a router at {router} ({first_line(opened)})")
    return opened


def _wait_until(
    ready: Callable[[float], bool], wait_s: float, waiting: Callable[[float], None], stopped: Callable[[], bool]
) -> bool:
    """Wait until something is ready, and say so now and then; False when time is up or `stopped` says so."""
    began = time.monotonic()
    tell_at = TELL_S[0]
    while not ready(0.1):
        waited = time.monotonic() - began
        if stopped() or waited >= wait_s:
            return False
        if waited >= tell_at:
            tell_at = waited + TELL_S[1]
            waiting(waited)
    return True


def listens(routers: str) -> bool:
    """Return True if anything listens at one of some addresses, so that it must have refused us; not for quic."""
    for router in routers.split(","):
        if router.startswith(("quic/", "udp/")):
            continue
        try:
            socket.create_connection(address_of(router), KNOCK_S).close()
        except OSError:
            continue
        return True
    return False


def open_router(listen: str, security: RouterSecurity | None = None, others: Sequence[str] = ()) -> Link:
    """Open a router that listens at a locator; raise LinkDown when it cannot listen there.

    Without `security` it allows everything. `others` are locators of the fleet's routers at other sites, to connect to.
    """
    return _open_listening(router_settings(listen, security, others), listen)


def _open_listening(settings: Mapping[str, object], listen: str, mesh: Mesh | None = None) -> Link:
    try:
        return Link(zenoh.open(_make_config({**settings, "listen/endpoints": [listen]})), mesh)
    except zenoh.ZError as error:
        # The member's address is none of this host, as behind a NAT, so it listens on all of them.
        if mesh is not None and system_error(error) == errno.EADDRNOTAVAIL and everywhere(listen) != listen:
            return _open_listening(settings, everywhere(listen), mesh)
        if system_error(error) == errno.EADDRINUSE:
            remedy = "choose another" if mesh is None else "another process is this member already; end that one"
            raise PortBusy(f"{listen}: the port is busy; {remedy}") from None
        raise LinkDown(f"{listen}: cannot listen there ({first_line(error)})") from None


def _make_config(values: Mapping[str, object]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return config
