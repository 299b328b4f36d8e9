"""The figures that show how a process does, for its health lines and its metrics.

A process's loop leaves its figures after each tick (`Vitals.beat`); it never waits for readers. What no
loop can leave, because it is of interest when the loop hangs, is read by the reader (`Vitals.probe`).
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from runtime.net.mailbox import Mailbox

Value = float | Mapping[str, float]
"""A number or, for a figure that has a label, numbers by the label's value."""


class Kind(StrEnum):
    """The behaviour of a figure over time."""

    GAUGE = "gauge"
    COUNTER = "counter"


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a process."""

    name: str  # as Prometheus knows it; counters end with ``_total``
    kind: Kind
    says: str  # one line, with the unit
    label: str = ""  # what its numbers are told apart by; empty for one number


TICK = Figure("fogwatch_tick", Kind.GAUGE, "The newest tick that the process has done or shown.")
TICKS = Figure("fogwatch_ticks_total", Kind.COUNTER, "Ticks that this process has done.")
SINCE_TICK = Figure("fogwatch_seconds_since_tick", Kind.GAUGE, "Time since the process has last done a tick, s.")
PEERS = Figure("fogwatch_peers_heard", Kind.GAUGE, "Other robots that the robot has heard lately.")
REFUSED = Figure("fogwatch_frames_refused_total", Kind.COUNTER, "Position frames that the robot refused.", "reason")
DROPPED = Figure("fogwatch_messages_dropped_total", Kind.COUNTER, "Messages dropped on arrival or unread.", "reason")
QUEUE = Figure("fogwatch_messages_waiting", Kind.GAUGE, "Messages that have arrived and wait to be read.")
DECISION = Figure("fogwatch_decision_seconds", Kind.GAUGE, "Wall time of the robot's last decision, s.")
DECIDING = Figure("fogwatch_decision_seconds_total", Kind.COUNTER, "Wall time of all of the robot's decisions, s.")
MFOW = Figure("fogwatch_mfow_seconds", Kind.GAUGE, "Age of the stalest point, as this process knows it, s.")
ROBOTS = Figure("fogwatch_robots", Kind.GAUGE, "Robots of the roster, by what has become of them.", "status")
ROUTER_SILENT = Figure("fogwatch_router_silent_seconds_total", Kind.COUNTER, "Time without an answer of the router, s.")
ODOMETRY_AGE = Figure("fogwatch_odometry_age_seconds", Kind.GAUGE, "Time since odometry has come from the robot, s.")
STOPPED = Figure("fogwatch_stopped", Kind.GAUGE, "1 while somebody or something keeps the robot from driving, else 0.")
UNUSABLE = Figure("fogwatch_robot_messages_refused_total", Kind.COUNTER, "Messages of the robot of no use.", "reason")
COMMANDS = Figure("fogwatch_commands_total", Kind.COUNTER, "Commands that a simulated robot has received.", "robot")
CONNECTIONS = Figure("fogwatch_connections", Kind.GAUGE, "Processes, or members of a mesh, that are connected.")
PAGES = Figure("fogwatch_pages_open", Kind.GAUGE, "Browsers that show the page.")
VERSION = Figure("fogwatch_info", Kind.GAUGE, "1; the label names the version.", "version")
MEMORY = Figure("process_resident_memory_bytes", Kind.GAUGE, "Resident memory, bytes.")
PROCESSOR = Figure("process_cpu_seconds_total", Kind.COUNTER, "Processor time, s.")
STARTED = Figure("process_start_time_seconds", Kind.GAUGE, "When the process began to count its figures, Unix time, s.")
FILES = Figure("process_open_fds", Kind.GAUGE, "Open file descriptors.")
THREADS = Figure("process_threads", Kind.GAUGE, "Threads that Python knows of.")


@dataclass(frozen=True, slots=True)
class _Beat:
    """The figures of the loop after its newest tick."""

    ticks: int
    at: float
    figures: Mapping[Figure, Value]


class Vitals:
    """The figures of this process. One loop leaves them; any thread may read them."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        """Count from now on."""
        self._now = now
        self._began = time.time()
        self._version = version()
        self._beat: _Beat | None = None
        self._probes: list[tuple[Figure, Callable[[], Value | None]]] = []

    def beat(self, k: int, figures: Mapping[Figure, Value]) -> None:
        """Leave the figures of a tick that has been done; nothing may change the mapping afterwards."""
        ticks = 1 if self._beat is None else self._beat.ticks + 1
        self._beat = _Beat(ticks, self._now(), {TICK: k, **figures})

    def probe(self, figure: Figure, read: Callable[[], Value | None]) -> None:
        """Have a figure that the loop does not leave read for each request.

        `read` is called on any thread and returns at once, None while the figure is not known. Where a figure is read
        in several places, the numbers are added.
        """
        self._probes.append((figure, read))

    def probe_mailbox(self, mailbox: Mailbox[Any]) -> None:
        """Have a mailbox's figures read for each request."""
        self.probe(QUEUE, lambda: mailbox.waiting)
        self.probe(DROPPED, lambda: dict(mailbox.refused))

    def read(self) -> dict[Figure, Value]:
        """Read all figures that are known now."""
        figures: dict[Figure, Value] = {}
        # Read once: the loop may replace it meanwhile, and all of its figures belong together.
        beat = self._beat
        if beat is not None:
            figures |= beat.figures
            figures |= {TICKS: beat.ticks, SINCE_TICK: self._now() - beat.at}
        for figure, read in list(self._probes):
            with suppress(Exception):  # what it is read from may be closing; the others still count
                if (value := read()) is not None:
                    figures[figure] = _add_values(figures.get(figure), value)
        return figures | self._of_the_process()

    def _of_the_process(self) -> dict[Figure, Value]:
        figures: dict[Figure, Value] = {
            VERSION: {self._version: 1},
            STARTED: self._began,
            PROCESSOR: time.process_time(),
            THREADS: threading.active_count(),
        }
        with suppress(OSError, ValueError, LookupError):  # only Linux shows these
            figures[MEMORY] = _resident_bytes()
            figures[FILES] = sum(1 for _ in Path("/proc/self/fd").iterdir())
        return figures


def version() -> str:
    """Return the installed version of fogwatch; "unknown" where it runs from a folder of sources."""
    try:
        return metadata.version("fogwatch")
    except metadata.PackageNotFoundError:
        return "unknown"


def _add_values(before: Value | None, now: Value) -> Value:
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        return {label: before.get(label, 0) + now.get(label, 0) for label in {**before, **now}}
    if before is None or isinstance(before, Mapping) or isinstance(now, Mapping):
        return now
    return before + now


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
