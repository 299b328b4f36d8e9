"""A node of ROS 2: a session with the robot's Zenoh router. Messages arrive on its thread, which fills mailboxes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count, islice
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh
from zenoh.ext import CacheConfig, HistoryConfig, declare_advanced_publisher, declare_advanced_subscriber

from patrol.errors import Malformed, printable
from ros2.wire.codec import CODINGS, decode, encode
from ros2.wire.definitions import NO_HASH, store
from ros2.wire.formats import Attachment, Format, Origin, attachment_of, gid_of, other_format
from ros2.wire.mailbox import Ear, Received, RosMailbox
from ros2.wire.names import SERVICE, USUAL, Entity, EntityKind, NodeName, Qos, full_name
from ros2.wire.ports import Asked, Sender, Service
from runtime.net.link import CLOSE_S, close_session, open_session
from runtime.net.queries import answers_of
from runtime.net.settings import client_settings

if TYPE_CHECKING:
    from runtime.security.credentials import Credentials

LEASE_S = 2.0
"""Silence after which a node is gone for the router, s. Messages that wait for it are dropped then: a command or a pose
that is seconds old does harm."""

BLOCKED_US = 1_000_000
"""Longest time that a latched message waits for a router that does not read; then the link is made anew."""

_LONGEST_ATTACHMENT = 64
_LONGEST_SAID = 1 << 20
"""Bytes of the longest answer of a router about itself: 300 for each connection."""
_LONGEST_VERSION = 32
_MOST_ENTITIES = 10_000

M = TypeVar("M")
Q = TypeVar("Q")
A = TypeVar("A")

Attacher = Callable[[], "bytes | None"]
"""Makes the attachment of the next message; None where the format has none."""


class ZenohRos2Link:
    """A node of ROS 2 (`ros2.wire.ports.Ros2Link`)."""

    def __init__(self, session: zenoh.Session, form: Format, node: NodeName) -> None:
        self._session = session
        store()  # says at once if it cannot be had, and not on Zenoh's thread
        self._format = form
        self.node = node
        self._id = str(session.info.zid())
        self._numbers = count()
        self._node_number = next(self._numbers)
        self._declared: list[Any] = []
        self._clients: dict[str, Attacher] = {}
        self._show_entity(
            Entity(self._format.domain, self._id, self._node_number, self._node_number, EntityKind.NODE, node)
        )

    def is_ours(self, entity: Entity) -> bool:
        """Return True if something in the graph is of this link itself."""
        return entity.session == self._id

    def resolve(self, name: str) -> str:
        """Return the full name of a topic or service, which may be relative to the node's namespace."""
        return full_name(self.node.namespace, name)

    def publisher(self, topic: str, kind: type[M], qos: Qos = USUAL) -> Sender[M]:
        """Return a publisher (`ros2.wire.ports.Ros2Link`).

        It drops a message rather than being late. A latched one waits, for at most `BLOCKED_US`, where the router does
        not read. So a caller that has to be on time lets another thread send latched messages.
        """
        full = self.resolve(topic)
        type_name = CODINGS[kind].type_name
        key = self._format.key(full, type_name)
        if qos.latched:
            publisher: Any = declare_advanced_publisher(
                self._session,
                key,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=zenoh.Priority.DATA_LOW,
                cache=CacheConfig(max_samples=qos.depth),
                publisher_detection=True,
            )
        else:
            publisher = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
                express=True,
            )
        self._declared.append(publisher)
        attacher = self._make_attacher(self._make_entity(EntityKind.PUBLISHER, full, type_name, qos))
        return _Publisher(publisher, attacher)

    def subscribe(self, topic: str, kind: type[M], mailbox: RosMailbox[M], qos: Qos = USUAL) -> None:
        """Put messages of a topic into a mailbox (`ros2.wire.ports.Ros2Link`)."""
        full = self.resolve(topic)
        coding = CODINGS[kind]
        expected = frozenset({"", NO_HASH, coding.type_hash})

        def receive(sample: zenoh.Sample) -> None:
            key = str(sample.key_expr)
            if (wrong := _type_mismatch(full, self._format.origin(key), coding.type_name, expected)) is not None:
                mailbox.refuse(*wrong)
            elif sample.kind == zenoh.SampleKind.PUT:
                _deliver_message(kind, full, sample.payload, sample.attachment, mailbox, _stamp_ns(sample.timestamp))

        self._listen(self._format.heard(full), receive, qos.depth if qos.latched else 0)
        self._show_entity(self._make_entity(EntityKind.SUBSCRIPTION, full, coding.type_name, qos))

    def call(self, name: str, service: Service[Q, A], request: Q, limit_s: float) -> RosMailbox[A]:
        """Ask a service, without waiting for the response (`ros2.wire.ports.Ros2Link`).

        All servers under its name and type are asked, whatever their hash. So the link needs no list of them, and a
        process that only claims to be a server keeps no request from the others.
        """
        full = self.resolve(name)
        payload = encode(request)
        if full not in self._clients:
            self._clients[full] = self._make_attacher(
                self._make_entity(EntityKind.CLIENT, full, service.type_name, SERVICE)
            )
        mailbox: RosMailbox[A] = RosMailbox()

        def receive(reply: zenoh.Reply) -> None:
            if (sample := reply.ok) is not None:
                _deliver_message(service.response, full, sample.payload, sample.attachment, mailbox)

        self._session.get(
            self._format.service_key(full, service.type_name),
            payload=payload,
            attachment=self._clients[full](),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=limit_s,
            priority=zenoh.Priority.DATA_HIGH,
            handler=zenoh.handlers.Callback(receive, indirect=False),
        )
        return mailbox

    def serve(self, name: str, service: Service[Q, A], mailbox: RosMailbox[Asked[Q, A]]) -> None:
        """Offer a service (`ros2.wire.ports.Ros2Link`)."""
        full = self.resolve(name)
        key = self._format.key(full, service.type_name)

        def receive(query: zenoh.Query) -> None:
            questions: RosMailbox[Q] = RosMailbox()
            attachment = attachment_of(_attachment_bytes(query.attachment))
            _deliver_message(service.request, full, query.payload, query.attachment, questions)
            for reason, line in questions.said.items():
                mailbox.refuse(reason, line)
            if (received := questions.take()) is not None:
                question = Asked(received.message, _answer_request(query, key, attachment))
                mailbox.put(Received(question, received.at_s, received.sent_ns, received.sequence, received.sender))

        handler: Any = zenoh.handlers.Callback(receive, indirect=False)
        self._declared.append(self._session.declare_queryable(key, handler, complete=True))
        self._show_entity(self._make_entity(EntityKind.SERVER, full, service.type_name, SERVICE))

    def graph(self, limit_s: float) -> list[Entity]:
        """Return the ROS graph's entities now, as far as the format tells; waits (`ros2.wire.ports.Ros2Link`)."""
        entities = map(self._format.entity, self.tokens(self._format.graph, limit_s))
        return [entity for entity in entities if entity is not None]

    def other_format(self, limit_s: float) -> str:
        """Return the format of nodes that this link cannot hear, and the remedy (`ros2.wire.ports.Ros2Link`)."""
        return other_format(self._format, lambda graph: self.tokens(graph, limit_s))

    def tokens(self, expression: str, limit_s: float) -> list[str]:
        """Return the liveliness tokens that there are now, each once, at most 10 000; waits."""
        replies = self._session.liveliness().get(expression, timeout=limit_s)
        keys = (str(reply.ok.key_expr) for reply in islice(replies, _MOST_ENTITIES) if reply.ok is not None)
        return list(dict.fromkeys(keys))  # the router tells us of our own once more

    def router(self, limit_s: float) -> RouterSays | None:
        """Return the router's description of itself in Zenoh's admin space; None without a valid answer."""
        selectors = [f"@/{router}/router" for router in self._session.info.routers_zid()]
        answers = answers_of(self._session, selectors, b"", _LONGEST_SAID, limit_s)
        return next((says for _, answer in answers if (says := router_says(answer, self._id)) is not None), None)

    def overhear(self, expression: str, ear: Ear, latched: bool) -> None:
        """Note all messages under a key expression, whatever they are; if `latched`, also those sent before."""

        def receive(sample: zenoh.Sample) -> None:
            ear.note(
                str(sample.key_expr),
                sample.payload,
                _attachment_bytes(sample.attachment),
                time.monotonic(),
                time.time_ns(),
            )

        self._listen(expression, receive, int(latched))

    def _listen(self, expression: str, receive: Callable[[zenoh.Sample], None], history: int) -> None:
        """Call a function with each message under a key expression, and with so many that were sent before."""
        handler: Any = zenoh.handlers.Callback(receive, indirect=False)
        if history:
            past = HistoryConfig(detect_late_publishers=True, max_samples=history)
            subscriber: Any = declare_advanced_subscriber(self._session, expression, handler, history=past)
        else:
            subscriber = self._session.declare_subscriber(expression, handler)
        self._declared.append(subscriber)

    def close(self, limit_s: float = CLOSE_S) -> bool:
        """Close the session; closing it once more does nothing.

        It returns False when closing takes longer than `limit_s` or than Zenoh allows; then only ending the process
        helps.
        """
        return close_session(self._session, self._declared, limit_s)

    def _make_entity(self, kind: EntityKind, full: str, type_name: str, qos: Qos) -> Entity:
        type_hash = self._format.hash_of(type_name)
        numbers = self._node_number, next(self._numbers)
        return Entity(self._format.domain, self._id, *numbers, kind, self.node, full, type_name, type_hash, qos)

    def _show_entity(self, entity: Entity) -> None:
        """Make something of ours visible in the graph."""
        if self._format.attaches:
            self._declared.append(self._session.liveliness().declare_token(entity.token))

    def _make_attacher(self, entity: Entity) -> Attacher:
        """Show a publisher or client, and return the maker of its attachments, which count its messages."""
        self._show_entity(entity)
        if not self._format.attaches:
            return lambda: None
        numbers, gid = count(1), gid_of(entity.token)
        return lambda: Attachment(next(numbers), time.time_ns(), gid).to_bytes()


