"""The world's sessions with the robots' processes: which process speaks for which robot, and which are gone.

`runtime.messages.session` holds the rules for seats and messages. `Sessions` waits for messages, hands them to the
world's end of that robot's session and carries out the effects.

A robot's liveliness token goes when its process ends, when its connection does, and with all others when the router
does. So a token that has gone is only a reason to look closer, and counts only while the router answers, and after an
outage only once clients have had time to reconnect. Where a launcher has started the processes, it says which have
ended.

The clock and the mailbox are passed in, so that all of this can be tested without a network.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from patrol.errors import BadInput
from patrol.exchange import Sensed
from runtime.messages.phases import PhaseA, PhaseB, ReplyA, ReplyB, ToWorld, encode
from runtime.messages.session import Deliver, Effects, Refuse, SeatStage, Send, Unlike, WorldEnd, WorldRun
from runtime.net.mailbox import Presence
from runtime.security.keys import FleetKeys
from worldsim.mailbox import AnswersMailbox


@dataclass(frozen=True, slots=True)
class FleetConnection:
    """The connection of the world with its robots."""

    keys: FleetKeys
    names: Mapping[int, str]
    posts: Mapping[int, Callable[[bytes], None]]  # by number; each sends to a robot
    mailbox: AnswersMailbox[ToWorld | Presence]
    connected: Callable[[], bool]  # True if the router answers now
    now: Callable[[], float]  # seconds of a clock that never goes back
    ending: Callable[[], bool]  # True if the world should end
    has_ended: Callable[[int], bool] | None = None  # asks the launcher about a robot's process; None without a launcher


POLL_S = 0.1
HELLO_S = 1.0
RECOVERY_S = 5.0
"""Longest time until clients have reconnected to a router that has returned."""
DISMISSAL_S = 10.0
"""Longest time until the tokens of robots that are told to leave go; one that was paused has much to read first."""


class Interrupted(Exception):
    """The world was asked to end while it waited."""


class Missing(Exception):
    """Robots whose processes did not come in time; one line names them."""


class Sessions:
    """The processes that speak for the robots."""

    def __init__(self, connection: FleetConnection, run: WorldRun, absent: Collection[int] = ()) -> None:
        """Expect a process for each robot but those in `absent`, which come later."""
        self._connection = connection
        self._run = run
        names, keys = connection.names, connection.keys
        self._ends = {n: WorldEnd(run, n, name, expected=n not in absent) for n, name in names.items()}
        self._end_of_key = {keys.reply(end.name): end for end in self._ends.values()}
        self._end_of_key |= {keys.alive(end.name): end for end in self._ends.values()}
        self._trusted_from = connection.now()
        self._gathering = False

    @property
    def now(self) -> float:
        """The time, s."""
        return self._connection.now()

    @property
    def waiting(self) -> int:
        """Number of messages that wait to be taken."""
        return self._connection.mailbox.waiting

    @property
    def refused(self) -> Counter[str]:
        """Counts of messages from robots that were dropped, by reason."""
        return self._connection.mailbox.refused

    def name(self, number: int) -> str:
        """Return a robot's name."""
        return self._ends[number].name

    def gather(self, wait_s: float, waiting: Callable[[list[str], float], None]) -> None:
        """Greet the robots until each has a session.

        `waiting` is called about every five seconds with the names still missing and the seconds waited. Raises
        `Missing` where processes do not come in time, BadInput where a robot has another scenario or protocol, and
        `Interrupted` where the world should end.
        """
        self._gathering = True
        began = reported = self.now
        greeted = -HELLO_S
        while missing := [end for end in self._ends.values() if end.stage is SeatStage.EXPECTED]:
            now = self.now
            # Again and again: a greeting is lost on a process that has not subscribed yet.
            if now >= greeted + HELLO_S:
                greeted = now
                for end in missing:
                    self._carry_out(end, end.greet())
            # A message that lists hundreds of robots would be of no use, so it names the first eight.
            names = [end.name for end in missing]
            if now - began >= wait_s:
                raise Missing(f"no process came for {', '.join(names[:8])} within {wait_s:g} s")
            if now - reported >= 5.0:
                reported = now
                waiting(names, now - began)
            self.take(POLL_S)
        self._gathering = False

    def send(self, number: int, k: int, tell: Sensed | Sequence[bytes]) -> bytes:
        """Send a robot that has a session phase A of a tick (its senses) or phase B (frames for it).

        Returns the bytes sent, for `repeat`.
        """
        run, end = self._run, self._ends[number]
        if end.process is None:
            raise LookupError(f"no process speaks for {end.name}")
        head = (*end.process, k, run.number)
        payload = encode(PhaseA(*head, tell) if isinstance(tell, Sensed) else PhaseB(*head, tuple(tell)))
        self._connection.posts[number](payload)
        # The same tick again must not move these back.
        run.k, run.begun = max(run.k, k), max(run.begun, k + 1)
        return payload

    def repeat(self, number: int, payload: bytes) -> None:
        """Send the same bytes once more."""
        self._connection.posts[number](payload)

    def take(self, timeout_s: float) -> tuple[int, ReplyA | ReplyB] | None:
        """Take in the next message; return it, with the robot's number, if it is an answer, else None.

        Only a process that has a session answers; everything else is dealt with here. Raises `Interrupted` where the
        world should end.
        """
        if self._connection.ending():
            raise Interrupted
        return self._take_in(timeout_s)

    def gone(self, numbers: Iterable[int]) -> list[int]:
        """Return those of the robots whose process is gone."""
        away = [end for number in numbers if (end := self._ends[number]).away_since is not None]
        if not away:
            return []
        now, has_ended = self.now, self._connection.has_ended
        # Tokens vanish with the router, so they count only once clients have had time to come back.
        if not self._connection.connected():
            # Put off for as long as the router is away: its clients come back only after it.
            self._trusted_from = now + RECOVERY_S
        if now < self._trusted_from:
            return []
        if has_ended is None:
            return [end.number for end in away if end.is_gone(now)]
        # To ask the launcher takes time, so it is asked only about robots whose token stays away.
        return [end.number for end in away if end.is_missing(now) and has_ended(end.number)]

    def failed(self, numbers: Iterable[int]) -> dict[int, str]:
        """Return those of the robots whose mind cannot go on, and why."""
        ends = [self._ends[number] for number in numbers]
        return {end.number: end.reason for end in ends if end.stage is SeatStage.FAILING}

    def dismiss(self, number: int, reason: str, *, orderly: bool) -> None:
        """Tell a robot's process to leave; one that asks later is told again.

        If `orderly`, it leaves as planned, with exit code 0.
        """
        self._carry_out(self._ends[number], self._ends[number].dismiss(reason, orderly=orderly))

    def end(self, number: int) -> None:
        """Forget a robot's process, which is gone for good, and expect no other."""
        self._ends[number].end()

    def expect(self, number: int, incarnation: int) -> None:
        """Expect a robot's new process, of that incarnation and no other."""
        self._ends[number].expect(incarnation)

    def is_open(self, number: int) -> bool:
        """Return whether a process speaks for the robot."""
        return self._ends[number].process is not None

    def await_session(self, number: int) -> None:
        """Greet a robot's process, if it is there, and wait up to `HELLO_S` for its session."""
        self._carry_out(self._ends[number], self._ends[number].greet())
        until = self.now + HELLO_S
        while not self.is_open(number) and self.now < until:
            self.take(POLL_S)

    def close(self, k: int, reason: str) -> None:
        """Dismiss all robots, and wait up to `DISMISSAL_S` until they are gone."""
        self._run.k = k
        # Only processes with a seat know how to leave; others were never greeted.
        staying = [end for end in self._ends.values() if end.stage in (SeatStage.SEATED, SeatStage.FAILING)]
        until = self.now + DISMISSAL_S
        sent_at = -HELLO_S
        while self.now < until and (present := [end for end in staying if end.present]):
            # A dismissal may be lost, so it is said again.
            if self.now >= sent_at + HELLO_S / 2:
                sent_at = self.now
                for end in present:
                    self.dismiss(end.number, reason, orderly=True)
            self._take_in(POLL_S, leaving=True)

    # --- what arrives ------------------------------------------------------------------------------------------------

    def _take_in(self, timeout_s: float, *, leaving: bool = False) -> tuple[int, ReplyA | ReplyB] | None:
        """Take in the next message, if one comes in time; return it if it is an answer.

        While processes leave, only presence matters.
        """
        if (arrived := self._connection.mailbox.get(timeout_s)) is None:
            return None
        key, message = arrived
        end = self._end_of_key.get(key)  # none for the world's own token
        if end is None or (leaving and not isinstance(message, Presence)):
            return None
        return self._carry_out(end, end.arrived(message, self.now))

    def _carry_out(self, end: WorldEnd, effects: Effects) -> tuple[int, ReplyA | ReplyB] | None:
        for effect in effects:
            match effect:
                case Deliver(ReplyA() | ReplyB() as answer):
                    # An answer is always the only effect.
                    return end.number, answer
                case Send(message):
                    self._connection.posts[end.number](encode(message))
                case Refuse(reason):
                    self.refused[reason] += 1
                case Unlike(difference) if self._gathering:
                    self._call_off(end, difference)
                case Unlike():
                    self.refused["seat"] += 1
        return None

    def _call_off(self, unlike: WorldEnd, difference: str) -> NoReturn:
        """Tell the others that the run cannot begin, wait until they have gone, and raise BadInput."""
        why = f"{unlike.name} was started with another {difference}"
        running = [end for end in self._ends.values() if end.process is not None]
        for end in running:
            self.dismiss(end.number, f"the run cannot begin: {why}", orderly=False)
        until = self.now + DISMISSAL_S
        while self.now < until and any(end.present for end in (unlike, *running)):
            self._take_in(POLL_S, leaving=True)  # the link must not close before they have been told
        raise BadInput(why)
