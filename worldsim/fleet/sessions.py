"""The robots' processes as the world sees them: who has taken which robot's place, who has left it, what they say.

A place is taken by answering the world's hello; from then on only that process, told by its incarnation and instance,
speaks for the robot. A robot's liveliness token goes when its process or its link dies. It also goes, with all others,
when the router does; so an absence counts only while the router answers, and after an outage only once clients have had
time to find back.

Pure but for the mailbox: time is what `now` says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from patrol.errors import BadInput
from patrol.net.keys import FleetKeys
from patrol.net.phases import (
    ANYONE,
    NO_RUN,
    PROTOCOL,
    Hello,
    HelloReply,
    ReplyA,
    ReplyB,
    Stop,
    ToRobot,
    ToWorld,
    encode,
)
from worldsim.mailbox import Mailbox

POLL_S = 0.1
HELLO_S = 1.0
GRACE_S = 0.3
"""How long a token must have been gone, the router answering, before its robot counts as gone."""
RECOVERY_S = 5.0
"""How long clients may take to find back to a router that has returned."""
DISMISSAL_S = 2.0


class Interrupted(Exception):
    """The world was asked to leave while it waited."""


class Missing(Exception):
    """Robots that nobody came for in time; one line names them."""


class CountingMailbox(Mailbox[Any], Protocol):
    """A mailbox that counts what it dropped.

    Attributes:
        refused: Messages that were dropped, by reason.
    """

    refused: Counter[str]


@dataclass(frozen=True, slots=True)
class Wire:
    """What connects the world with its robots: their names and posts by number, and the mailbox they answer into.

    connected: whether the router answers now. now: seconds of a clock that never goes back. ending: whether the world
    should leave.
    """

    keys: FleetKeys
    names: Mapping[int, str]
    posts: Mapping[int, Callable[[bytes], None]]
    mailbox: CountingMailbox
    connected: Callable[[], bool]
    now: Callable[[], float]
    ending: Callable[[], bool]


@dataclass(frozen=True, slots=True)
class _Seat:
    incarnation: int
    instance: int


class Seats:
    """Who speaks for which robot.

    run: a random number of this world. scenario: its hash. absent: robots that nobody is awaited for yet.
    """

    def __init__(self, wire: Wire, run: int, scenario: str, absent: Collection[int] = ()) -> None:
        self._wire = wire
        self._run = run
        self._scenario = scenario
        self._number_of = {wire.keys.reply(name): number for number, name in wire.names.items()}
        self._number_of |= {wire.keys.alive(name): number for number, name in wire.names.items()}
        self._seats: dict[int, _Seat] = {}
        self._awaited: dict[int, int | None] = {number: None for number in wire.names if number not in absent}
        self._present: set[int] = set()
        self._absent_since: dict[int, float] = {}
        self._dismissed: dict[int, str] = {}
        self._trusted_from = wire.now()
        self._k = 0

    @property
    def now(self) -> float:
        """The time, s."""
        return self._wire.now()

    @property
    def refused(self) -> Counter[str]:
        """Messages from robots that were dropped, by reason."""
        return self._wire.mailbox.refused

    def gather(self, wait_s: float, waiting: Callable[[list[str], float], None]) -> None:
        """Greet the robots until somebody has come for each.

        waiting: called about every five seconds with the names still missing and the seconds waited. Raises Missing
        after wait_s, BadInput when a robot's scenario or protocol is another than ours, Interrupted.
        """
        began = told = self.now
        greeted = -HELLO_S
        while missing := [number for number in self._awaited if number not in self._seats]:
            now = self.now
            if now >= greeted + HELLO_S:
                greeted = now
                for number in missing:
                    self._greet(number)
            names = [self._wire.names[number] for number in missing]
            if now - began >= wait_s:
                raise Missing(f"nobody came for {', '.join(names[:8])} within {wait_s:g} s")
            if now - told >= 5.0:
                told = now
                waiting(names, now - began)
            self.take(POLL_S)

    def send(self, number: int, make: Callable[[int, int], ToRobot]) -> bytes:
        """Send a robot what `make` builds from its incarnation and instance; returns the bytes, for `repeat`."""
        seat = self._seats[number]
        message = make(seat.incarnation, seat.instance)
        self._k = max(self._k, message.k)
        payload = encode(message)
        self._wire.posts[number](payload)
        return payload

    def repeat(self, number: int, payload: bytes) -> None:
        """Send the same once more."""
        self._wire.posts[number](payload)

    def take(self, timeout_s: float) -> tuple[int, ReplyA | ReplyB] | None:
        """The next answer of a robot that speaks for itself; None when none came in time.

        Everything else that arrives is dealt with here. Raises Interrupted when the world should leave.
        """
        if self._wire.ending():
            raise Interrupted
        arrived = self._wire.mailbox.get(timeout_s)
        if arrived is None:
            return None
        number = self._number_of.get(arrived[0])
        message = arrived[1]
        if number is None:  # the world's own token
            return None
        if isinstance(message, ReplyA | ReplyB):
            if self._is_seated(number, message):
                return number, message
            self._wire.mailbox.refused["stranger"] += 1
        elif isinstance(message, HelloReply):
            self._seat(number, message)
        else:
            self._note_presence(number, present=message.present)
        return None

    def gone(self, numbers: Iterable[int]) -> list[int]:
        """Those of the numbers whose process is gone."""
        now = self.now
        absent = [number for number in numbers if number in self._absent_since]
        if not absent:
            return []
        if not self._wire.connected():
            self._trusted_from = now + RECOVERY_S
        if now < self._trusted_from:
            return []
        return [number for number in absent if now >= self._absent_since[number] + GRACE_S]

    def dismiss(self, number: int, reason: str, *, orderly: bool) -> None:
        """Tell a robot to leave; one that asks later is told again."""
        self._dismissed[number] = reason
        if number in self._seats:
            self.send(number, lambda incarnation, instance: Stop(incarnation, instance, self._k, orderly, reason))

    def vacate(self, number: int) -> None:
        """A robot's process is gone for good, and nobody is awaited in its place."""
        self._seats.pop(number, None)
        self._awaited.pop(number, None)
        self._dismissed.pop(number, None)

    def expect(self, number: int, incarnation: int) -> None:
        """Await a robot's new process, of that incarnation and no other."""
        self.vacate(number)
        self._awaited[number] = incarnation
        self._absent_since.pop(number, None)

    def seated(self, number: int) -> bool:
        """Whether somebody speaks for the robot."""
        return number in self._seats

    def welcome(self, number: int) -> None:
        """Wait up to `HELLO_S` for somebody to come for the robot, having greeted whoever is there."""
        self._greet(number)
        until = self.now + HELLO_S
        while not self.seated(number) and self.now < until:
            self.take(POLL_S)

    def bear_with(self, number: int) -> None:
        """A robot's process was stopped, by intent, and may need time until its token shows again."""
        if number in self._absent_since:
            self._absent_since[number] = self.now + RECOVERY_S

    def close(self, k: int, reason: str) -> None:
        """Send everybody home and wait, not for long, until they are gone."""
        self._k = k
        staying = [number for number in self._seats if number not in self._dismissed]
        until = self.now + (DISMISSAL_S / 4 if self._wire.ending() else DISMISSAL_S)
        told = -HELLO_S
        while (left := [number for number in staying if number in self._present]) and self.now < until:
            if self.now >= told + HELLO_S / 2:
                told = self.now
                for number in left:
                    self.dismiss(number, reason, orderly=True)
            arrived = self._wire.mailbox.get(POLL_S)
            if arrived is not None and arrived[0] in self._number_of and hasattr(arrived[1], "present"):
                self._note_presence(self._number_of[arrived[0]], present=arrived[1].present)

    # --- what arrives ------------------------------------------------------------------------------------------------

    def _greet(self, number: int) -> None:
        if number in self._present and number in self._awaited:
            self._wire.posts[number](encode(Hello(0, ANYONE, self._k, self._run)))

    def _note_presence(self, number: int, *, present: bool) -> None:
        if present:
            self._present.add(number)
            self._absent_since.pop(number, None)
            if number not in self._seats:
                self._greet(number)
        else:
            self._present.discard(number)
            self._absent_since.setdefault(number, self.now)

    def _is_seated(self, number: int, message: ToWorld) -> bool:
        seat = self._seats.get(number)
        return seat == _Seat(message.incarnation, message.instance) and number not in self._dismissed

    def _seat(self, number: int, message: HelloReply) -> None:
        """Somebody answers a hello, asks for one, or asks whether it still belongs to the run."""
        name = self._wire.names[number]
        seat = self._seats.get(number)
        if message.run not in (self._run, NO_RUN):
            self._wire.mailbox.refused["stranger"] += 1
        elif seat is None and message.run == NO_RUN:
            self._note_presence(number, present=True)
        elif seat is None and not self._is_awaited(number, message.incarnation):
            self._turn_away(number, message, f"nobody is awaited for {name} now")
        elif seat is None:
            self._check(name, message)
            self._seats[number] = _Seat(message.incarnation, message.instance)
        elif seat.instance != message.instance:
            self._turn_away(number, message, f"another process is {name} already")
        elif number in self._dismissed:
            self._turn_away(number, message, self._dismissed[number])

    def _is_awaited(self, number: int, incarnation: int) -> bool:
        return number in self._awaited and self._awaited[number] in (None, incarnation)

    def _check(self, name: str, message: HelloReply) -> None:
        if message.protocol != PROTOCOL:
            raise BadInput(
                f"{name} speaks protocol {message.protocol}, this world {PROTOCOL}; run the same version on all hosts"
            )
        if message.scenario != self._scenario:
            raise BadInput(
                f"{name} was started with another scenario (hash {message.scenario[:12]}, the world's is "
                f"{self._scenario[:12]}); give all processes the same file"
            )

    def _turn_away(self, number: int, message: HelloReply, reason: str) -> None:
        stop = Stop(message.incarnation, message.instance, self._k, orderly=False, reason=reason)
        self._wire.posts[number](encode(stop))
