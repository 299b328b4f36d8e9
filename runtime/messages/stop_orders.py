"""An operator's orders to robots that no world carries: to stop, and to be released.

The robots answer themselves. Only operators may ask at a fleet's router (`runtime.security.roles`); at one that asks
for no credentials, every process may. An order is one word, so repeating an old one can at most release a robot that
the same operator has stopped; members' secrets keep strangers from that.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from patrol.errors import printable
from runtime.net.mailbox import Mailbox, Question
from runtime.security.keys import WORLD, robot_of

if TYPE_CHECKING:
    from runtime.net.link import Link
    from runtime.security.keys import FleetKeys

LONGEST = 16
"""Bytes of the longest order."""
LONGEST_ANSWER = 256
"""Bytes of the longest answer."""
_ROOM = 16
_WAIT_S = 3600.0
_MOST = 1000
_DONE, _NOT_DONE = "done", "undone"


class Order(StrEnum):
    """An order to a robot."""

    STOP = "stop"
    RELEASE = "release"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of an order."""

    done: bool  # as far as the robot can tell: after an order to stop, it stands
    text: str  # one line

    def to_bytes(self) -> bytes:
        """Pack the outcome as an answer.

        For example, ``Outcome(True, "stands")`` becomes ``b"done stands"``.
        """
        return f"{_DONE if self.done else _NOT_DONE} {self.text}".encode()[:LONGEST_ANSWER]


def outcome_of(answer: bytes) -> Outcome:
    """Read the outcome in an answer of unknown origin; any other text counts as not done.

    For example, ``b"done stands"`` reads as done, and ``b"donestands"`` does not.
    """
    word, _, text = answer.decode("utf-8", "replace").partition(" ")
    return Outcome(word == _DONE, printable(text))


def robots_there(link: Link, keys: FleetKeys) -> list[str]:
    """List the robots that are connected to the fleet, or were until a moment ago, sorted by name."""
    return sorted({robot_of(key) for key in link.seen(keys.alive("*"), _MOST)} - {WORLD, ""})


def robots_to_ask(link: Link, keys: FleetKeys) -> list[str]:
    """List the robots that an order for all is for: those that are there, and all members of a mesh, reached or not."""
    return sorted({*robots_there(link, keys), *(() if link.mesh is None else link.mesh.robots)})


def ask_robots(
    link: Link, keys: FleetKeys, robots: Sequence[str], order: Order, wait_s: float
) -> Iterator[tuple[str, Outcome]]:
    """Ask robots, all at once, and yield each one's name and outcome as it answers.

    None is asked later because another one does not answer. Each is asked by its name: a router with rules hands a
    robot no question that is for others as well. Where none answers, because it is not connected yet or has just come
    back, it is asked again until the time is up.
    """
    names = {keys.stop(name): name for name in robots}
    for key, answer in link.answers_until(tuple(names), order.encode(), LONGEST_ANSWER, wait_s):
        yield names[key], outcome_of(answer)


class StopOrders:
    """The orders to one robot."""

    def __init__(self, link: Link, keys: FleetKeys, robot: str) -> None:
        key = keys.stop(robot)
        self._waiting: Mailbox[Question] = Mailbox([key], _no_question, LONGEST, _ROOM)
        link.attend(key, LONGEST, self._waiting)

    def obey(self, carry_out: Callable[[Order], Outcome]) -> None:
        """Carry out orders from now on, on a thread of its own: an answer may have to wait for the router."""
        threading.Thread(target=self._obey_orders, args=(carry_out,), name="orders", daemon=True).start()

    def _obey_orders(self, carry_out: Callable[[Order], Outcome]) -> None:
        while True:
            if (message := self._waiting.get(_WAIT_S)) is None:
                continue
            question = message[1]
            try:
                order = Order(question.payload.decode("ascii", "replace"))
            # An order that this version does not know: no answer, so that the operator is told that none came.
            except ValueError:
                continue
            question.answer(carry_out(order).to_bytes())


def _no_question(payload: bytes) -> Question:
    raise ValueError(f"{len(payload)} bytes are no question")  # questions come ready made
