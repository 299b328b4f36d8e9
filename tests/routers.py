"""Routers on free ports, and worlds that are there as far as anybody can see."""

import json
import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import pytest

from fogwatch.fleets.folder import FleetFolder, make_fleet
from fogwatch.launch.private import Secrets
from runtime.net.link import Link, open_router
from runtime.net.mailbox import Mailbox
from runtime.net.open_links import open_links
from runtime.security.access import FILE
from runtime.security.credentials import Credentials, read_credentials, read_router
from runtime.security.keys import FleetKeys, fleet_keys
from runtime.security.private_files import write_private
from runtime.security.roles import role_of

PATIENCE_S = 300.0

needs_openssl = pytest.mark.skipif(
    shutil.which("openssl") is None and not os.environ.get("CI"), reason="the command openssl is not installed"
)
"""Tests of certificates; in CI they fail without it."""


def write_access(folder: Path, router: str, fleet: str = "fleet-1", token: str = "0123456789abcdef") -> None:
    """Write by hand how a fleet is reached and controlled, for a router that asks nobody."""
    write_private(folder / FILE, json.dumps({"fleet": fleet, "router": router, "token": token}))


_PORTS = count(97 * os.getpid())
"""Where each process of the tests looks for ports first, so that two of them do not find the same."""


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port of 127.0.0.1 that nobody uses, and that the system gives to nobody who asks it for any."""
    while True:
        port = 10_000 + next(_PORTS) % 20_000  # below those that systems hand out
        with socket.socket(type=kind) as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def free_endpoint() -> str:
    """Where a router can be."""
    return f"tcp/127.0.0.1:{free_port()}"


@contextmanager
def routed() -> Iterator[str]:
    """Where a router is."""
    where = free_endpoint()
    router = open_router(where)
    yield where
    assert router.close(PATIENCE_S)


def reach_patiently(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let whoever looks for a fleet have time to reach its router, however briefly it then waits for the world."""

    def patiently(router: str, radio: str | None, _wait_s: float, *more: Any) -> Any:
        return open_links(router, radio, PATIENCE_S, *more)

    monkeypatch.setattr("monitor.live.attach.open_links", patiently)


def take_messages(mailbox: Mailbox[bytes], count: int) -> list[tuple[str, bytes]]:
    """Wait for so many messages; fewer where no more come."""
    until = time.monotonic() + PATIENCE_S
    found: list[tuple[str, bytes]] = []
    while len(found) < count and time.monotonic() < until:
        if (arrived := mailbox.get(0.1)) is not None:
            found.append(arrived)
    return found


M = TypeVar("M")


def reach(post: Callable[[bytes], None], mailbox: Mailbox[M], payload: bytes = b"here") -> tuple[str, M]:
    """Send until something arrives, since a subscription takes a moment to be known; return what arrives."""
    end = time.monotonic() + PATIENCE_S
    while (arrived := mailbox.get(0.05)) is None:
        assert time.monotonic() < end, "nothing arrives"
        post(payload)
    return arrived


def await_last(mailbox: Mailbox[bytes], last: tuple[str, bytes]) -> set[str]:
    """Wait for a message; return the keys of all that arrive up to it."""
    keys = set()
    while (arrived := mailbox.get(PATIENCE_S)) != last:
        assert arrived is not None, f"never arrives: {last}"
        keys.add(arrived[0])
    return {*keys, last[0]}


def await_seen(link: Link, key: str) -> None:
    """Wait until a link sees a token."""
    end = time.monotonic() + PATIENCE_S
    while not link.sees(key):
        assert time.monotonic() < end, f"never seen: {key}"


@dataclass(frozen=True)
class Guarded:
    """A router that lets in the members of a fleet.

    Attributes:
        keys: The fleet's keys.
        router: The router's locator.
        credentials: Each member's, by `Role.user`.
    """

    keys: FleetKeys
    router: str
    credentials: Mapping[str, Credentials]


@contextmanager
def guarded_by_passwords(robots: Sequence[str]) -> Iterator[Guarded]:
    """A router like a launcher's."""
    secrets = Secrets("f", robots)
    where = free_endpoint()
    router = open_router(where, read_router(secrets.for_router(where), "test"))
    try:
        secrets.for_members(where)
        files = list(secrets.path.glob("*.json"))
        yield Guarded(fleet_keys("f"), where, {file.stem: read_credentials(file, "test") for file in files})
    finally:
        assert router.close(PATIENCE_S)
        secrets.remove()


@contextmanager
def guarded_by_certificates(fleet: FleetFolder) -> Iterator[Guarded]:
    """A router of a fleet of several machines."""
    router = open_router(fleet.listen, read_router(fleet.path, "test"))
    try:
        roles = [role_of(user, "test") for user in fleet.members]
        credentials = {role.user: read_credentials(fleet.path / role.name, "test") for role in roles}
        yield Guarded(fleet_keys(fleet.fleet), fleet.router, credentials)
    finally:
        assert router.close(PATIENCE_S)


def make_local_fleet(folder: Path, robots: Sequence[str], days: int = 1) -> FleetFolder:
    """A fleet with certificates whose router is on this machine, on a free port."""
    return make_fleet(folder, "f", robots, [], free_port(), days)
