"""A robot of the world simulator, over Zenoh: the world simulates its body and carries its radio.

Each tick the world sends phase A (the robot's pose), receives the robot's frames, sends phase B (what the robot hears)
and receives its command. In lockstep the world waits for the answers, and repeats a message when it has waited long; a
repeated message gets the same answer again, so that nothing is decided twice. At any other pace the world does not
wait: a robot that is late continues with the newest tick, and decides on everything it has heard since its last
decision.

Messages for another process of this robot (another incarnation or instance) are counted and ignored.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from agent.ports import Decision, State
from patrol.exchange import Reply, Sensed
from patrol.net.keys import WORLD, FleetKeys
from patrol.net.link import TELL_S, Link
from patrol.net.mailbox import Mailbox, Post, Presence
from patrol.net.phases import (
    ANYONE,
    NO_RUN,
    UNLIKE,
    Failed,
    Hello,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    ToRobot,
    decode_to_robot,
    encode,
    max_to_robot,
)
from patrol.pose import Command, halted
from patrol.process.lifeline import Ending

SILENCE_S = 5.0
"""Silence of the world after which a robot asks whether it is still part of the run, s."""

UNGREETED_S = 1.0
"""Interval at which a robot asks for a greeting until the world has greeted it, s."""

_POLL_S = 0.2
_PAUSE_S = 2.0
_BACKLOG = 256


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
        self._posed = now()
        self._model = model
        self._answer: ReplyB | None = None  # the last one, unless withdrawn
        self._decision: Reply | None = None  # diagnostics for the next answer
        self._run: int | None = None
        self._world_present = False
        self._unbroken = True  # no token has disappeared since our own world's last message
        self._own_news = now()
        self._last_news = self._last_said = self._checked = now()
        self._tell_at = now() + TELL_S[0]
        self._k = -1
        self._heard_k = -1
        self._next: PhaseA | None = None
        self._sensed: Sensed | None = None
        self._frames: list[bytes] = []
        self._answer_a = (-1, b"")
        self._answer_b = (-1, b"")

    # --- Robot and Radio ---------------------------------------------------------------------------------------------

    def tick(self) -> int | None:
        """Wait for phase A of a new tick and return the newest tick there is; None when it is time to leave."""
        while self._next is None:
            if not self._receive():
                return None
        for _ in range(_BACKLOG):
            if (arrived := self._mailbox.get()) is None:
                break
            self._take(arrived[1])
        phase, self._next = self._next, None
        self._k = phase.k
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
        payload = encode(ReplyA(self._identity.incarnation, self._identity.instance, self._k, frames))
        self._answer_a = (self._k, payload)
        self._post(payload)

    def hear(self) -> list[bytes] | None:
        """Wait for phase B.

        Returns:
            All frames since the last decision, or None when there is nothing to decide.
        """
        while self._heard_k < self._k:
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
        self._answer = ReplyB(
            self._identity.incarnation, self._identity.instance, self._k, replace(told, command=command)
        )
        payload = encode(self._answer)
        self._answer_b = (self._k, payload)
        self._post(payload)

    def stop(self, reason: str) -> None:
        """Report to the world that the mind cannot go on.

        Args:
            reason: Why, in one line.
        """
        self._post(encode(Failed(self._identity.incarnation, self._identity.instance, max(self._k, 0), reason)))

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

    # --- receiving ---------------------------------------------------------------------------------------------------

    def _receive(self) -> bool:
        """Wait for one message and process it; False when it is time to leave."""
        self._checked = self._now()
        while not self._ending and not self.farewell:
            self._mind_the_silence()  # each time: messages that are not for us break no silence
            arrived = self._mailbox.get(_POLL_S)
            if arrived is not None:
                self._take(arrived[1])
                return not self.farewell
        if not self.farewell:
            self.farewell = self._ending.reason
        return False

    def _take(self, message: ToRobot | Presence) -> None:
        if isinstance(message, Presence):
            self._world_present = message.present
            self._unbroken = self._unbroken and message.present
            self._last_news = self._now()
        elif isinstance(message, Hello):
            self._greet(message)
        elif message.instance != self._identity.instance or message.incarnation != self._identity.incarnation:
            if not (isinstance(message, Stop) and message.instance == ANYONE):
                self._mailbox.refused["stranger"] += 1
            else:
                self._leave(message.reason, orderly=message.orderly)
        else:
            self._hear_own_world()
            self._obey(message)

    def _obey(self, message: PhaseA | PhaseB | Stop) -> None:
        match message:
            case PhaseA(k=k) if k == self._answer_a[0]:
                self._post(self._answer_a[1])
            case PhaseA(k=k) if k > self._k and (self._next is None or k > self._next.k):
                self._next = message
                self._posed = self._now()
            case PhaseB(k=k) if k == self._answer_b[0]:
                self._post(self._answer_b[1])
            case PhaseB(k=k) if k > self._heard_k:
                self._heard_k = k
                self._frames.extend(message.frames)
            case Stop():
                self._leave(message.reason, orderly=message.orderly)

    def _greet(self, message: Hello) -> None:
        if self._run is not None and message.run != self._run:
            if (self._world_present and self._unbroken) or self._now() < self._own_news + SILENCE_S:
                self._mailbox.refused["stranger"] += 1  # our own world is still there
            else:
                self._leave("another world has taken over this fleet", orderly=False)
            return
        self._run = message.run
        self._hear_own_world()
        self._say_hello()

    def _hear_own_world(self) -> None:
        self._last_news = self._own_news = self._now()
        self._unbroken = True

    def _say_hello(self) -> None:
        me = self._identity
        self._last_said = self._now()
        run = NO_RUN if self._run is None else self._run
        self._post(encode(HelloReply(me.incarnation, me.instance, max(self._k, 0), run, me.scenario)))

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
        elif min(silent_s, now - self._last_said) > (UNGREETED_S if self._run is None else SILENCE_S):
            self._say_hello()
            if (self._run is None or not self._world_present) and now >= self._tell_at:
                self._tell_at = now + TELL_S[1]
                self._waiting(silent_s)

    def _halt_if_blind(self, now: float) -> None:
        """Withdraw the last command when no pose has come for long, so that the world stops the body if it can hear."""
        if self._answer is not None and now - self._posed > self._blind_s:
            still = replace(self._answer.reply, command=halted(self._model), state=State.HOLDING.value, goal=None)
            self._post(encode(replace(self._answer, reply=still)))
            self._answer = None

    def _leave(self, reason: str, *, orderly: bool) -> None:
        if not self.farewell:
            self.farewell = reason
            self.orderly = orderly


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
    """
    mailbox: Mailbox[ToRobot | Presence] = Mailbox(
        (keys.tick(identity.name), keys.alive(WORLD)), decode_to_robot, max_to_robot(robots)
    )
    post = link.post(keys.reply(identity.name))
    robot = SimRobot(mailbox, post, identity, ending, patience_s, model=model, blind_s=blind_s, waiting=waiting)
    link.subscribe(keys.tick(identity.name), mailbox)
    link.watch(keys.alive(WORLD), mailbox)
    link.live(keys.alive(identity.name))
    return robot
