"""The link of a node of ROS with a stand-in for rclpy: messages that come twice, late, or with little said of them."""

import sys
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from ros2.wire.codec import encode
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Bool
from ros2.wire.names import LATCHED, NodeName
from ros2.wire.rclpy_link import RclpyLink
from tests.routers import PATIENCE_S

PAYLOAD = encode(Bool(True))


def said_of(sequence: int, sender: int = 1) -> dict[str, Any]:
    """Return what rclpy says of a message."""
    named = {"publication_sequence_number": sequence, "publisher_gid": {"data": [sender] * 16}}
    return {"source_timestamp": 1_700_000_000_000_000_000 + sequence, **named}


@pytest.fixture
def mailbox() -> RosMailbox[Bool]:
    return RosMailbox(1000)


@pytest.fixture
def subscriptions(mailbox: RosMailbox[Bool], monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """The callbacks of a topic's subscriptions."""
    monkeypatch.setitem(sys.modules, "std_msgs.msg", SimpleNamespace(Bool=object))
    rclpy = MagicMock()
    rclpy.executors.ExternalShutdownException = TimeoutError
    link = RclpyLink(rclpy, NodeName("fogwatch", "robot1"), 0, print)
    link.subscribe("stop", Bool, mailbox, LATCHED)
    yield [call.args[2] for call in rclpy.create_node.return_value.create_subscription.call_args_list]
    assert link.close(PATIENCE_S)


def taken(mailbox: RosMailbox[Bool]) -> list[tuple[bytes, int | None]]:
    """Return the sender's first byte and the sequence of each message that has come."""
    found = []
    while (received := mailbox.take()) is not None:
        found.append((received.sender[:1], received.sequence))
    return found


def test_what_comes_late_is_heard_once(subscriptions: list[Any], mailbox: RosMailbox[Bool]) -> None:
    latched, plain = subscriptions
    plain(PAYLOAD, said_of(7))
    for sequence in (5, 6, 7):  # history, or what was sent again
        latched(PAYLOAD, said_of(sequence))
    latched(PAYLOAD, said_of(7, sender=2))
    assert taken(mailbox) == [(b"\1", 7), (b"\1", 5), (b"\1", 6), (b"\2", 7)]


@pytest.mark.parametrize("sequence", [{}, {"publication_sequence_number": None}, {"publication_sequence_number": 7}])
@pytest.mark.parametrize("gid", [{}, {"publisher_gid": None}, {"publisher_gid": {"data": [1] * 16}}])
def test_what_rclpy_or_the_middleware_does_not_say_makes_no_message_come_twice(
    sequence: dict[str, Any], gid: dict[str, Any], subscriptions: list[Any], mailbox: RosMailbox[Bool]
) -> None:
    for sent_ns in (1, 2):
        for subscription in subscriptions:
            subscription(PAYLOAD, {"source_timestamp": sent_ns, **sequence, **gid})
    sender = bytes(gid["publisher_gid"]["data"]) if gid.get("publisher_gid") else b""
    counted = sequence.get("publication_sequence_number") if sender else None  # another sender counts as well
    assert taken(mailbox) == 2 * [(sender[:1], counted)]


def test_a_link_that_can_hear_no_more_says_so_and_raises_the_error_when_it_is_closed() -> None:
    rclpy = MagicMock()
    said: list[str] = []
    rclpy.executors.ExternalShutdownException = TimeoutError
    rclpy.executors.SingleThreadedExecutor.return_value.spin_once.side_effect = KeyError("publisher_gid")
    link = RclpyLink(rclpy, NodeName("fogwatch", "robot1"), 0, said.append)
    with pytest.raises(KeyError):
        link.close(PATIENCE_S)
    assert said == ["it hears ROS no more: KeyError: 'publisher_gid'"]
