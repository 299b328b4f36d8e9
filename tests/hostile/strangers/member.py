"""Attacks of somebody who was let in, as a viewer or as one robot, and who does not keep to what that role is for."""

import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import zenoh

from patrol.errors import Malformed
from patrol.pose import Velocity
from patrol.random import Draws
from runtime.messages.phases import PhaseA, PhaseB, ReplyA, ReplyB, decode_to_robot, encode
from runtime.security.control_auth import ASK, CHALLENGE
from runtime.security.keys import ROOT, WORLD
from runtime.security.roles import Role, rights_of
from tests.hostile.strangers.door import Door
from tests.hostile.strangers.payloads import all_keys, changed, forged, forged_command, forged_farewell, noise

FOR_S = 2.0
"""How long an attack that goes on lasts."""
MESSAGES = 300
"""Messages of an attack that sends so many."""
HUGE = 100_000_000
"""Bytes of a huge message."""
QUESTIONS = 100
ANSWER_S = 0.5
"""How long a question waits for an answer."""
OVERHEARD, ASKED = "overheard", "asked in the world's place"
"""The counts of what a router should not have let through: messages and questions that are for others."""

_KEPT = 2000
_OWN = zenoh.Locality.REMOTE
_FIRST, _BLOCK = zenoh.Priority.REAL_TIME, zenoh.CongestionControl.BLOCK
_QUEUES = (_FIRST, zenoh.Priority.DATA_HIGH, zenoh.Priority.DATA, zenoh.Priority.BACKGROUND)


