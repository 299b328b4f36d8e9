"""Routers on free ports, and worlds that are there as far as anybody can see."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from patrol.net.keys import WORLD, fleet_keys
from patrol.net.link import open_link, open_router

PATIENCE_S = 120.0


def free_endpoint() -> str:
    """Where a router can be."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def routed() -> Iterator[str]:
    """Where a router is."""
    where = free_endpoint()
    router = open_router(where)
    yield where
    assert router.close(PATIENCE_S)


@contextmanager
def world_seen(endpoint: str, fleet: str) -> Iterator[None]:
    """The token of a fleet's world at a router, which others see by now."""
    alive = fleet_keys(fleet).alive(WORLD)
    world, other = open_link(endpoint, PATIENCE_S), open_link(endpoint, PATIENCE_S)
    try:
        world.live(alive)
        assert any(other.sees(alive) for _ in range(1000))
        yield
    finally:
        assert other.close(PATIENCE_S)
        assert world.close(PATIENCE_S)
