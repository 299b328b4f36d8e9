"""A robot of the world simulator, over Zenoh: the world simulates its body and carries its radio.

Each tick the world sends phase A (the robot's pose), receives the robot's frames, sends phase B (what the robot hears)
and receives its command. In lockstep the world waits for the answers, and repeats a message when it has waited long; a
repeated message gets the same answer again, so that nothing is decided twice. At any other pace the world does not
wait: a robot that is late continues with the newest tick, and decides on everything it has heard since its last
decision.

Messages for another process of this robot (another incarnation or instance) or of another run are counted and ignored,
and so is a tick without a proof that it has begun. A process that a world has greeted leaves for that world alone.

The robot reports to the world what it has sent and acted on, so that a verdict finds what others sent in their names.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

from agent.ports import Decision, State
from patrol.exchange import Reply, Sensed
from patrol.net.keys import WORLD, FleetKeys
from patrol.net.link import TELL_S, Link
from patrol.net.mailbox import Mailbox, Post, Presence
from patrol.net.messages.phases import (
    NO_RUN,
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
    decode_to_robot,
    encode,
    max_to_robot,
)
from patrol.net.security.tick_chain import TickProofs
from patrol.net.security.transcripts import LAST, PHASE_A, PHASE_B, REPLY_A, REPLY_B, RobotTranscript, digest_of
from patrol.pose import Command, halted
from patrol.process.lifeline import Ending
from patrol.process.reporting.vitals import Vitals

SILENCE_S = 5.0
"""Silence of the world after which a robot asks whether it is still part of the run, s."""

UNGREETED_S = 1.0
"""Interval at which a robot asks for a greeting until the world has greeted it, s."""

_POLL_S = 0.2
_PAUSE_S = 2.0
_BACKLOG = 256
_OFFERS = 8
"""Worlds that a robot answers at most, until one of them has begun a tick: somebody else may greet it too."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What identifies a robot's process.

    Attributes:
        name: The robot's name.
        incarnation: Counts the robot's processes, from 1.
        instance: Random number of this process, above 0.
        scenario: The scenario's hash.
    """

    name: str
    incarnation: int
    instance: int
    scenario: str


class SimRobot:
    """Robot, radio, fleet clock and telemetry of one simulated robot (`agent.ports`).

    Attributes:
        farewell: Why the robot left; empty until then.
        orderly: Whether it left because the run is over.
    """

    def __init__(
        self,
        mailbox: Mailbox[ToRobot | Presence],
        post: Post,
        identity: Identity,
        ending: Ending,
        patience_s: float,
        *,
        model: str = "holonomic",
        blind_s: float = math.inf,
        waiting: Callable[[float], None] = lambda _waited: None,
        now: Callable[[], float] = time.monotonic,
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        """Join a run; `join` connects everything.

        Args:
            mailbox: Messages from the world, and whether it is present.
            post: Sends a message to the world.
            identity: Of this process.
            ending: Whether this process has to leave.
            patience_s: Time without a world after which the robot leaves, s.
            model: Body model, for the command that stops it.
            blind_s: Time without a new pose after which the robot stops, s. Infinite in lockstep, where the world
                waits.
            waiting: Called at intervals with the time that the robot has waited for a world's greeting, s.
            now: Monotonic clock, s.
            alive: Called in each round of waiting.
        """
        self.farewell = ""
        self.orderly = False
        self._mailbox = mailbox
        self._post = post
        self._identity = identity
        self._ending = ending
        self._patience_s = patience_s
        self._blind_s = blind_s
        self._waiting = waiting
        self._now = now
        self._alive = alive
        self._model = model
        self._answer: ReplyB | None = None  # the last one, unless withdrawn
        self._decision: Reply | None = None  # diagnostics for the next answer
        self._run: int | None = None
        self._world_present = False
        self._unbroken = True  # no token has disappeared since our own world's last message
        self._own_news = self._last_news = self._last_said = self._checked = self._posed = now()
        self._tell_at = now() + TELL_S[0]
        self._offers: dict[int, TickProofs] = {}  # by run, until a phase of one of them has come
        self._transcript = RobotTranscript()
        self._k = -1
        self._answered = -1  # the tick before, whose line of the transcript is complete
        self._heard_k = -1
        self._early: set[int] = set()
        self._next: PhaseA | None = None
        self._sensed: Sensed | None = None
        self._frames: list[bytes] = []
        self._answer_a = self._answer_b = (-1, b"")

    # --- Robot and Radio ---------------------------------------------------------------------------------------------

    def tick(self) -> int | None:
        """Wait for phase A of a new tick and return the newest tick there is; None when it is time to leave."""
        while self._next is None:
            if not self._receive():
                return None
        for _, message in islice(iter(self._mailbox.get, None), _BACKLOG):
            self._take(message)
        phase, self._next = self._next, None
        self._transcript.note(phase.k, PHASE_A, phase.digest)
        self._answered, self._k = self._k, phase.k
        self._sensed = phase.sensed
        return phase.k

    def sense(self) -> Sensed | None:
        """What the robot senses in a new tick, as the world reports it; None when it is time to leave."""
        return None if self.tick() is None else self._sensed

    def decide(self) -> bool:
        """Wait for phase B; False when there is nothing to decide."""
        return self.hear() is not None

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Answer phase A with this robot's position frame and its contacts."""
        payload = encode(ReplyA(*self._head(self._k), frames))
        self._answer_a = (self._k, payload)
        self._post(payload)
        self._transcript.note(self._k, REPLY_A, digest_of(payload))

    def hear(self) -> list[bytes] | None:
        """Wait for phase B.

        Returns:
            All frames since the last decision, or None when there is nothing to decide.
        """
        if self._transcript.due and self._answered >= 0:  # here, where the frames have left, by whatever radio
            self._report(self._answered)
        while self._heard_k < self._k and self._k not in self._early:
            if self._next is not None or not self._receive():
                return None
        heard, self._frames = self._frames, []
        return heard

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Keep the diagnostics for the answer that carries the command.

        Args:
            sensed: Not used: the world knows it.
            decision: The mind's decision.
            decision_ms: Wall time of the decision, ms.
        """
        del sensed
        rejected = decision.rejected + self.refused
        self._decision = Reply(decision.command, str(decision.state), decision.refined, decision_ms, rejected)

    def act(self, command: Command) -> None:
        """Answer phase B with the command."""
        told = self._decision or Reply(command, State.PATROLLING.value, None, 0.0, self.refused)
        self._decision = None
        self._answer = ReplyB(*self._head(self._k), replace(told, command=command))
        payload = encode(self._answer)
        self._answer_b = (self._k, payload)
        self._post(payload)
        self._transcript.note(self._k, REPLY_B, digest_of(payload))

    def stop(self, reason: str) -> None:
        """Report to the world that the mind cannot go on.

        Args:
            reason: Why, in one line.
        """
        self._report(LAST)
        self._post(encode(Failed(*self._head(max(self._k, 0)), reason)))

    @property
    def world_present(self) -> bool:
        """Whether the fleet has a world, which may not have greeted this robot yet."""
        return self._world_present

    @property
    def unlike(self) -> bool:
        """Whether the world has turned this process away because their scenarios or versions differ."""
        return self.farewell.startswith(UNLIKE)

    @property
    def refused(self) -> int:
        """Number of messages dropped unread."""
        return self._mailbox.refused.total()

    def show(self, vitals: Vitals) -> None:
        """Have what waits and what was dropped read with this process's figures."""
        vitals.probe_mailbox(self._mailbox)

    # --- receiving ---------------------------------------------------------------------------------------------------

    def _receive(self) -> bool:
        """Wait for one message and process it; False when it is time to leave."""
        self._checked = self._now()
        while not self._ending and not self.farewell:
            self._alive()
            self._mind_the_silence()  # each time: messages that are not for us break no silence
            arrived = self._mailbox.get(_POLL_S)
            if arrived is not None:
                self._take(arrived[1])
                return not self.farewell
        for _, message in islice(iter(self._mailbox.get, None), _BACKLOG):
            self._take(message)  # a farewell that has come before the signal counts
        self._leave(self._ending.reason, orderly=False)
        return False

    def _take(self, message: ToRobot | Presence) -> None:
        if isinstance(message, Presence):
            self._world_present = message.present
            self._unbroken = self._unbroken and message.present
            self._last_news = self._now()
        elif isinstance(message, Hello):
            self._greet(message)
        elif not self._is_for_me(message):
            self._mailbox.refused["stranger"] += 1
        elif not isinstance(message, Stop) and not self._has_begun(message):
            self._mailbox.refused["ahead"] += 1
        else:
            self._hear_own_world()
            self._obey(message)

    def _is_for_me(self, message: PhaseA | PhaseB | Stop) -> bool:
        if (message.incarnation, message.instance) != (self._identity.incarnation, self._identity.instance):
            return False
        return message.run in self._offers or (not self._offers and isinstance(message, Stop))

    def _has_begun(self, message: PhaseA | PhaseB) -> bool:
        """Whether a message's tick has begun; the first run that proves one is this robot's own."""
        proofs = self._offers[message.run]
        if not proofs.accepts(message.k + 1, message.proof, self._now()):
            return False
        if self._run is None and isinstance(message, PhaseA):
            self._run = message.run
            self._offers = {message.run: proofs}
        return True

    def _obey(self, message: PhaseA | PhaseB | Stop) -> None:
        match message:
            case PhaseA(k=k) if k == self._answer_a[0]:
                self._post(self._answer_a[1])
            case PhaseA(k=k) if k > self._k and (self._next is None or k > self._next.k):
                self._next = message
                self._posed = self._now()
            case PhaseB(k=k) if k == self._answer_b[0]:
                self._post(self._answer_b[1])
            case PhaseB(k=k) if k > self._heard_k and k not in self._early:
                self._hear(message, self._k if self._next is None else self._next.k)
            case Stop():
                self._leave(message.reason, orderly=message.orderly)

    def _hear(self, message: PhaseB, newest: int) -> None:
        """Take in a phase B; the wait for that of the newest phase A goes on after one that came early."""
        if message.k > newest:
            self._early.add(message.k)
        else:
            self._heard_k = message.k
            self._early = {k for k in self._early if k > message.k}
        self._transcript.note(message.k, PHASE_B, message.digest)
        self._frames.extend(message.frames)

    def _greet(self, message: Hello) -> None:
        if self._run is not None and message.run != self._run:
            if (self._world_present and self._unbroken) or self._now() < self._own_news + SILENCE_S:
                self._mailbox.refused["stranger"] += 1  # our own world is still there
            else:
                self._leave("another world has taken over this fleet", orderly=False)
            return
        if message.run not in self._offers:
            self._offers[message.run] = TickProofs(message.k, message.proof, message.stride, self._now())
        if len(self._offers) > _OFFERS:
            del self._offers[next(iter(self._offers))]
        self._hear_own_world()
        self._say_hello(message.run)

    def _hear_own_world(self) -> None:
        self._last_news = self._own_news = self._now()
        self._unbroken = True

    def _say_hello(self, run: int) -> None:
        self._last_said = self._now()
        incarnation, instance, k, _ = self._head(max(self._k, 0))
        self._post(encode(HelloReply(incarnation, instance, k, run, self._identity.scenario)))

    def _mind_the_silence(self) -> None:
        """After a silence, ask whether this robot still belongs to the run, or leave when the world is lost.

        A pause of this process itself, between two of these checks, does not count as silence.
        """
        now = self._now()
        if now - self._checked > _PAUSE_S:
            self._last_news += now - self._checked
            self._posed += now - self._checked
        self._checked = now
        self._halt_if_blind(now)
        silent_s = now - self._last_news
        if not self._world_present and silent_s > self._patience_s:
            self._leave(f"no world for {silent_s:.0f} s", orderly=False)
        elif min(silent_s, now - self._last_said) > (SILENCE_S if self._offers else UNGREETED_S):
            self._say_hello(NO_RUN if self._run is None else self._run)
            if (not self._offers or not self._world_present) and now >= self._tell_at:
                self._tell_at = now + TELL_S[1]
                self._waiting(silent_s)

    def _halt_if_blind(self, now: float) -> None:
        """Withdraw the last command when no pose has come for long, so that the world stops the body if it can hear."""
        if self._answer is not None and now - self._posed > self._blind_s:
            still = replace(self._answer.reply, command=halted(self._model), state=State.HOLDING.value, goal=None)
            payload = encode(replace(self._answer, reply=still))
            self._transcript.note(self._answer.k, REPLY_B, digest_of(payload))
            self._post(payload)
            self._answer = None

    def _head(self, k: int) -> tuple[int, int, int, int]:
        run = next(reversed(self._offers), NO_RUN) if self._run is None else self._run
        return self._identity.incarnation, self._identity.instance, k, run

    def _report(self, until: int) -> None:
        """Report to the world what was sent and acted on, complete up to a tick."""
        for first, last, lines in self._transcript.report(until):
            self._post(encode(Report(*self._head(last), first, lines)))

    def _leave(self, reason: str, *, orderly: bool) -> None:
        if not self.farewell:
            self.farewell = reason
            self.orderly = orderly
            if self._k >= 0:
                self._report(LAST)


