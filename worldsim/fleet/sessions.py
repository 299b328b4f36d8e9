"""The world's sessions with the robots' processes: which process speaks for which robot, and which are gone.

A process opens a session by answering the world's hello. From then on only that process, identified by its incarnation
and instance, speaks for the robot. A robot's liveliness token goes when its process or its link dies. It also goes,
with all others, when the router does; so an absence counts only while the router answers, and after an outage only once
clients have had time to reconnect.

Time is what `now` says, and messages come from a mailbox, so that all of this can be tested without a network.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol

from patrol.errors import BadInput
from patrol.net.keys import FleetKeys
from patrol.net.phases import (
    ANYONE,
    NO_RUN,
    PROTOCOL,
    UNLIKE,
    Failed,
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
"""How long clients may take to reconnect to a router that has returned."""
DISMISSAL_S = 2.0


class Interrupted(Exception):
    """The world was asked to end while it waited."""


class Missing(Exception):
    """Robots whose processes did not come in time; one line names them."""


class CountingMailbox(Mailbox[Any], Protocol):
    """A mailbox that counts what it dropped.

    Attributes:
        refused: Messages that were dropped, by reason.
    """

    refused: Counter[str]


@dataclass(frozen=True, slots=True)
class FleetConnection:
    """What connects the world with its robots.

    Attributes:
        keys: The fleet's keys.
        names: The robots' names by number.
        posts: What sends to each robot, by number.
        mailbox: Where their answers arrive.
        connected: Whether the router answers now.
        now: Seconds of a clock that never goes back.
        ending: Whether the world should end.
    """

    keys: FleetKeys
    names: Mapping[int, str]
    posts: Mapping[int, Callable[[bytes], None]]
    mailbox: CountingMailbox
    connected: Callable[[], bool]
    now: Callable[[], float]
    ending: Callable[[], bool]


@dataclass(frozen=True, slots=True)
class _Session:
    incarnation: int
    instance: int


class Sessions:
    """The processes that speak for the robots."""

    def __init__(self, connection: FleetConnection, run: int, scenario: str, absent: Collection[int] = ()) -> None:
        """Expect a process for each robot.

        Args:
            connection: What connects the world with the robots.
            run: A random number of this world.
            scenario: The scenario's hash.
            absent: Numbers of robots for which no process is expected yet.
        """
        self._connection = connection
        self._run = run
        self._scenario = scenario
        self._number_of = {connection.keys.reply(name): number for number, name in connection.names.items()}
        self._number_of |= {connection.keys.alive(name): number for number, name in connection.names.items()}
        self._sessions: dict[int, _Session] = {}
        self._expected: dict[int, int | None] = {number: None for number in connection.names if number not in absent}
        self._present: set[int] = set()
        self._absent_since: dict[int, float] = {}
        self._dismissed: dict[int, str] = {}
        self._failed: dict[int, str] = {}
        self._trusted_from = connection.now()
        self._k = 0

    @property
    def now(self) -> float:
        """The time, s."""
        return self._connection.now()

    @property
    def refused(self) -> Counter[str]:
        """Counts of messages from robots that were dropped, by reason."""
        return self._connection.mailbox.refused

    def gather(self, wait_s: float, waiting: Callable[[list[str], float], None]) -> None:
        """Greet the robots until each has a session.

        Args:
            wait_s: How long to wait, s.
            waiting: Called about every five seconds with the names still missing and the seconds waited.

        Raises:
            Missing: Processes did not come in time.
            BadInput: A robot has another scenario or protocol.
            Interrupted: The world should end.
        """
        began = reported = self.now
        greeted = -HELLO_S
        while missing := [number for number in self._expected if number not in self._sessions]:
            now = self.now
            if now >= greeted + HELLO_S:
                greeted = now
                for number in missing:
                    self._greet(number)
            names = [self._connection.names[number] for number in missing]
            if now - began >= wait_s:
                raise Missing(f"no process came for {', '.join(names[:8])} within {wait_s:g} s")
            if now - reported >= 5.0:
                reported = now
                waiting(names, now - began)
            self.take(POLL_S)

    def send(self, number: int, make: Callable[[int, int], ToRobot]) -> bytes:
        """Send a message to a robot that has a session.

        Args:
            number: The robot's number.
            make: Builds the message from the incarnation and instance of its process.

        Returns:
            The bytes sent, for `repeat`.
        """
        session = self._sessions[number]
        message = make(session.incarnation, session.instance)
        self._k = max(self._k, message.k)
        payload = encode(message)
        self._connection.posts[number](payload)
        return payload

    def repeat(self, number: int, payload: bytes) -> None:
        """Send the same bytes once more."""
        self._connection.posts[number](payload)

    def take(self, timeout_s: float) -> tuple[int, ReplyA | ReplyB] | None:
        """Take the next answer of a process that has a session; deal with everything else that arrives.

        Args:
            timeout_s: How long to wait for a message, s.

        Returns:
            The robot's number and the answer, or None when none came in time.

        Raises:
            Interrupted: The world should end.
        """
        if self._connection.ending():
            raise Interrupted
        arrived = self._connection.mailbox.get(timeout_s)
        if arrived is None:
            return None
        number = self._number_of.get(arrived[0])
        message = arrived[1]
        if number is None:  # the world's own token
            return None
        if isinstance(message, ReplyA | ReplyB):
            if self._has_session(number, message):
                return number, message
            self._connection.mailbox.refused["stranger"] += 1
        elif isinstance(message, Failed):
            if self._has_session(number, message):
                self._failed[number] = message.reason
            else:
                self._connection.mailbox.refused["stranger"] += 1
        elif isinstance(message, HelloReply):
            self._answer_hello(number, message)
        else:
            self._note_presence(number, present=message.present)
        return None

    def gone(self, numbers: Iterable[int]) -> list[int]:
        """Those of the robots whose process is gone."""
        now = self.now
        absent = [number for number in numbers if number in self._absent_since]
        if not absent:
            return []
        if not self._connection.connected():
            self._trusted_from = now + RECOVERY_S
        if now < self._trusted_from:
            return []
        return [number for number in absent if now >= self._absent_since[number] + GRACE_S]

    def failed(self, numbers: Iterable[int]) -> dict[int, str]:
        """Those of the numbers whose mind cannot go on, and why."""
        return {number: self._failed[number] for number in numbers if number in self._failed}

    def dismiss(self, number: int, reason: str, *, orderly: bool) -> None:
        """Tell a robot's process to leave; one that asks later is told again.

        Args:
            number: The robot's number.
            reason: For the process to report.
            orderly: Whether it leaves as planned, with exit code 0.
        """
        self._dismissed[number] = reason
        if number in self._sessions:
            self.send(number, lambda incarnation, instance: Stop(incarnation, instance, self._k, orderly, reason))

    def end(self, number: int) -> None:
        """Forget a robot's process, which is gone for good, and expect no other."""
        self._sessions.pop(number, None)
        self._expected.pop(number, None)
        self._dismissed.pop(number, None)
        self._failed.pop(number, None)

    def expect(self, number: int, incarnation: int) -> None:
        """Expect a robot's new process, of that incarnation and no other."""
        self.end(number)
        self._expected[number] = incarnation
        self._absent_since.pop(number, None)

    def is_open(self, number: int) -> bool:
        """Whether a process speaks for the robot."""
        return number in self._sessions

    def await_session(self, number: int) -> None:
        """Greet a robot's process, if it is there, and wait up to `HELLO_S` for its session."""
        self._greet(number)
        until = self.now + HELLO_S
        while not self.is_open(number) and self.now < until:
            self.take(POLL_S)

    def allow_recovery(self, number: int) -> None:
        """Allow a robot's process, which was paused on purpose, `RECOVERY_S` until its token must show again."""
        if number in self._absent_since:
            self._absent_since[number] = self.now + RECOVERY_S

    def close(self, k: int, reason: str) -> None:
        """Dismiss all robots and wait up to `DISMISSAL_S` until they are gone.

        Args:
            k: The tick that would be next.
            reason: For the processes to report.
        """
        self._k = k
        staying = [number for number in self._sessions if number not in self._dismissed]
        until = self.now + (DISMISSAL_S / 4 if self._connection.ending() else DISMISSAL_S)
        sent = -HELLO_S
        while (left := [number for number in staying if number in self._present]) and self.now < until:
            if self.now >= sent + HELLO_S / 2:
                sent = self.now
                for number in left:
                    self.dismiss(number, reason, orderly=True)
            arrived = self._connection.mailbox.get(POLL_S)
            if arrived is not None and arrived[0] in self._number_of and hasattr(arrived[1], "present"):
                self._note_presence(self._number_of[arrived[0]], present=arrived[1].present)

    # --- what arrives ------------------------------------------------------------------------------------------------

    def _greet(self, number: int) -> None:
        if number in self._present and number in self._expected:
            self._connection.posts[number](encode(Hello(0, ANYONE, self._k, self._run)))

    def _note_presence(self, number: int, *, present: bool) -> None:
        if present:
            self._present.add(number)
            self._absent_since.pop(number, None)
            if number not in self._sessions:
                self._greet(number)
        else:
            self._present.discard(number)
            self._absent_since.setdefault(number, self.now)

    def _has_session(self, number: int, message: ToWorld) -> bool:
        session = self._sessions.get(number)
        return session == _Session(message.incarnation, message.instance) and number not in self._dismissed

    def _answer_hello(self, number: int, message: HelloReply) -> None:
        """Deal with a process that answers a hello, asks for one, or asks whether it still belongs to the run."""
        name = self._connection.names[number]
        session = self._sessions.get(number)
        if message.run not in (self._run, NO_RUN):
            self._connection.mailbox.refused["stranger"] += 1
        elif session is None and message.run == NO_RUN:
            self._note_presence(number, present=True)
        elif session is None and not self._is_expected(number, message.incarnation):
            self._turn_away(number, message, f"no process is expected for {name} now")
        elif session is None:
            if unlike := self._unlike(message):
                self._call_off(number, message, unlike)
            self._sessions[number] = _Session(message.incarnation, message.instance)
        elif session.instance != message.instance:
            self._turn_away(number, message, f"another process is {name} already")
        elif number in self._dismissed:
            self._turn_away(number, message, self._dismissed[number])

    def _is_expected(self, number: int, incarnation: int) -> bool:
        return number in self._expected and self._expected[number] in (None, incarnation)

    def _unlike(self, message: HelloReply) -> str:
        """What of a process is not as in this world, and the remedy; empty when all is."""
        if message.protocol != PROTOCOL:
            versions = f"{message.protocol}, the world's is {PROTOCOL}"
            return f"protocol ({versions}); run the same version of fogwatch on all hosts"
        if message.scenario != self._scenario:
            hashes = f"hash {message.scenario[:12]}, the world's is {self._scenario[:12]}"
            return f"scenario ({hashes}); give all processes the same file"
        return ""

    def _call_off(self, number: int, message: HelloReply, unlike: str) -> NoReturn:
        """Turn a process away, tell the others that the run cannot begin, and raise BadInput."""
        why = f"{self._connection.names[number]} was started with another {unlike}"
        self._turn_away(number, message, f"{UNLIKE}{unlike}")
        for other in self._sessions:
            self.dismiss(other, f"the run cannot begin: {why}", orderly=False)
        self._await_absence([number, *self._sessions])
        raise BadInput(why)

    def _await_absence(self, numbers: Sequence[int]) -> None:
        """Wait up to `DISMISSAL_S` until processes are gone: the link must not close before they have been told."""
        until = self.now + DISMISSAL_S
        while self.now < until and not self._present.isdisjoint(numbers):
            arrived = self._connection.mailbox.get(POLL_S)
            if arrived is not None and arrived[0] in self._number_of and hasattr(arrived[1], "present"):
                self._note_presence(self._number_of[arrived[0]], present=arrived[1].present)

    def _turn_away(self, number: int, message: HelloReply, reason: str) -> None:
        stop = Stop(message.incarnation, message.instance, self._k, orderly=False, reason=reason)
        self._connection.posts[number](encode(stop))
