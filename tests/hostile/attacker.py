"""A member of the network that lies: it has every role's password, so it can read, publish and answer as anybody.

The router keeps out whoever has none, and holds each role to its own keys. So this is who is left when all passwords
have got out, and only the operators' token has not.
"""

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import zenoh

from patrol.scenario import load_scenario
from runtime.messages.phases import PhaseA, decode_to_robot
from runtime.net.link import LEASE_S
from runtime.net.settings import client_settings
from runtime.security.access import credentials_at
from runtime.security.keys import FleetKeys, fleet_keys
from runtime.security.roles import OPERATOR, WORLD_ROLE, Rights, Role, rights_of, robot_role

PATIENCE_S = 300.0
_KEPT = 10_000


def connect(folder: Path, role: Role) -> zenoh.Session:
    """A session with a run's router, of somebody who has a role's password."""
    credentials = credentials_at(folder, "test", role)
    config = zenoh.Config()
    for key, value in client_settings(credentials.router, LEASE_S, credentials).items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


class Attacker:
    """Somebody on a fleet's network."""

    def __init__(self, folder: Path) -> None:
        robots = [robot_role(spec.name) for spec in load_scenario(folder / "scenario.yaml").roster]
        self.keys: FleetKeys = fleet_keys(credentials_at(folder, "test", WORLD_ROLE).fleet)
        self._sessions = {role: connect(folder, role) for role in (WORLD_ROLE, OPERATOR, *robots)}
        self._rights: dict[Role, Rights] = {role: rights_of(role, self.keys) for role in self._sessions}
        self.heard: deque[tuple[str, bytes]] = deque(maxlen=_KEPT)
        self.asked: deque[tuple[str, bytes]] = deque(maxlen=_KEPT)
        self._declared: list[Any] = []
        self._threads: list[threading.Thread] = []
        self._over = threading.Event()

    def close(self) -> None:
        """Leave the network."""
        self._over.set()
        for thread in self._threads:
            thread.join()
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        for session in self._sessions.values():
            session.close()  # type: ignore[no-untyped-call]

    def send(self, key: str, payload: bytes) -> None:
        """Publish as whoever may, ahead of everything else, and wait where a queue is full."""
        block, first = zenoh.CongestionControl.BLOCK, zenoh.Priority.REAL_TIME
        self._who(key, "publish").put(key, payload, priority=first, express=True, congestion_control=block)

    def listen(self) -> None:
        """Read everything that the fleet publishes, on a thread of its own."""
        expressions = {key: role for role, rights in self._rights.items() for key in rights.hear}
        declared = [
            self._sessions[role].declare_subscriber(key, zenoh.handlers.FifoChannel(_KEPT))
            for key, role in expressions.items()
        ]
        self._declared += declared

        def read() -> None:
            while not self._over.wait(0.0005):
                for subscriber in declared:
                    while (sample := subscriber.try_recv()) is not None:
                        self.heard.append((str(sample.key_expr), sample.payload.to_bytes()))

        self._thread(read)

    def repeat(self, messages: Sequence[tuple[str, bytes]], every_s: float = 0.002) -> Callable[[], None]:
        """Publish messages over and over, until the end or until what this returns is called."""
        enough = threading.Event()

        def send() -> None:
            while not self._over.is_set() and not enough.wait(every_s):
                for key, payload in messages:
                    self.send(key, payload)

        self._thread(send)
        return enough.set

    def answer_everything(self, answers: Sequence[bytes]) -> None:
        """Answer every question to the fleet with all of these."""

        def receive(query: zenoh.Query) -> None:
            payload = query.payload
            self.asked.append((str(query.key_expr), b"" if payload is None else payload.to_bytes()))
            with query:
                for answer in answers:
                    query.reply(str(query.key_expr), answer)

        for expression in self._rights[WORLD_ROLE].answer:
            queryable = self._sessions[WORLD_ROLE].declare_queryable(expression, receive, complete=True)
            self._declared.append(queryable)

    def ask(self, key: str, payload: bytes) -> list[bytes]:
        """All answers to a question."""
        replies = self._who(key, "ask").get(key, payload=payload, timeout=30.0, target=zenoh.QueryTarget.ALL)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def sees(self, robot: str) -> bool:
        """Return True if the router knows a robot's liveliness token."""
        replies = self._sessions[WORLD_ROLE].liveliness().get(self.keys.alive(robot), timeout=PATIENCE_S)
        return any(reply.ok is not None for reply in replies)

    # --- what was read along -----------------------------------------------------------------------------------------

    def phases_a(self, robot: str, k: int) -> int:
        """Count how often phase A of a tick was sent to a robot."""
        sent = [decode_to_robot(payload) for key, payload in list(self.heard) if key == self.keys.tick(robot)]
        return sum(isinstance(message, PhaseA) and message.k == k for message in sent)

    def newest_phase_a(self, robot: str) -> PhaseA:
        """The newest phase A of a robot, awaited."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            for key, payload in reversed(list(self.heard)):
                if key == self.keys.tick(robot) and isinstance(message := decode_to_robot(payload), PhaseA):
                    return message
            time.sleep(0.01)
        pytest.fail(f"no phase A of {robot} was heard")

    def _who(self, key: str, right: str) -> zenoh.Session:
        """The session of whoever may publish under a key, or ask it."""
        for role, rights in self._rights.items():
            if any(zenoh.KeyExpr(wide).includes(key) for wide in getattr(rights, right)):
                return self._sessions[role]
        pytest.fail(f"nobody may {right} {key}")

    def _thread(self, work: Callable[[], None]) -> None:
        self._threads.append(threading.Thread(target=work, daemon=True))
        self._threads[-1].start()
