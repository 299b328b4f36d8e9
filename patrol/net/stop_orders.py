"""What an operator asks of robots that no world carries: to stop, and to be released.

The robots answer themselves. Only operators may ask at a fleet's router (`patrol.net.roles`); at one that asks nobody
who they are, everybody may. An order says nothing but its word, so whoever repeats an old one can at most release a
robot that the same operator has stopped; members' secrets keep strangers from that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING

from patrol.net.mailbox import Mailbox, Question
from patrol.printable import printable

if TYPE_CHECKING:
    from patrol.net.keys import FleetKeys
    from patrol.net.link import Link

LONGEST = 16
"""Bytes of the longest order."""
LONGEST_ANSWER = 256
_ROOM = 16


class Order(StrEnum):
    """What a robot is asked."""

    STOP = "stop"
    RELEASE = "release"


def ask_robots(link: Link, keys: FleetKeys, robot: str, order: Order, wait_s: float) -> Iterator[str]:
    """Ask robots.

    Args:
        link: To the fleet's router.
        keys: Of the fleet.
        robot: Whom to ask, or ``*`` for all.
        order: What to ask.
        wait_s: How long to wait for answers, s.

    Yields:
        What each robot answers, in one line.
    """
    for answer in link.answers(keys.stop(robot), order.encode(), LONGEST_ANSWER, wait_s):
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
        """Carry out the orders that wait, and answer them.

        Args:
            carry_out: Does what an order says; returns what to answer.
        """
        while (asked := self._waiting.get()) is not None:
            question = asked[1]
            try:
                order = Order(question.payload.decode("ascii", "replace"))
            except ValueError:
                continue
            question.answer(f"{self._robot}: {carry_out(order)}".encode()[:LONGEST_ANSWER])


def _no_question(payload: bytes) -> Question:
    raise ValueError(f"{len(payload)} bytes are no question")  # questions come ready made
