"""The port of a link to a ROS 2 robot, whatever carries it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from patrol.ros2.mailbox import RosMailbox
from patrol.ros2.names import USUAL, Entity, NodeName, Qos

Q = TypeVar("Q")
A = TypeVar("A")
M = TypeVar("M")
M_contra = TypeVar("M_contra", contravariant=True)


@dataclass(frozen=True, slots=True)
class Service(Generic[Q, A]):
    """A kind of service.

    Attributes:
        type_name: Such as ``action_msgs/srv/CancelGoal``.
        request: The class of what is asked.
        response: The class of what is answered.
    """

    type_name: str
    request: type[Q]
    response: type[A]


@dataclass(frozen=True, slots=True)
class Asked(Generic[Q, A]):
    """A request that waits for its response.

    Attributes:
        request: What is asked.
        answer: Sends the response; once, from any thread but the one that hears.
    """

    request: Q
    answer: Callable[[A], None]


class Sender(Protocol[M_contra]):
    """Sends messages of a topic."""

    @property
    def sent(self) -> int:
        """The number of messages."""
        ...

    def send(self, message: M_contra) -> None:
        """Send a message.

        Args:
            message: Of the topic's class.

        Raises:
            Malformed: It holds what must not be sent.
        """
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

    @property
    def connected(self) -> bool:
        """True if the robot's router is at the other end now, or none is needed."""
        ...

    def resolve(self, name: str) -> str:
        """Return the full name of a topic or service, which may be relative to the node's namespace."""
        ...

    def publisher(self, topic: str, kind: type[M], qos: Qos = USUAL) -> Sender[M]:
        """Return a publisher.

        Args:
            topic: The topic's name.
            kind: The class of its messages.
            qos: Quality of service.
        """
        ...

    def subscribe(self, topic: str, kind: type[M], mailbox: RosMailbox[M], qos: Qos = USUAL) -> None:
        """Put messages of a topic into a mailbox.

        Args:
            topic: The topic's name.
            kind: The class of its messages; messages of another type or hash are refused, and the mailbox says so.
            mailbox: Where they wait.
            qos: Quality of service; one that is latched also gets what was sent before.
        """
        ...

    def call(self, name: str, service: Service[Q, A], request: Q, limit_s: float) -> RosMailbox[A]:
        """Ask a service, without waiting for the response.

        Args:
            name: The service's name.
            service: Its kind.
            request: What to ask.
            limit_s: How long a response may take.

        Returns:
            Where the response will be, if one comes.

        Raises:
            Malformed: The request holds what must not be sent.
        """
        ...

    def serve(self, name: str, service: Service[Q, A], mailbox: RosMailbox[Asked[Q, A]]) -> None:
        """Offer a service.

        Args:
            name: The service's name.
            service: Its kind.
            mailbox: Where requests wait.
        """
        ...

    def other_format(self, limit_s: float) -> str:
        """Return the format of nodes that this link cannot hear, and the remedy; empty where there are none; waits.

        Args:
            limit_s: How long to wait at most.
        """
        ...

    def graph(self, limit_s: float) -> list[Entity]:
        """Return the entities of the ROS graph now, as far as the format tells; waits.

        Args:
            limit_s: How long to wait at most.
        """
        ...

    def close(self) -> bool:
        """Close it; False when that takes too long."""
        ...
