"""Nodes of ROS 2 in one process: links (`ros2.wire.ports.Ros2Link`) that need no router."""

from __future__ import annotations

import time
from collections import defaultdict
from typing import Any

from ros2.wire.mailbox import Received, RosMailbox
from ros2.wire.names import USUAL, Entity, EntityKind, NodeName, Qos, full_name
from ros2.wire.ports import Asked


class Hub:
    """Where nodes meet.

    Attributes:
        sent: All messages by topic.
    """

    def __init__(self) -> None:
        self.sent: defaultdict[str, list[Any]] = defaultdict(list)
        self.listening: defaultdict[str, list[tuple[type, RosMailbox[Any]]]] = defaultdict(list)
        self.latched: dict[str, Any] = {}
        self.services: dict[str, RosMailbox[Any]] = {}
        self.entities: list[Entity] = []

    def link(self, name: str, namespace: str) -> HubLink:
        """A node."""
        return HubLink(self, NodeName(name, namespace))

    def deliver(self, topic: str, message: Any) -> None:
        """Send a message to all who listen for its type."""
        self.sent[topic].append(message)
        for kind, mailbox in self.listening[topic]:
            if isinstance(message, kind):
                mailbox.put(Received(message, time.monotonic(), time.time_ns()))


class HubSender:
    """A publisher."""

    def __init__(self, hub: Hub, topic: str, qos: Qos) -> None:
        self._hub, self._topic, self._qos = hub, topic, qos

    def send(self, message: Any) -> None:
        """Send a message."""
        if self._qos.latched:
            self._hub.latched[self._topic] = message, time.time_ns()
        self._hub.deliver(self._topic, message)


class HubLink:
    """A node (`Ros2Link`)."""

    def __init__(self, hub: Hub, node: NodeName) -> None:
        self._hub, self.node = hub, node

    def is_ours(self, entity: Entity) -> bool:
        """Whether something is of this node."""
        return entity.node == self.node

    def resolve(self, name: str) -> str:
        """The full name."""
        return full_name(self.node.namespace, name)

    def publisher(self, topic: str, kind: type[Any], qos: Qos = USUAL) -> HubSender:
        """A publisher."""
        full = self.resolve(topic)
        number = len(self._hub.entities) + 1
        self._hub.entities.append(Entity(0, "z", 1, number, EntityKind.PUBLISHER, self.node, full, kind.__name__))
        return HubSender(self._hub, full, qos)

    def subscribe(self, topic: str, kind: type[Any], mailbox: RosMailbox[Any], qos: Qos = USUAL) -> None:
        """Listen."""
        full = self.resolve(topic)
        self._hub.listening[full].append((kind, mailbox))
        if qos.latched and full in self._hub.latched:
            message, sent_ns = self._hub.latched[full]
            mailbox.put(Received(message, time.monotonic(), sent_ns))

    def call(self, name: str, service: Any, request: Any, limit_s: float) -> RosMailbox[Any]:
        """Ask a service."""
        del service, limit_s
        answers: RosMailbox[Any] = RosMailbox()
        if (server := self._hub.services.get(self.resolve(name))) is not None:
            asked: Asked[Any, Any] = Asked(request, lambda answer: answers.put(Received(answer, time.monotonic())))
            server.put(Received(asked, time.monotonic()))
        return answers

    def serve(self, name: str, service: Any, mailbox: RosMailbox[Any]) -> None:
        """Offer a service."""
        del service
        self._hub.services[self.resolve(name)] = mailbox

    def other_format(self, limit_s: float) -> str:
        """No node has another format."""
        del limit_s
        return ""

    def graph(self, limit_s: float) -> list[Entity]:
        """All that is there."""
        del limit_s
        return list(self._hub.entities)

    def close(self) -> bool:
        """Nothing to close."""
        return True
