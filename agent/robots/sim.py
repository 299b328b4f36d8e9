"""A robot of the world simulator, over Zenoh: the world simulates its body and carries its radio.

Each tick the world sends phase A (the robot's pose), receives the robot's frames, sends phase B (frames for the robot)
and receives its command. In lockstep the world waits for the answers, and repeats a message when it has waited long; a
repeated message gets the same answer again, so that nothing is decided twice. At any other pace the world does not
wait: a robot that is late continues with the newest tick, and decides on everything it has heard since its last
decision.

`runtime.messages.session` holds the rules for messages: `SimRobot` waits for them, hands them to the robot's end of the
session and carries out the effects.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import islice

from agent.ports import Decision, State
from patrol.exchange import Reply, Sensed
from patrol.pose import Command, halted
from runtime.messages.phases import (
    UNLIKE,
    Failed,
    Farewell,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    ToRobot,
    decode_to_robot,
    encode,
    max_to_robot,
)
from runtime.messages.session import (
    Deliver,
    Effects,
    Halt,
    Identity,
    Part,
    Refuse,
    Repeat,
    RobotEnd,
    RobotStage,
    Send,
    Unanswered,
)
from runtime.net.link import TELL_S, Link
from runtime.net.mailbox import Mailbox, Post, Presence
from runtime.process.lifeline import Ending
from runtime.reporting.vitals import Vitals
from runtime.security.keys import WORLD, FleetKeys

_POLL_S = 0.2
_BACKLOG = 256


class SimRobot:
    """Robot, radio, fleet clock and telemetry of one simulated robot (`agent.ports`).

    `farewell` is the reason why the robot left, empty until then; `orderly` is True if it left because the run is over.
    """

    def __init__(
        self,
        mailbox: Mailbox[ToRobot | Presence],
        post: Post,
        session: RobotEnd,
        ending: Ending,
        *,
        model: str = "holonomic",
        waiting: Callable[[float], None] = lambda _waited: None,
        now: Callable[[], float] = time.monotonic,
        alive: Callable[[], None] = lambda: None,
    ) -> None:
        """Join a run; `join` connects everything.

        `model` is for the command that stops the robot. `waiting` is called at intervals with the time, s, that the
        robot has waited for a world's greeting, `alive` in each turn of the loop. `now` is a monotonic clock, s.
        """
        self.farewell = ""
        self.orderly = False
        self._mailbox = mailbox
        self._post = post
        self._session = session
        self._ending = ending
        self._model = model
        self._waiting = waiting
        self._now = now
        self._alive = alive
        self._tell_at = now() + TELL_S[0]
        self._sensed: Sensed | None = None
        self._frames: list[bytes] = []
        self._answers = {PhaseA: (-1, b""), PhaseB: (-1, b"")}  # the last to each phase: tick and payload
        self._answer: ReplyB | None = None  # the last one, unless withdrawn
        self._decision: Reply | None = None  # diagnostics for the next answer

    @property
    def k(self) -> int:
        """The tick."""
        return self._session.k

    # --- Robot and Radio ---------------------------------------------------------------------------------------------

    def tick(self) -> int | None:
        """Wait for phase A of a new tick and return the newest tick there is; None when it is time to leave."""
        while self._session.stage is not RobotStage.DUE:
            if not self._receive_message():
                return None
        self._take_in_backlog()
        if (phase := self._session.take()) is None:
            return None
        self._sensed = phase.sensed
        return phase.k

    def sense(self) -> Sensed | None:
        """Return the robot's senses in a new tick, as the world reports it; None when it is time to leave."""
        return None if self.tick() is None else self._sensed

    def decide(self) -> bool:
        """Wait for phase B; False when there is nothing to decide."""
        return self.hear() is not None

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Answer phase A with this robot's position frame and its contacts."""
        self._answers[PhaseA] = self._encode_answer(ReplyA(*self._session.head(self._session.k), frames))

    def hear(self) -> list[bytes] | None:
        """Wait for phase B, and return all frames since the last decision; None when there is nothing to decide."""
        while self._session.stage is RobotStage.AWAITS_B and self._receive_message():
            pass
        if self._session.stage is not RobotStage.AWAITS_A:
            return None
        frames, self._frames = self._frames, []
        return frames

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Keep the diagnostics for the answer that carries the command."""
        del sensed
        rejected = decision.rejected + self.refused
        self._decision = Reply(decision.command, str(decision.state), decision.refined, decision_ms, rejected)

    def act(self, command: Command) -> None:
        """Answer phase B with the command."""
        reply = self._decision or Reply(command, State.PATROLLING.value, None, 0.0, self.refused)
        self._decision = None
        self._answer = ReplyB(*self._session.head(self._session.k), replace(reply, command=command))
        self._answers[PhaseB] = self._encode_answer(self._answer)

    def stop(self, reason: str) -> None:
        """Report to the world that the mind cannot go on."""
        self._post(encode(Failed(*self._session.head(max(self._session.k, 0)), reason)))

    @property
    def world_present(self) -> bool:
        """True if the fleet has a world, which may not have greeted this robot yet."""
        return self._session.world_present

    @property
    def unlike(self) -> bool:
        """True if the world has turned this process away because their scenarios or versions differ."""
        return self.farewell.startswith(UNLIKE)

    @property
    def refused(self) -> int:
        """Number of messages dropped unread."""
        return self._mailbox.refused.total()

    def show(self, vitals: Vitals) -> None:
        """Have waiting and dropped messages read with this process's figures."""
        vitals.probe_mailbox(self._mailbox)

    # --- receiving ---------------------------------------------------------------------------------------------------

    def _receive_message(self) -> bool:
        """Wait for one message and take it in; False when it is time to leave."""
        looked = self._now()
        while not (self._ending or self._session.has_left):
            self._alive()
            now = self._now()
            self._carry_out(self._session.waited(now - looked, now))  # each time: not every message breaks a silence
            looked = now
            if (arrived := self._mailbox.get(_POLL_S)) is not None:
                self._carry_out(self._session.arrived(arrived[1], self._now()))
                return not self._session.has_left
        self._take_in_backlog()  # a farewell that has come before the signal counts
        self._carry_out(self._session.leave(self._ending.reason))
        return False

    def _take_in_backlog(self) -> None:
        for _, message in islice(iter(self._mailbox.get, None), _BACKLOG):
            self._carry_out(self._session.arrived(message, self._now()))

    def _carry_out(self, effects: Effects) -> None:
        for effect in effects:
            match effect:
                case Send(message):
                    self._post(encode(message))
                case Refuse(reason):
                    self._mailbox.refused[reason] += 1
                case Repeat(phase) if phase.k == self._answers[type(phase)][0]:
                    self._post(self._answers[type(phase)][1])
                case Deliver(PhaseB(frames=frames)):
                    self._frames.extend(frames)
                case Halt() if self._answer is not None:
                    self._halt_body(self._answer)
                case Unanswered(waited_s) if (now := self._now()) >= self._tell_at:
                    self._tell_at = now + TELL_S[1]
                    self._waiting(waited_s)
                case Part(reason, orderly):
                    self.farewell, self.orderly = reason, orderly
                    if self._session.k >= 0:
                        self._post(encode(Farewell(*self._session.head(self._session.k))))

    def _halt_body(self, answer: ReplyB) -> None:
        """Withdraw the last command, so that the world stops the body if it can hear."""
        halt = replace(answer.reply, command=halted(self._model), state=State.HOLDING.value, goal=None)
        self._encode_answer(replace(answer, reply=halt))
        self._answer = None

    def _encode_answer(self, answer: ReplyA | ReplyB) -> tuple[int, bytes]:
        payload = encode(answer)
        self._post(payload)
        return answer.k, payload


def join(
    link: Link,
    keys: FleetKeys,
    identity: Identity,
    robots: int,
    zones: int,
    ending: Ending,
    patience_s: float,
    waiting: Callable[[float], None],
    blind_s: float = math.inf,
    model: str = "holonomic",
    alive: Callable[[], None] = lambda: None,
) -> SimRobot:
    """Take a robot's place in a fleet.

    Subscribes to ticks before the token announces this robot, so that no tick is missed.

    The robot leaves after `patience_s` without a world, and stops after `blind_s` without a new pose. For `waiting` and
    `alive` see `SimRobot`.
    """
    decode = partial(decode_to_robot, zones=zones)
    places = keys.tick(identity.name), keys.alive(WORLD)
    mailbox: Mailbox[ToRobot | Presence] = Mailbox(places, decode, max_to_robot(robots))
    post = link.post(keys.reply(identity.name))
    session = RobotEnd(identity, patience_s, blind_s, time.monotonic())
    robot = SimRobot(mailbox, post, session, ending, model=model, waiting=waiting, alive=alive)
    link.subscribe(keys.tick(identity.name), mailbox)
    link.watch(keys.alive(WORLD), mailbox)
    link.live(keys.alive(identity.name))
    return robot
