"""The relay between DDS and Zenoh, by itself."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import count
from subprocess import PIPE

import pytest

from ros2.wire.formats import format_named
from ros2.wire.link import open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Twist, TwistStamped
from ros2.wire.names import NodeName
from ros2.wire.ports import Ros2Link
from ros2.wire.rclpy_link import RclpyLink, import_rclpy
from tests.ros.site import ROOT
from tests.routers import PATIENCE_S, free_endpoint, routed

pytestmark = [
    pytest.mark.ros,
    # Both are rclpy's own, as in test_rclpy_link.py.
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore:Deprecated in favor of:DeprecationWarning"),
]

RELAY = [sys.executable, str(ROOT / "deploy" / "ros" / "relay.py")]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--connect", "nowhere"], "--connect nowhere:"),
        (["--connect", free_endpoint(), "--wait", "0.1"], "is a Zenoh router running there?"),
        (["--connect", "tcp/127.0.0.1:1", "--topics", "("], "--topics (: no regular expression"),
        ([], "the following arguments are required: --connect"),
    ],
)
def test_what_it_refuses(words: list[str], says: str) -> None:
    done = subprocess.run([*RELAY, *words], capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr


def test_it_teaches() -> None:
    done = subprocess.run([*RELAY, "--help"], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    assert "zenoh-bridge-ros2dds" in done.stdout


@contextmanager
def relaying(where: str) -> Iterator[subprocess.Popen[str]]:
    """A relay that has begun."""
    with subprocess.Popen([*RELAY, "--connect", where], stdout=PIPE, stderr=PIPE, text=True) as relay:
        try:
            assert relay.stdout is not None
            assert relay.stdout.readline().startswith("relays to")
            yield relay
        finally:
            relay.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_leaves_when_it_is_told_to(number: signal.Signals) -> None:
    with routed() as where, relaying(where) as relay:
        relay.send_signal(number)
        _, errors = relay.communicate(timeout=PATIENCE_S)
    assert (relay.returncode, errors) == (130, "")


class Node:
    """A node that publishes on a topic and hears it; `stamps` of the messages that it has heard."""

    def __init__(self, link: Ros2Link) -> None:
        self.stamps: list[int] = []
        self._heard: RosMailbox[TwistStamped] = RosMailbox(1000)
        link.subscribe("/both", TwistStamped, self._heard)
        self._sender = link.publisher("/both", TwistStamped)

    def send_until_heard_by(self, other: Node, numbers: Iterator[int]) -> None:
        """Send messages, each with a stamp of its own, until the other node has heard one of them."""
        sent: set[int] = set()
        end_s = time.monotonic() + PATIENCE_S
        while sent.isdisjoint(other.stamps):
            assert time.monotonic() < end_s
            sent.add(number := next(numbers))
            self._sender.send(TwistStamped(number, "", Twist(0.0, 0.0, 0.0)))
            time.sleep(0.02)
            other.listen()

    def listen(self) -> None:
        """Note what has come."""
        while (received := self._heard.take()) is not None:
            self.stamps.append(received.message.stamp_ns)


def test_no_message_goes_round(domain: int) -> None:
    with (
        routed() as where,
        relaying(where),
        closing(open_ros2(where, format_named("bridge", domain, ""), NodeName("far", ""), PATIENCE_S)) as far_link,
        closing(RclpyLink(import_rclpy(), NodeName("near", ""), domain, print)) as near_link,
    ):
        far, near, numbers = Node(far_link), Node(near_link), count(1)
        for _ in range(3):  # after the first time both ways are open
            far.send_until_heard_by(near, numbers)
            near.send_until_heard_by(far, numbers)
            for node in (far, near):
                node.listen()
                assert len(set(node.stamps)) == len(node.stamps)