def join(
    link: Link,
    keys: FleetKeys,
    identity: Identity,
    robots: int,
    ending: Ending,
    patience_s: float,
    waiting: Callable[[float], None],
    blind_s: float = math.inf,
    model: str = "holonomic",
    alive: Callable[[], None] = lambda: None,
) -> SimRobot:
    """Take a robot's place in a fleet.

    Subscribes to ticks before the token announces this robot, so that no tick is missed.

    Args:
        link: To the fleet's router.
        keys: Of the fleet.
        identity: Of this process.
        robots: Number of robots in the fleet.
        ending: Whether this process has to leave.
        patience_s: Time without a world after which the robot leaves, s.
        waiting: Called at intervals with the time that the robot has waited for a world's greeting, s.
        blind_s: Time without a new pose after which the robot stops, s.
        model: Body model.
        alive: Called in each round of waiting.
    """
    mailbox: Mailbox[ToRobot | Presence] = Mailbox(
        (keys.tick(identity.name), keys.alive(WORLD)), decode_to_robot, max_to_robot(robots)
    )
    post = link.post(keys.reply(identity.name))
    robot = SimRobot(
        mailbox, post, identity, ending, patience_s, model=model, blind_s=blind_s, waiting=waiting, alive=alive
    )
    link.subscribe(keys.tick(identity.name), mailbox)
    link.watch(keys.alive(WORLD), mailbox)
    link.live(keys.alive(identity.name))
    return robot