class Member:
    """A session of somebody who attacks."""

    def __init__(self, door: Door, role: Role, session: zenoh.Session) -> None:
        self.door = door
        self.role = role
        self._session = session
        self._heard: deque[tuple[str, bytes]] = deque(maxlen=_KEPT)
        self._newest: PhaseA | None = None
        self._keys = all_keys(door.keys, door.robots)

    def listen(self, dice: Draws) -> Counter[str]:
        """Subscribe to everything; what is heard is used in later attacks."""
        del dice
        counts: Counter[str] = Counter()
        allowed = [zenoh.KeyExpr(key) for key in rights_of(self.role, self.door.keys).hear]
        own = [self.door.keys.tick(self.role.robot), self.door.keys.position("*")] if self.role.robot else []

        def receive(sample: zenoh.Sample) -> None:
            key, payload = str(sample.key_expr), sample.payload.to_bytes()
            counts["heard"] += 1
            counts[OVERHEARD] += not any(expression.includes(key) for expression in allowed)
            self._heard.append((key, payload))
            self._note(payload)

        with self._subscribed(["**", f"{ROOT}/**", self.door.keys.anything, *self._keys, *own], receive):
            time.sleep(FOR_S)
        return counts

    def answer_everything(self, dice: Draws) -> Counter[str]:
        """Offer answers to every question of the fleet."""
        lies = [noise(dice) for _ in range(4)]
        counts: Counter[str] = Counter()

        def receive(query: zenoh.Query) -> None:
            counts[ASKED] += 1
            with query:
                for lie in lies:
                    query.reply(str(query.key_expr), lie)

        handler = zenoh.handlers.Callback(receive, indirect=False)
        offers = [f"{ROOT}/**", *(self.door.keys.control(what) for what in (ASK, CHALLENGE))]
        declare = self._session.declare_queryable
        declared: list[Any] = [declare(offer, handler, complete=True, allowed_origin=_OWN) for offer in offers]
        counts["offers"] += len(declared)
        time.sleep(FOR_S)
        for one in declared:
            one.undeclare()
        return counts

    def send_noise(self, dice: Draws) -> Counter[str]:
        """Publish noise under every key of the fleet."""
        return self._send([(dice.choice(*self._keys), noise(dice)) for _ in range(MESSAGES)])

    def send_changed(self, dice: Draws) -> Counter[str]:
        """Publish changed copies of what was heard, under its own key and under others."""
        heard = list(self._heard)
        if not heard:
            return self.listen(dice)
        picked = [dice.choice(*heard) for _ in range(MESSAGES)]
        return self._send([(dice.choice(key, *self._keys), changed(dice, payload)) for key, payload in picked])

    def replay(self, dice: Draws) -> Counter[str]:
        """Publish what was heard once more, as it was, under its own key and under others."""
        heard = list(self._heard)
        if not heard:
            return self.listen(dice)
        picked = [dice.choice(*heard) for _ in range(MESSAGES)]
        own = self._own_keys or self._keys
        return self._send([(dice.choice(key, *own), payload) for key, payload in picked])

    def forge(self, dice: Draws) -> Counter[str]:
        """Publish messages that a decoder takes, with something false in them."""
        robots = self.door.robots
        made = [forged(dice, self.door.keys, robots, self._newest) for _ in range(MESSAGES)]
        return self._send(made)

    def flood(self, dice: Draws) -> Counter[str]:
        """Publish as much as possible under one key, ahead of everything else."""
        key = dice.choice(*self._keys, *self._own_keys)
        payload = noise(dice, dice.choice(8, 1000, 50_000))
        counts: Counter[str] = Counter()
        until = time.monotonic() + FOR_S
        while time.monotonic() < until:
            counts += self._send([(key, payload)] * 50)
        return counts

    def send_huge(self, dice: Draws) -> Counter[str]:
        """Publish messages that together would take more memory than a process may, one in each queue."""
        counts: Counter[str] = Counter()
        for priority in _QUEUES:
            counts += self._send([(dice.choice(*self._keys, *self._own_keys), bytes(HUGE))], priority)
        return counts

    def ask(self, dice: Draws) -> Counter[str]:
        """Ask the world for everything, without the token."""
        keys = self.door.keys
        counts: Counter[str] = Counter()

        def receive(reply: zenoh.Reply) -> None:
            counts["answers"] += reply.ok is not None

        handler = zenoh.handlers.Callback(receive, indirect=False)
        asked = [keys.control(ASK), keys.control(CHALLENGE), keys.truth("fog"), keys.anything]
        for _ in range(QUESTIONS):
            payload = dice.choice(noise(dice, 16), noise(dice), bytes(16))
            self._session.get(dice.choice(*asked), handler, payload=payload, timeout=ANSWER_S)
            counts["questions"] += 1
        time.sleep(2.0 * ANSWER_S)
        return counts

    def pretend(self, dice: Draws) -> Counter[str]:
        """Declare and withdraw the liveliness tokens of everybody."""
        names = dice.shuffled([WORLD, *self.door.robots]) * 3
        tokens: list[Any] = [self._session.liveliness().declare_token(self.door.keys.alive(name)) for name in names]
        time.sleep(FOR_S / 2)
        for token in tokens:
            token.undeclare()
        return Counter({"tokens": len(tokens)})

    def stop_reading(self, dice: Draws) -> Counter[str]:
        """Subscribe to everything and then stand still, until whoever started this process lets it go on."""
        del dice
        with self._subscribed(["**", self.door.keys.anything], lambda _sample: None):
            os.kill(os.getpid(), signal.SIGSTOP)
        return Counter({"stops": 1})

    def impersonate(self, dice: Draws) -> Counter[str]:
        """Answer the world in the robot's name, faster than the robot if possible."""
        key = self.door.keys.reply(self.role.robot)
        reply: Any = self._session.declare_publisher(key, priority=_FIRST, express=True, congestion_control=_BLOCK)
        drive = Velocity(dice.between(-1.0, 1.0), dice.between(-1.0, 1.0))
        counts: Counter[str] = Counter()
        lock = threading.Lock()

        def receive(sample: zenoh.Sample) -> None:
            match self._note(sample.payload.to_bytes()):
                case PhaseA(incarnation, instance, k, run) as a:
                    empty = ReplyA(incarnation, instance, k, run, ())
                    answers: list[ReplyA | ReplyB] = [empty, forged_command(a, drive)]
                case PhaseB() as b:
                    answers = [forged_command(b, drive)]
                case _:
                    return
            with lock:
                for answer in answers:
                    reply.put(encode(answer))
                    counts["false answers"] += 1

        with self._subscribed([self.door.keys.tick(self.role.robot)], receive):
            time.sleep(FOR_S)
        reply.undeclare()
        return counts

    def farewell(self, dice: Draws) -> Counter[str]:
        """Say in the robot's name that it cannot go on."""
        if self._newest is None:
            return self.listen(dice)
        return self._send([(self.door.keys.reply(self.role.robot), encode(forged_farewell(self._newest)))])

    # --- how ---------------------------------------------------------------------------------------------------------

    @property
    def _own_keys(self) -> tuple[str, ...]:
        return rights_of(self.role, self.door.keys).publish

    def _note(self, payload: bytes) -> object:
        """The message to a robot that a payload is, or None; the newest phase A is kept."""
        try:
            message = decode_to_robot(payload)
        except Malformed:
            return None
        if isinstance(message, PhaseA):
            self._newest = message
        return message

    def _send(self, messages: list[tuple[str, bytes]], priority: zenoh.Priority = _FIRST) -> Counter[str]:
        for key, payload in messages:
            self._session.put(key, payload, priority=priority, express=True, congestion_control=_BLOCK)
        return Counter({"messages": len(messages), "bytes": sum(len(payload) for _, payload in messages)})

    @contextmanager
    def _subscribed(self, keys: list[str], receive: Callable[[zenoh.Sample], object]) -> Iterator[None]:
        handler = zenoh.handlers.Callback(receive, indirect=False)
        declare = self._session.declare_subscriber
        declared: list[Any] = [declare(key, handler, allowed_origin=_OWN) for key in keys]
        try:
            yield
        finally:
            for one in declared:
                one.undeclare()
