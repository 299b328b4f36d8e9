"""A free port for the run's own router."""

from __future__ import annotations

import socket


def free_port() -> int:
    """Find a TCP port of 127.0.0.1 at which no process listens now; one may before it is used."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
