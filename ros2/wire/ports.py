"""The port of a link to a ROS 2 robot, whatever carries it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ros2.wire.mailbox import RosMailbox
from ros2.wire.names import USUAL, Entity, NodeName, Qos

Q = TypeVar("Q")
A = TypeVar("A")
M = TypeVar("M")
M_contra = TypeVar("M_contra", contravariant=True)


@dataclass(frozen=True, slots=True)
class Service(Generic[Q, A]):
    """A kind of service."""

    type_name: str  # such as ``action_msgs/srv/CancelGoal``
    request: type[Q]
    response: type[A]


@dataclass(frozen=True, slots=True)
class Asked(Generic[Q, A]):
    """A request that waits for its response."""

    request: Q
    answer: Callable[[A], None]  # sends the response; once, from any thread but the one that hears


class Sender(Protocol[M_contra]):
    """Sends messages of a topic."""

    def send(self, message: M_contra) -> None:
        """Send a message."""
        ...


class Ros2Link(Protocol):
    """A node of ROS 2. What is declared on it lives until `close`; the thread that hears may call nothing of it."""

    @property
    def node(self) -> NodeName:
        """Its own name."""
        ...

    def is_ours(self, entity: Entity) -> bool:
        """Return True if something in the graph is of this link itself."""
        ...

    def resolve(self, name: str) -> str:
        """Return the full name of a topic or service, which may be relative to the node's namespace."""
        ...

    def publisher(self, topic: str, kind: type[M], qos: Qos = USUAL) -> Sender[M]:
        """Return a publisher."""
        ...

    def subscribe(self, topic: str, kind: type[M], mailbox: RosMailbox[M], qos: Qos = USUAL) -> None:
        """Put messages of a topic into a mailbox.

        Messages of another type or hash are refused, and the mailbox says so. A latched subscription also gets what was
        sent before.
        """
        ...

    def call(self, name: str, service: Service[Q, A], request: Q, limit_s: float) -> RosMailbox[A]:
        """Ask a service without waiting, and return the mailbox of the response, if one comes in `limit_s`."""
        ...

    def serve(self, name: str, service: Service[Q, A], mailbox: RosMailbox[Asked[Q, A]]) -> None:
        """Offer a service."""
        ...

    def other_format(self, limit_s: float) -> str:
        """Return the format of nodes that this link cannot hear, and the remedy; empty where there are none; waits."""
        ...

    def graph(self, limit_s: float) -> list[Entity]:
        """Return the entities of the ROS graph now, as far as the format tells; waits."""
        ...

    def close(self) -> bool:
        """Close it; False when that takes too long."""
        ...
