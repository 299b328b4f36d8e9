"""The world's sessions with the robots' processes: which process speaks for which robot, and which are gone.

A process opens a session by answering the world's hello. From then on only that process, identified by its incarnation
and instance, speaks for the robot, and another one that asks for the seat is turned away and counted. Where a launcher
has started the processes, the world knows their instances beforehand (`patrol.net.security.seats`).

A robot's liveliness token goes when its process ends, when its connection does, and with all others when the router
does. A router closes the connection of a client that has too much to read and does not read for a second, as on a busy
machine, and the client connects again. So a token that has gone is only a reason to look closer. Where a launcher has
started the processes, it says which have ended. Elsewhere a robot is gone that has said farewell, or does not come back
in time. All that counts only while the router answers, and after an outage only once clients have had time to
reconnect.

Time is what `now` says, and messages come from a mailbox, so that all of this can be tested without a network.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NoReturn

from patrol.errors import BadInput
from patrol.net.mailbox import Presence
from patrol.net.messages.phases import (
    ANYONE,
    NO_RUN,
    PROTOCOL,
    UNLIKE,
    Failed,
    Hello,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Report,
    Stop,
    ToRobot,
    ToWorld,
    encode,
)
from patrol.net.security.transcripts import (
    MAX_TICKS,
    PHASE_A,
    PHASE_B,
    REPLY_A,
    REPLY_B,
    WorldTranscript,
    as_notes,
    digest_of,
)
from worldsim.fleet.connection import Addressee, FleetConnection, RunIdentity
from worldsim.fleet.session import Session

POLL_S = 0.1
HELLO_S = 1.0
GRACE_S = 0.3
"""How long a token must have been gone, the router answering, before its robot can count as gone."""
RETURN_S = 12.0
"""The same for a robot that nobody has started here and that has not said farewell. One that was cut off may have 10 s
left of an attempt to connect when the network is back, and the next begins half a second later."""
RECOVERY_S = 5.0
"""How long clients may take to reconnect to a router that has returned."""
DISMISSAL_S = 10.0
"""How long robots that are told to leave may take until their tokens go; one that was paused has much to read first."""
REPORT_S = 2.0
"""How long their last reports may then take to come."""


class Interrupted(Exception):
    """The world was asked to end while it waited."""


class Missing(Exception):
    """Robots whose processes did not come in time; one line names them."""


class Sessions:
    """The processes that speak for the robots."""

    def __init__(self, connection: FleetConnection, run: RunIdentity, absent: Collection[int] = ()) -> None:
        """Expect a process for each robot.

        Args:
            connection: What connects the world with the robots.
            run: What identifies the run.
            absent: Numbers of robots for which no process is expected yet.
        """
        self._connection = connection
        self._run = run
        self._number_of = {connection.keys.reply(name): number for number, name in connection.names.items()}
        self._number_of |= {connection.keys.alive(name): number for number, name in connection.names.items()}
        self._sessions: dict[int, Session] = {}
        self._expected: dict[int, int | None] = {number: None for number in connection.names if number not in absent}
        self._present: set[int] = set()
        self._absent: dict[int, float] = {}  # since when a token is gone
        self._dismissed: dict[int, str] = {}
        self._failed: dict[int, str] = {}
        self._transcripts: dict[int, dict[tuple[int, int], WorldTranscript]] = {n: {} for n in connection.names}
        self._trusted_from = connection.now()
        self._k = 0
        self._begun = 0
        self._gathering = False

    @property
    def now(self) -> float:
        """The time, s."""
        return self._connection.now()

    @property
    def waiting(self) -> int:
        """How many messages wait to be taken."""
        return self._connection.mailbox.waiting

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
        self._gathering = True
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
        self._gathering = False

    def send(self, number: int, make: Callable[[Addressee], ToRobot]) -> bytes:
        """Send a message to a robot that has a session.

        Args:
            number: The robot's number.
            make: Builds the message from the process that it is for.

        Returns:
            The bytes sent, for `repeat`.
        """
        session = self._sessions[number]
        message = make(session.process)
        self._k = max(self._k, message.k)
        payload = encode(message)
        self._connection.posts[number](payload)  # first: the robot waits for nothing that is written down here
        if isinstance(message, PhaseA | PhaseB):
            self._begun = max(self._begun, message.k + 1)
            place = PHASE_A if isinstance(message, PhaseA) else PHASE_B
            session.transcript.sent(message.k, place, digest_of(payload))
        return payload

    def act_on(self, number: int, answer: ReplyA | ReplyB) -> None:
        """Write down that the world acts on an answer that `take` has returned.

        Args:
            number: The robot's number.
            answer: The answer.
        """
        place = REPLY_A if isinstance(answer, ReplyA) else REPLY_B
        transcript = self._transcripts[number][answer.incarnation, answer.instance]
        transcript.acted_on(answer.k, place, answer.digest or digest_of(encode(answer)))

    def transcripts(self) -> list[dict[str, object]]:
        """What the robots and the world have each sent and acted on, as notes for the journal's end."""
        of_all = self._transcripts.items()
        return as_notes({(n, incarnation): kept for n, ones in of_all for (incarnation, _), kept in ones.items()})

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
        if (arrived := self._arrived(timeout_s)) is None:
            return None
        number, message = arrived
        if isinstance(message, ReplyA | ReplyB | Failed) and not self._has_session(number, message):
            self.refused["stranger"] += 1
        elif isinstance(message, ReplyA | ReplyB):
            if self._begun - MAX_TICKS <= message.k < self._begun:
                return number, message
            self.refused["ahead" if message.k >= self._begun else "late"] += 1
        elif isinstance(message, Failed):
            self._failed[number] = message.reason
        elif isinstance(message, Report):
            self._compare(number, message)
        elif isinstance(message, HelloReply):
            self._answer_hello(number, message)
        elif isinstance(message, Presence):
            self._note_presence(number, present=message.present)
        return None

    def gone(self, numbers: Iterable[int]) -> list[int]:
        """Return those of the robots whose process is gone.

        Args:
            numbers: The robots.
        """
        now = self.now
        absent = [number for number in numbers if number in self._absent]
        if not absent:
            return []
        if not self._connection.connected():
            self._trusted_from = now + RECOVERY_S
        if now < self._trusted_from:
            return []
        return [number for number in absent if self._is_gone(number, now - self._absent[number])]

    def _is_gone(self, number: int, absent_s: float) -> bool:
        """Return whether a robot is gone whose token has been gone for so long, s."""
        if absent_s < GRACE_S:
            return False
        if self._connection.has_ended is not None:
            return self._connection.has_ended(number)
        session = self._sessions.get(number)
        return absent_s >= RETURN_S or (session is not None and session.transcript.closed)

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
            self.send(number, lambda to: Stop(to.incarnation, to.instance, self._k, to.run, orderly, reason))

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
        self._absent.pop(number, None)

    def is_open(self, number: int) -> bool:
        """Whether a process speaks for the robot."""
        return number in self._sessions

    def await_session(self, number: int) -> None:
        """Greet a robot's process, if it is there, and wait up to `HELLO_S` for its session."""
        self._greet(number)
        until = self.now + HELLO_S
        while not self.is_open(number) and self.now < until:
            self.take(POLL_S)

    def close(self, k: int, reason: str) -> None:
        """Dismiss all robots; wait up to `DISMISSAL_S` until they are gone, then up to `REPORT_S` for reports.

        Args:
            k: The tick that would be next.
            reason: For the processes to report.
        """
        self._k, staying = k, [number for number in self._sessions if number not in self._dismissed]
        until = self.now + DISMISSAL_S
        sent = -HELLO_S
        while self.now < until:
            left = [number for number in staying if number in self._present]
            if not left and self._all_reported(staying):
                break
            if left and self.now >= sent + HELLO_S / 2:
                sent = self.now
                for number in left:
                    self.dismiss(number, reason, orderly=True)
            if not left:
                until = min(until, self.now + REPORT_S)
            self._take_farewell()

    # --- what arrives ------------------------------------------------------------------------------------------------

    def _arrived(self, timeout_s: float) -> tuple[int, ToWorld | Presence] | None:
        """The next message with its robot's number, if one comes in time; None also for the world's own token."""
        arrived = self._connection.mailbox.get(timeout_s)
        number = None if arrived is None else self._number_of.get(arrived[0])
        return None if arrived is None or number is None else (number, arrived[1])

    def _greet(self, number: int) -> None:
        if number in self._present and number in self._expected:
            self._connection.posts[number](encode(self._hello()))

    def _hello(self) -> Hello:
        chain = self._run.chain
        return Hello(0, ANYONE, self._begun, self._run.number, chain.proof(self._begun), chain.stride)

    def _note_presence(self, number: int, *, present: bool) -> None:
        if present:
            self._present.add(number)
            self._absent.pop(number, None)
            if number not in self._sessions:
                self._greet(number)
        else:
            self._present.discard(number)
            self._absent.setdefault(number, self.now)

    def _has_session(self, number: int, message: ToWorld) -> bool:
        session = self._sessions.get(number)
        return session is not None and session.speaks(message) and number not in self._dismissed

    def _compare(self, number: int, message: Report) -> None:
        """Compare the report of a process that has, or had, a session."""
        transcript = self._transcripts[number].get((message.incarnation, message.instance))
        if transcript is None or message.run != self._run.number:
            self._connection.mailbox.refused["stranger"] += 1
        else:
            transcript.compare(message.since, message.k, message.lines)

    def _all_reported(self, numbers: Iterable[int]) -> bool:
        """Whether the processes of these robots have sent their last reports."""
        return all(self._sessions[number].transcript.closed for number in numbers)

    def _take_farewell(self) -> None:
        """Wait up to `POLL_S` for a message while processes leave; only reports and presence matter then."""
        if (arrived := self._arrived(POLL_S)) is None:
            return
        number, message = arrived
        if isinstance(message, Report):
            self._compare(number, message)
        elif isinstance(message, Presence):
            self._note_presence(number, present=message.present)

    def _answer_hello(self, number: int, message: HelloReply) -> None:
        """Deal with a process that answers a hello, asks for one, or asks whether it still belongs to the run."""
        name = self._connection.names[number]
        session = self._sessions.get(number)
        if message.run not in (self._run.number, NO_RUN):
            self._connection.mailbox.refused["stranger"] += 1
        elif session is None and message.run == NO_RUN and message.protocol == PROTOCOL:
            self._note_presence(number, present=True)
        elif session is None and not self._is_expected(number, message):
            self._refuse_seat(number, message, f"no process is expected for {name} now")
        elif session is None:
            self._seat(number, message)
        elif session.process.instance != message.instance:
            self._refuse_seat(number, message, f"another process is {name} already")
        elif number in self._dismissed:
            self._turn_away(number, message, self._dismissed[number])

    def _seat(self, number: int, message: HelloReply) -> None:
        """Give a process the seat that it is expected to take, unless it means something else than the world."""
        if unlike := self._run.unlike(message):
            if self._gathering:
                self._call_off(number, message, unlike)
            self._refuse_seat(number, message, f"{UNLIKE}{unlike}")
            return
        process = Addressee(message.incarnation, message.instance, self._run.number, self._run.chain.proof)
        one = (message.incarnation, message.instance)
        self._sessions[number] = Session(process, self._transcripts[number].setdefault(one, WorldTranscript()))

    def _refuse_seat(self, number: int, message: HelloReply, reason: str) -> None:
        self._connection.mailbox.refused["seat"] += 1
        self._turn_away(number, message, reason)

    def _is_expected(self, number: int, message: HelloReply) -> bool:
        if number not in self._expected or self._expected[number] not in (None, message.incarnation):
            return False
        return self._run.seat is None or self._run.seat(number, message.incarnation) == message.instance

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
            self._take_farewell()

    def _turn_away(self, number: int, message: HelloReply, reason: str) -> None:
        stop = Stop(message.incarnation, message.instance, self._k, self._run.number, orderly=False, reason=reason)
        self._connection.posts[number](encode(stop))
