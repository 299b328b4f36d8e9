"""The options by which a process is followed from outside: its log, its health lines and its metrics.

Messages to the systemd that started a process: that it is ready, and that its loop still turns.

The service manager names a datagram socket in the environment, and in a unit with `WatchdogSec=` also how long it waits
for the next sign of life before it restarts the process. A sign of life comes from the loop that does the work, never
from a thread of its own: a thread would go on telling that all is well while the loop hangs.
"""

from __future__ import annotations

import argparse
import math
import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from patrol.errors import BadInput
from runtime.reporting.logs import LEVELS, Format

OPTION, OPEN_OPTION = "--metrics", "--metrics-open"

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
        """Tell that the loop turns, the first time that the process is ready; called in each turn of the loop.

        It sends four times within the manager's patience, however often it is called.
        """
        if not self._ready:
            self._ready = True
            self._send_message(b"READY=1")
        if self._every_s is not None and (now := self._now()) >= self._due:
            self._due = now + self._every_s
            self._send_message(b"WATCHDOG=1")

    def busy(self, limit_s: float) -> None:
        """Ask for patience, since the loop is over and long work follows."""
        if self._every_s is not None:
            self._send_message(b"WATCHDOG_USEC=%d" % round(limit_s * 1e6))

    def _send_message(self, message: bytes) -> None:
        if not self._address:
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.setblocking(False)  # a manager that does not read holds up no loop
            sender.sendto(message, self._address)


LEAST_S, MOST_S = 0.1, 86_400.0
"""Time between two health lines, s."""


@dataclass(frozen=True, slots=True)
class Supervision:
    """Settings for following a process."""

    log_format: Format = Format.TEXT
    log_level: str = "info"  # the least that is written
    health: float | None = None  # s between two health lines; None for none
    metrics: str | None = None  # ``HOST:PORT``; None for none
    metrics_open: bool = False  # other machines may read them

    @property
    def counts(self) -> bool:
        """True if each tick's figures are wanted."""
        return self.health is not None or self.metrics is not None or self.log_level == "debug"


def add_supervision(parser: argparse.ArgumentParser) -> None:
    """Add the options of a process that can be followed."""
    add = parser.add_argument_group("what others see of this process (docs/operations.md)").add_argument
    add("--log-format", type=Format, choices=[*Format], default=Format.TEXT, help="of the log (%(default)s)")
    add("--log-level", choices=LEVELS, default="info", help="the least level in the log (%(default)s)")
    add("--health", type=float, metavar="S", help="a line about how this process does, every S seconds")
    add(OPTION, metavar="HOST:PORT", help="answer with metrics for Prometheus at http://HOST:PORT/metrics")
    add(OPEN_OPTION, action="store_true", help=f"allow a host for {OPTION} that other machines can reach")


def take_supervision(options: argparse.Namespace) -> Supervision:
    """Take what `add_supervision` added out of parsed options, which lose these fields.

    A process without these options is not followed.
    """
    names = ("log_format", "log_level", "health", "metrics", "metrics_open")
    supervision = Supervision(**{name: vars(options).pop(name) for name in names if name in options})
    every_s = supervision.health
    if every_s is not None and not (math.isfinite(every_s) and LEAST_S <= every_s <= MOST_S):
        raise BadInput(f"--health {every_s:g}: give from {LEAST_S:g} to {MOST_S:g} seconds")
    if supervision.metrics_open and supervision.metrics is None:
        raise BadInput(f"{OPEN_OPTION}: means nothing without {OPTION}; give both, or neither")
    return supervision
