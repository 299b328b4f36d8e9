"""A member of the network that lies: it can connect, read everything, publish and answer under any key."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import pytest
import zenoh

from patrol.net.access import Access
from patrol.net.keys import FleetKeys, fleet_keys
from patrol.net.link import LEASE_S, client_config
from patrol.net.phases import Hello, PhaseA, PhaseB, ReplyB, decode_to_robot, decode_to_world

PATIENCE_S = 300.0
_KEPT = 10_000

M = TypeVar("M")


def connect(access: Access) -> zenoh.Session:
    """A session with a fleet's router, of somebody who may connect but does not know the fleet's token."""
    return zenoh.open(client_config(access.router, LEASE_S))


class Attacker:
    """Somebody on a fleet's network.

    Attributes:
        keys: The fleet's keys.
        heard: What was read along, as key and payload.
        asked: The questions that reached its queryable, as key and payload.
    """

    def __init__(self, access: Access) -> None:
        self.keys: FleetKeys = fleet_keys(access.fleet)
        self.heard: deque[tuple[str, bytes]] = deque(maxlen=_KEPT)
        self.asked: deque[tuple[str, bytes]] = deque(maxlen=_KEPT)
        self._session = connect(access)
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
        self._session.close()  # type: ignore[no-untyped-call]

    def send(self, key: str, payload: bytes) -> None:
        """Publish ahead of everything else, and wait where a queue is full."""
        self._session.put(
            key,
            payload,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    def listen(self, then: Callable[[str, bytes], None] = lambda _key, _payload: None) -> None:
        """Read everything that the fleet publishes.

        Args:
            then: Called with each message, on a thread of its own.
        """
        channel: zenoh.handlers.FifoChannel[zenoh.Sample] = zenoh.handlers.FifoChannel(_KEPT)
        subscriber = self._session.declare_subscriber(f"fogwatch/{self.keys.fleet}/**", channel)
        self._declared.append(subscriber)

        def read() -> None:
            while not self._over.wait(0.0005):
                while (sample := subscriber.try_recv()) is not None:
                    key, payload = str(sample.key_expr), sample.payload.to_bytes()
                    self.heard.append((key, payload))
                    then(key, payload)

        self._thread(read)

    def repeat(self, messages: Sequence[tuple[str, bytes]], every_s: float = 0.002) -> None:
        """Publish messages over and over until the end."""

        def send() -> None:
            while not self._over.wait(every_s):
                for key, payload in messages:
                    self.send(key, payload)

        self._thread(send)

    def answer_everything(self, answers: Sequence[bytes]) -> None:
        """Answer every question to the fleet with all of these."""

        def receive(query: zenoh.Query) -> None:
            payload = query.payload
            self.asked.append((str(query.key_expr), b"" if payload is None else payload.to_bytes()))
            with query:
                for answer in answers:
                    query.reply(str(query.key_expr), answer)

        self._declared.append(self._session.declare_queryable("fogwatch/**", receive, complete=True))

    def ask(self, key: str, payload: bytes) -> list[bytes]:
        """All answers to a question."""
        replies = self._session.get(key, payload=payload, timeout=30.0, target=zenoh.QueryTarget.ALL)
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]

    def pretend_to_live(self, robot: str) -> None:
        """Declare a robot's liveliness token."""
        self._declared.append(self._session.liveliness().declare_token(self.keys.alive(robot)))

    # --- what was read along -----------------------------------------------------------------------------------------

    def newest_phase_a(self, robot: str) -> PhaseA:
        """The newest phase A of a robot, awaited."""
        return self._newest(self.keys.tick(robot), decode_to_robot, PhaseA)

    def newest_phase_b(self, robot: str) -> PhaseB:
        """The newest phase B of a robot, awaited."""
        return self._newest(self.keys.tick(robot), decode_to_robot, PhaseB)

    def newest_reply_b(self, robot: str) -> ReplyB:
        """The newest command of a robot, awaited."""
        return self._newest(self.keys.reply(robot), decode_to_world, ReplyB)

    def newest_hello(self, robot: str) -> Hello:
        """The newest greeting of a robot, awaited."""
        return self._newest(self.keys.tick(robot), decode_to_robot, Hello)

    def _newest(self, key: str, decode: Callable[[bytes], object], kind: type[M]) -> M:
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            for heard, payload in reversed(list(self.heard)):
                if heard == key and isinstance(message := decode(payload), kind):
                    return message
            time.sleep(0.01)
        pytest.fail(f"no {kind.__name__} was heard under {key}")

    def _thread(self, work: Callable[[], None]) -> None:
        self._threads.append(threading.Thread(target=work, daemon=True))
        self._threads[-1].start()


@contextmanager
def attacking(access: Access) -> Iterator[Attacker]:
    """Somebody who is on a fleet's network for a while."""
    attacker = Attacker(access)
    try:
        yield attacker
    finally:
        attacker.close()
