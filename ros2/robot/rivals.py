"""Other drivers of the robot. Commands of two senders alternate unpredictably, so there must be only one.

ROS lets every node command. The graph shows which do, where the format has one; a bridge shows what it carries.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from threading import Event, Thread

from patrol.printable import printable
from ros2.wire.names import Entity, EntityKind, full_name
from ros2.wire.ports import Ros2Link

LOOK_S = 1.0
"""Time between two looks at the graph, s."""
GRAPH_S = 2.0
"""Longest time of a look, s."""
GONE_S = 4.0
"""Time to wait, at the start, for another driver to go: a router forgets one that was cut off after 2 s."""
_AGAIN_S = 0.2
_LONGEST = 100
_MOST = 4


def rivals(entities: Sequence[Entity], topic: str | None, is_ours: Callable[[Entity], bool], node: str) -> list[str]:
    """Describe the other drivers of the robot.

    `topic` is the full name of the topic of its commands; None where it gets goals, which Nav2 itself turns into
    commands. `node` is the full name of our own node, which no other may have.
    """
    found = set()
    for one in entities:
        if is_ours(one):
            continue
        name = full_name(one.node.namespace, one.node.name)
        if one.kind is EntityKind.NODE and name == node:
            found.add(f"another agent, {node}")
        elif one.kind is EntityKind.PUBLISHER and one.topic == topic and name != node:
            found.add(f"{printable(name[:_LONGEST]) if one.node.name else 'somebody'} on {topic}")
    return sorted(found)[:_MOST]


class Rivals:
    """Looks for other drivers of the robot (`ros2.robot.driver.Objection`).

    `topic` is the full name of the topic of its commands; None where it gets goals, or where others may command too.
    """

    def __init__(self, link: Ros2Link, topic: str | None) -> None:
        self._link = link
        self._topic = topic
        self._node = link.resolve(link.node.name)
        self._found: list[str] = []
        self._over = Event()
        self._thread = Thread(target=self._watch, name="rivals", daemon=True)

    @property
    def why(self) -> str:
        """The other drivers of the robot; empty if there are none."""
        return f"also driven by {', '.join(self._found)} (end all but one)" if self._found else ""

    def release(self) -> None:
        """Keep all drivers: an operator's word ends none."""

    def are_there(self, wait_s: float = GONE_S, stopped: Callable[[], bool] = lambda: False) -> list[str]:
        """Return the other drivers that are still there after up to `wait_s`, or once `stopped` returns True."""
        end_s = time.monotonic() + wait_s
        while self._look() and time.monotonic() < end_s and not stopped():
            self._over.wait(_AGAIN_S)
        return self._found

    def watch(self) -> Rivals:
        """Look again and again, on a thread of its own, until `close`; itself."""
        self._thread.start()
        return self

    def close(self) -> None:
        """Look no more."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(LOOK_S):
            self._look()

    def _look(self) -> list[str]:
        self._found = rivals(self._link.graph(GRAPH_S), self._topic, self._link.is_ours, self._node)
        return self._found