@dataclass(frozen=True, slots=True)
class RouterSays:
    """A Zenoh router, as it describes itself. A process that answers in its place can forge it."""

    version: str  # of Zenoh, such as "v1.5.0"
    others: int  # number of other processes that are connected to it


def router_says(answer: bytes, own: str) -> RouterSays | None:
    """Read a router's answer about itself, of at most `_LONGEST_SAID` bytes; None for anything else.

    The answer may come from any process. `own` is the asking session's id, which is not counted.
    """
    try:
        says = json.loads(answer)
        version, sessions = says["version"], says["sessions"]
        other_sessions = sum(session["peer"] != own for session in sessions)
        return RouterSays(printable(version[:_LONGEST_VERSION].partition("-")[0]), other_sessions)
    except (ValueError, RecursionError, TypeError, KeyError, AttributeError):
        return None


class _Publisher(Sender[Any]):
    def __init__(self, publisher: Any, attach: Attacher) -> None:
        self._publisher = publisher
        self._attach = attach

    def send(self, message: Any) -> None:
        self._publisher.put(encode(message), attachment=self._attach())


def _answer_request(query: zenoh.Query, key: str, given: Attachment | None) -> Callable[[Any], None]:
    """Answers a request; a response carries the sequence and the client of its request."""

    def answer(response: Any) -> None:
        payload = encode(response)
        back = None if given is None else Attachment(given.sequence, time.time_ns(), given.sender).to_bytes()
        with query:
            query.reply(key, payload, attachment=back)

    return answer


