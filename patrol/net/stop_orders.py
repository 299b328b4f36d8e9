"""What an operator asks of robots that no world carries: to stop, and to be released.

The robots answer themselves. Only operators may ask at a fleet's router (`patrol.net.roles`); at one that asks nobody
who they are, everybody may. An order says nothing but its word, so whoever repeats an old one can at most release a
robot that the same operator has stopped; members' secrets keep strangers from that.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING

from patrol.net.keys import WORLD, robot_of
from patrol.net.mailbox import Mailbox, Question
from patrol.printable import printable

if TYPE_CHECKING:
    from patrol.net.keys import FleetKeys
    from patrol.net.link import Link

LONGEST = 16
"""Bytes of the longest order."""
LONGEST_ANSWER = 256
_ROOM = 16
_WAIT_S = 3600.0
_MOST = 1000


class Order(StrEnum):
    """What a robot is asked."""

    STOP = "stop"
    RELEASE = "release"


def ask_robots(link: Link, keys: FleetKeys, robot: str | None, order: Order, wait_s: float) -> Iterator[str]:
    """Ask robots.

    Each is asked by its name: a router with rules hands a robot no question that is for others as well.

    Args:
        link: To the fleet's router.
        keys: Of the fleet.
        robot: Whom to ask; None for all robots that are there.
        order: What to ask.
        wait_s: How long to wait for the answers of a robot, s.

    Yields:
        What each robot answers, in one line.
    """
    if robot is None:
        names = sorted({robot_of(key) for key in link.seen(keys.alive("*"), _MOST)} - {WORLD, ""})
    else:
        names = [robot]
    for name in names:
        for answer in link.answers(keys.stop(name), order.encode(), LONGEST_ANSWER, wait_s):
            yield printable(answer.decode("utf-8", "replace"))


class StopOrders:
    """The orders to one robot.

    Args:
        link: To the fleet's router.
        keys: Of the fleet.
        robot: The robot.
    """

    def __init__(self, link: Link, keys: FleetKeys, robot: str) -> None:
        key = keys.stop(robot)
        self._robot = robot
        self._waiting: Mailbox[Question] = Mailbox([key], _no_question, LONGEST, _ROOM)
        link.attend(key, LONGEST, self._waiting)

    def obey(self, carry_out: Callable[[Order], str]) -> None:
        """Carry out orders from now on, on a thread of its own: an answer may have to wait for the router.

        Args:
            carry_out: Does what an order says; returns what to answer.
        """
        threading.Thread(target=self._obey, args=(carry_out,), name="orders", daemon=True).start()

    def _obey(self, carry_out: Callable[[Order], str]) -> None:
        while True:
            if (asked := self._waiting.get(_WAIT_S)) is None:
                continue
            question = asked[1]
            try:
                order = Order(question.payload.decode("ascii", "replace"))
            except ValueError:
                continue
            question.answer(f"{self._robot}: {carry_out(order)}".encode()[:LONGEST_ANSWER])


def _no_question(payload: bytes) -> Question:
    raise ValueError(f"{len(payload)} bytes are no question")  # questions come ready made
