"""Messages to the systemd that started a process: that it is ready, and that its loop still turns.

The service manager names a datagram socket in the environment, and in a unit with `WatchdogSec=` also how long it waits
for the next sign of life before it restarts the process. A sign of life comes from the loop that does the work, never
from a thread of its own: a thread would go on telling that all is well while the loop hangs.
"""

from __future__ import annotations

import math
import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

SOCKET, WATCHDOG_US, WATCHDOG_PID = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"
"""Variables of the environment that the service manager sets."""


class Notifier:
    """Tells the service manager that the process is ready and alive; does nothing where no manager asks for it."""

    def __init__(self, environment: Mapping[str, str], now: Callable[[], float] = time.monotonic) -> None:
        name = environment.get(SOCKET, "")
        self._address = f"\0{name[1:]}" if name.startswith("@") else name
        microseconds = environment.get(WATCHDOG_US, "")
        is_ours = environment.get(WATCHDOG_PID, str(os.getpid())) == str(os.getpid())
        self._every_s = int(microseconds) / 1e6 / 4 if is_ours and microseconds.isdecimal() else None
        self._now = now
        self._due = -math.inf
        self._ready = False

    def alive(self) -> None:
        """Tell that the loop turns, the first time that the process is ready; called in each round of the loop.

        It sends four times within the manager's patience, however often it is called.
        """
        if not self._ready:
            self._ready = True
            self._send(b"READY=1")
        if self._every_s is not None and (now := self._now()) >= self._due:
            self._due = now + self._every_s
            self._send(b"WATCHDOG=1")

    def busy(self, limit_s: float) -> None:
        """Ask for patience, since the loop is over and long work follows."""
        if self._every_s is not None:
            self._send(b"WATCHDOG_USEC=%d" % round(limit_s * 1e6))

    def _send(self, message: bytes) -> None:
        if not self._address:
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as own:
            own.setblocking(False)  # a manager that does not read holds up no loop
            own.sendto(message, self._address)
