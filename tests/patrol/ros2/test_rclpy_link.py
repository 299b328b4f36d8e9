"""The link of a node of ROS with a stand-in for rclpy: messages that come twice, late, or with little said of them."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from patrol.ros2.codec import encode
from patrol.ros2.mailbox import RosMailbox
from patrol.ros2.messages import Bool
from patrol.ros2.names import LATCHED, NodeName
from patrol.ros2.rclpy_link import RclpyLink

PAYLOAD = encode(Bool(True))


def said_of(sequence: int, sender: int = 1) -> dict[str, Any]:
    """Return what rclpy says of a message."""
    return {
        "source_timestamp": 1_700_000_000_000_000_000 + sequence,
        "publication_sequence_number": sequence,
        "publisher_gid": {"data": [sender] * 16},
    }


@pytest.fixture
def mailbox() -> RosMailbox[Bool]:
    return RosMailbox(1000)


@pytest.fixture
def subscriptions(mailbox: RosMailbox[Bool], monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The callbacks of a topic's subscriptions."""
    monkeypatch.setitem(sys.modules, "std_msgs.msg", SimpleNamespace(Bool=object))
    rclpy = MagicMock()
    RclpyLink(rclpy, NodeName("fogwatch", "robot1"), 0).subscribe("stop", Bool, mailbox, LATCHED)
    return [call.args[2] for call in rclpy.create_node.return_value.create_subscription.call_args_list]


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
