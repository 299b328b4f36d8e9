"""A node of ROS 2 itself, where ROS is installed: rclpy carries the bytes, whatever middleware it has.

In DDS a subscription that asks for more than a publisher gives hears nothing of it: one that wants what was sent before
(latched) is deaf to a publisher that keeps nothing. So each subscription here is two, the second of which asks for
nothing, and what comes twice is dropped: it has the same publisher, count and time of sending, as far as they are
given. rclpy before 9.1.1 gives no publisher, Cyclone DDS no count.
"""

from __future__ import annotations

import importlib
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, TypeVar

from patrol.errors import BadInput, Malformed, printable
from ros2.wire.codec import CODINGS, decode, encode
from ros2.wire.definitions import store
from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.names import SENSOR, USUAL, Entity, EntityKind, NodeName, Qos, full_name
from ros2.wire.ports import Asked, Sender, Service

CLOSE_S = 5.0
"""Longest time for the thread that hears to end, s."""

_RECENT = 256
"""Messages of a topic that are remembered: more than wait for its two subscriptions."""

_OURS, _OTHERS = "ours", "others"

M = TypeVar("M")
Q = TypeVar("Q")
A = TypeVar("A")


def import_rclpy() -> Any:
    """Return the package rclpy, for which there are no types where it is not installed."""
    try:
        for name in ("event_handler", "executors", "qos", "signals"):
            importlib.import_module(f"rclpy.{name}")
    except ImportError as error:
        raise BadInput(
            f"--robot rclpy: {error}; source ROS's setup.bash with the Python that it is for, or drive the robot "
            "without ROS, by --robot ros2"
        ) from None
    return importlib.import_module("rclpy")


