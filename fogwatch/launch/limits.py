"""The limits of this machine: memory and open files for a fleet of processes, and a free port."""

from __future__ import annotations

import os
import socket

from patrol.errors import BadInput
from patrol.process.failures import LEAST, allow_files


def free_port() -> int:
    """Find a TCP port of 127.0.0.1 at which no process listens now; one may before it is used."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


PROCESS_GB = 0.15
"""Memory of one agent's process, GB."""


def check_limits(robots: int, spares: int) -> None:
    """Refuse a fleet of processes beyond the machine's memory or the account's limit of open files.

    The router has most files open: a connection for each robot, and those of the world and of all who watch. The
    `spares` are among the `robots`; they are absent at first.
    """
    needed_gb = (robots - spares) * PROCESS_GB
    there_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    if needed_gb > there_gb:
        raise BadInput(
            f"{robots - spares} robots as processes need about {needed_gb:.0f} GB of memory, and this machine has "
            f"{there_gb:.0f} GB; use --in-process or fewer robots"
        )
    allow_files(LEAST + 2 * robots, f"a fleet of {robots} robots as processes")