def _type_mismatch(full: str, origin: Origin, type_name: str, expected: frozenset[str]) -> tuple[str, str] | None:
    """Return why messages under a key are not of a type: another type, or a hash that means other fields; else None."""
    if origin.type_name not in {"", type_name}:
        return "type", printable(f"{full}: is a {origin.type_name[:255]}, and should be a {type_name}")
    if origin.type_hash not in expected:
        expected_hashes = ", ".join(sorted(expected - {"", NO_HASH}))
        foreign_hash = origin.type_hash[:80]
        return "hash", printable(
            f"{full}: {type_name} has other fields there: its hash is {foreign_hash}, and ours {expected_hashes}"
        )
    return None


def _deliver_message(
    kind: type[M],
    full: str,
    payload: zenoh.ZBytes | None,
    attached: zenoh.ZBytes | None,
    mailbox: RosMailbox[M],
    stamp_ns: int | None = None,
) -> None:
    """Decode a message and put it into a mailbox, or say there why not; on Zenoh's thread.

    What goes along with it says when it was sent, or else Zenoh's own stamp.
    """
    at_s = time.monotonic()
    if payload is None:
        mailbox.refuse("malformed", f"{full}: nothing in it")
        return
    if len(payload) > CODINGS[kind].longest:
        mailbox.refuse("oversized", f"{full}: {len(payload)} bytes, and at most {CODINGS[kind].longest} are read")
        return
    try:
        message = decode(kind, payload.to_bytes())
    except Malformed as bad:
        mailbox.refuse("malformed", printable(f"{full}: {bad}"))
        return
    attachment = attachment_of(_attachment_bytes(attached))
    if attachment is None:
        mailbox.put(Received(message, at_s, stamp_ns))
    else:
        mailbox.put(Received(message, at_s, attachment.sent_ns, attachment.sequence, attachment.sender))


def _stamp_ns(stamp: zenoh.Timestamp | None) -> int | None:
    """Return the time at which a message was sent, ns since the epoch, by Zenoh's own stamp."""
    return None if stamp is None else stamp.get_time_as_ntp64().as_nanos()


def _attachment_bytes(attached: zenoh.ZBytes | None) -> bytes:
    """Return the bytes of an attachment; none where it is too long to be one."""
    return b"" if attached is None or len(attached) > _LONGEST_ATTACHMENT else attached.to_bytes()


def open_ros2(
    router: str,
    form: Format,
    node: NodeName,
    wait_s: float,
    waiting: Callable[[float], None] = lambda _waited: None,
    stopped: Callable[[], bool] = lambda: False,
    credentials: Credentials | None = None,
) -> ZenohRos2Link:
    """Join the Zenoh router of a robot.

    `router` is its locator, such as ``tcp/192.168.1.20:7447``. While no router answers, `waiting` is called now and
    then with the seconds waited. LinkDown is raised when none has answered after `wait_s`, or once `stopped` returns
    True. `credentials` is None for a router that asks for none.
    """
    store()
    identity = None if credentials is None else replace(credentials, mesh=None)  # a robot's router is none of the mesh
    settings: Mapping[str, object] = {
        **client_settings(router, LEASE_S, identity),
        "transport/link/tx/queue/congestion_control/block/wait_before_close": BLOCKED_US,
        "timestamping/enabled": True,  # without it no subscriber gets what a latched topic sent before
    }
    return ZenohRos2Link(open_session(settings, router, wait_s, waiting, stopped), form, node)