class RclpyLink:
    """A node of ROS 2 (`ros2.wire.ports.Ros2Link`).

    `leave` is called with the reason when the node can hear no more, from the thread that hears; `close` raises the
    error.
    """

    def __init__(self, rclpy: Any, node: NodeName, domain: int, leave: Callable[[str], None]) -> None:
        store()  # says at once if it cannot be had
        self._rclpy, self.node, self._domain, self._leave = rclpy, node, domain, leave
        self._error: Exception | None = None
        self._closing = False
        self._context = rclpy.Context()
        handlers = rclpy.signals.SignalHandlerOptions.NO  # this process has its own
        rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=handlers)
        self._node = rclpy.create_node(node.name, namespace=node.namespace, context=self._context)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._declared: Counter[tuple[EntityKind, str]] = Counter()
        self._thread = threading.Thread(target=self._hear_messages, name="rclpy", daemon=True)
        self._thread.start()

    def is_ours(self, entity: Entity) -> bool:
        """Return True if something in the graph is of this link itself."""
        return entity.session == _OURS

    def resolve(self, name: str) -> str:
        """Return the full name of a topic or service, which may be relative to the node's namespace."""
        return full_name(self.node.namespace, name)

    def other_format(self, limit_s: float) -> str:
        """Return nothing: nodes of other middlewares are not seen."""
        del limit_s
        return ""

    def publisher(self, topic: str, kind: type[M], qos: Qos = USUAL) -> Sender[M]:
        """Return a publisher (`ros2.wire.ports.Ros2Link`)."""
        full, type_name = self.resolve(topic), CODINGS[kind].type_name
        publisher = self._node.create_publisher(_class_of(type_name, full), full, self._qos_profile(qos))
        self._declared[EntityKind.PUBLISHER, full] += 1
        return _Publisher(publisher)

    def subscribe(self, topic: str, kind: type[M], mailbox: RosMailbox[M], qos: Qos = USUAL) -> None:
        """Put messages of a topic into a mailbox (`ros2.wire.ports.Ros2Link`)."""
        full = self.resolve(topic)
        try:
            message_class = _class_of(CODINGS[kind].type_name, full)
        except BadInput as missing:
            mailbox.refuse("type", str(missing))
            return
        recent: deque[tuple[bytes, int | None, int]] = deque(maxlen=_RECENT)

        def receive(payload: bytes, info: dict[str, Any]) -> None:
            at_s, sent_ns, gid = time.monotonic(), info["source_timestamp"], info.get("publisher_gid")
            sender = bytes(gid["data"]) if gid else b""
            sequence = info.get("publication_sequence_number")
            if (sender, sequence, sent_ns) in recent:
                return
            recent.append((sender, sequence, sent_ns))
            try:
                message = decode(kind, payload)
            except Malformed as bad:
                mailbox.refuse("malformed", printable(f"{full}: {bad}"))
                return
            mailbox.put(Received(message, at_s, sent_ns, sequence if sender else None, sender))

        quiet = self._rclpy.event_handler.SubscriptionEventCallbacks(use_default_callbacks=False)
        for wanted in dict.fromkeys((qos, SENSOR)):
            self._node.create_subscription(
                message_class, full, receive, self._qos_profile(wanted), event_callbacks=quiet, raw=True
            )
            self._declared[EntityKind.SUBSCRIPTION, full] += 1

    def call(self, name: str, service: Service[Q, A], request: Q, limit_s: float) -> RosMailbox[A]:
        """Refuse: rclpy asks services in its own classes, and nav2_msgs could not be tried."""
        del service, request, limit_s
        raise BadInput(f"{self.resolve(name)}: --robot rclpy calls no services; drive by --drive twist-stamped")

    def serve(self, name: str, service: Service[Q, A], mailbox: RosMailbox[Asked[Q, A]]) -> None:
        """Refuse, likewise."""
        del service, mailbox
        raise BadInput(f"{self.resolve(name)}: --robot rclpy offers no services")

    def graph(self, limit_s: float) -> list[Entity]:
        """Return the entities of the ROS graph now (`ros2.wire.ports.Ros2Link`); does not wait.

        Another node with our name looks like our own. So as many entities as we have count as ours, and the rest not.
        """
        del limit_s
        remaining = self._declared.copy()
        remaining[EntityKind.NODE, ""] = 1
        ours = self.node.name, self.node.namespace.strip("/")
        entities: list[Entity] = []

        def note(
            kind: EntityKind, name: str, namespace: str, topic: str = "", type_name: str = "", hashed: str = ""
        ) -> None:
            node = NodeName(name, namespace.strip("/"))
            is_ours = (node.name, node.namespace) == ours and remaining[kind, topic] > 0
            remaining[kind, topic] -= is_ours
            session = _OURS if is_ours else _OTHERS
            entities.append(Entity(self._domain, session, 0, 0, kind, node, topic, type_name, hashed))

        for name, namespace in self._node.get_node_names_and_namespaces():
            note(EntityKind.NODE, name, namespace)
        looks = {
            EntityKind.PUBLISHER: self._node.get_publishers_info_by_topic,
            EntityKind.SUBSCRIPTION: self._node.get_subscriptions_info_by_topic,
        }
        for topic, _ in self._node.get_topic_names_and_types():
            for kind, look in looks.items():
                for info in look(topic):
                    hashed = str(info.topic_type_hash)
                    note(kind, info.node_name, info.node_namespace, topic, info.topic_type, hashed)
        return entities

    def close(self, limit_s: float = CLOSE_S) -> bool:
        """Close it; False when that takes too long. Raises the error because of which it could hear no more."""
        self._closing = True
        # Its thread ends first, because rclpy takes nodes apart while an executor still uses them.
        self._executor.create_task(lambda: None)
        self._thread.join(limit_s)
        self._rclpy.try_shutdown(context=self._context)
        if self._error is not None:
            raise self._error
        return not self._thread.is_alive()

    def _hear_messages(self) -> None:
        """Take in messages until `close`."""
        try:
            while not self._closing:
                self._executor.spin_once()
        except self._rclpy.executors.ExternalShutdownException:
            return
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stand, and the process must end
            self._error = error
            self._leave(f"it hears ROS no more: {type(error).__name__}: {error}")

    def _qos_profile(self, qos: Qos) -> Any:
        """Return a quality of service as rclpy has it."""
        of = self._rclpy.qos
        durability, reliability = of.DurabilityPolicy, of.ReliabilityPolicy
        return of.QoSProfile(
            depth=qos.depth,
            durability=durability.TRANSIENT_LOCAL if qos.latched else durability.VOLATILE,
            reliability=reliability.RELIABLE if qos.reliable else reliability.BEST_EFFORT,
            history=of.HistoryPolicy.KEEP_LAST,
        )


class _Publisher(Sender[Any]):
    """Sends messages as bytes."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher

    def send(self, message: Any) -> None:
        self._publisher.publish(encode(message))


def _class_of(type_name: str, topic: str) -> Any:
    """Return rclpy's class of a type. Raises BadInput where its package is not installed."""
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise BadInput(f"{topic}: this ROS has no {type_name}; install its package {package}") from None
