"""Attacks of somebody who holds no secret: a router's port, and what can be done to it without getting in."""

import json
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace

import zenoh

from patrol.random import Draws
from runtime.net.link import LEASE_S
from runtime.net.settings import client_settings
from runtime.security.credentials import Credentials
from runtime.security.keys import FleetKeys
from runtime.security.roles import OPERATOR, VIEWER, WORLD_ROLE, robot_role
from tests.hostile.strangers.payloads import changed, noise

CONNECTIONS = 200
"""Raw connections of one attack."""
REFUSED_S = 1.0
"""How long a stranger waits to be let in."""
HELD_S = 1.5
"""How long raw connections stay."""
LET_IN = "let in"
"""The count of sessions that a router should not have opened."""


@dataclass(frozen=True, slots=True)
class Door:
    """A fleet's router, as it looks from outside."""

    router: str
    keys: FleetKeys
    robots: tuple[str, ...]

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        host, _, port = self.router.partition("/")[2].rpartition(":")
        return host, int(port)

    def enter(self, credentials: Credentials | None, wait_s: float = REFUSED_S) -> zenoh.Session | None:
        """Open a session; None where it is not let in."""
        settings = client_settings(self.router, LEASE_S, credentials)
        config = zenoh.Config()
        for key, value in {**settings, "connect/timeout_ms": round(wait_s * 1000)}.items():
            config.insert_json5(key, json.dumps(value))
        config.insert_json5("connect/exit_on_failure", "true")
        try:
            return zenoh.open(config)
        except zenoh.ZError:
            return None


def knock(door: Door, dice: Draws) -> Counter[str]:
    """Ask to be let in with no password, and with wrong ones in the members' names."""
    role = dice.choice(WORLD_ROLE, OPERATOR, VIEWER, *map(robot_role, door.robots))
    wrong = Credentials(door.keys.fleet, door.router, role, noise(dice, 16).hex())
    counts: Counter[str] = Counter()
    for credentials in (None, wrong, replace(wrong, password="0")):
        counts["asked to be let in"] += 1
        session = door.enter(credentials)
        if session is not None:
            counts[LET_IN] += 1
            session.close()  # type: ignore[no-untyped-call]
    return counts


def send_noise(door: Door, dice: Draws) -> Counter[str]:
    """Open connections and send noise on each."""
    return _on_connections(door, [noise(dice) for _ in range(CONNECTIONS)])


def say_nothing(door: Door, dice: Draws) -> Counter[str]:
    """Open connections and leave them silent."""
    del dice
    return _on_connections(door, CONNECTIONS * [b""])


def begin_well(door: Door, dice: Draws) -> Counter[str]:
    """Open connections and send the beginning of a real one on each, cut off or changed."""
    with _overheard_beginning(door) as beginning:
        given = beginning
    cut = (given[: dice.whole(0, len(given))] for _ in range(CONNECTIONS // 2))
    return _on_connections(door, [*cut, *(changed(dice, given) for _ in range(CONNECTIONS // 2))])


def _on_connections(door: Door, payloads: list[bytes]) -> Counter[str]:
    counts: Counter[str] = Counter()
    with ExitStack() as stack:
        for payload in payloads:
            with suppress(OSError):
                connection = stack.enter_context(socket.create_connection(door.address, REFUSED_S))
                counts["connections"] += 1
                connection.settimeout(REFUSED_S)
                connection.sendall(payload)
                counts["bytes"] += len(payload)
        time.sleep(HELD_S)
    return counts


@contextmanager
def _overheard_beginning(door: Door) -> Iterator[bytes]:
    """Return the first words of a client, heard by listening in a router's place."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(REFUSED_S)
        port = server.getsockname()[1]
        mine = replace(door, router=f"tcp/127.0.0.1:{port}")
        client = threading.Thread(target=mine.enter, args=(None,), daemon=True)
        client.start()
        heard = b""
        with suppress(OSError):
            connection = server.accept()[0]
            with connection:
                connection.settimeout(REFUSED_S)
                heard = connection.recv(1 << 16)
    client.join()
    yield heard
