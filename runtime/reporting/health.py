"""Health lines: how a process does, in its log, every so many seconds.

They come from a thread of their own, so they go on while the process's loop hangs, and then say for how long it has
done no tick.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from runtime.reporting import vitals
from runtime.reporting.logs import Log
from runtime.reporting.vitals import QUEUE, TICK, Figure, Value, Vitals

Figures = Mapping[Figure, Value]


@dataclass(frozen=True, slots=True)
class HealthReading:
    """The figures at one time."""

    at: float  # of a clock that never goes back, s
    figures: Figures  # all that are known


def health_line(now: HealthReading, before: HealthReading | None) -> str:
    """Write a health line for people."""
    figures = now.figures
    parts = _tick_texts(now, before) + [
        phrase(figures[figure]) for figure, phrase in _TOLD.items() if figure in figures
    ]
    return f"health: {', '.join(parts)}"


def _tick_texts(now: HealthReading, before: HealthReading | None) -> list[str]:
    """Write the newest tick and the ticks per second; before the first tick, that there is none."""
    if TICK not in now.figures:
        return ["no tick yet"] if QUEUE in now.figures else []
    tick: Any = now.figures[TICK]
    parts = [f"tick {tick:.0f}"]
    # A rate needs two readings with a tick in each.
    if before is not None and TICK in before.figures and now.at > before.at:
        parts.append(f"{(tick - before.figures[TICK]) / (now.at - before.at):.1f} ticks/s")
    return parts


def _list_counts(counts: Mapping[str, float]) -> str:
    return " and ".join(f"{number:.0f} {label}" for label, number in counts.items() if number) or "none"


_TOLD: Mapping[Figure, Callable[[Any], str]] = {
    vitals.SINCE_TICK: "last one {:.1f} s ago".format,
    vitals.MFOW: "MFoW {:.0f} s".format,
    vitals.ROBOTS: lambda counts: f"robots: {_list_counts(counts)}",
    vitals.PEERS: "peers heard: {:.0f}".format,
    vitals.REFUSED: lambda counts: f"frames refused: {_list_counts(counts)}",
    vitals.DROPPED: lambda counts: f"messages dropped: {_list_counts(counts)}",
    QUEUE: "messages waiting: {:.0f}".format,
    vitals.DECISION: lambda seconds: f"decision {1000.0 * seconds:.1f} ms",
    vitals.ROUTER_SILENT: "router silent for {:.0f} s in all".format,
    vitals.STOPPED: lambda is_stopped: "stopped" if is_stopped else "may drive",
    vitals.ODOMETRY_AGE: "odometry {:.1f} s ago".format,
    vitals.UNUSABLE: lambda counts: f"robot's messages refused: {_list_counts(counts)}",
    vitals.COMMANDS: lambda counts: f"commands received: {_list_counts(counts)}",
    vitals.CONNECTIONS: "connections: {:.0f}".format,
    vitals.PAGES: "pages open: {:.0f}".format,
    vitals.MEMORY: lambda size: f"{size / 1e6:.0f} MB",
}
"""Text of each figure in a health line, in the line's order."""


def facts_of(figures: Figures) -> dict[str, object]:
    """Return all figures, for a JSON line, by the names that the metrics have."""
    return {figure.name: _as_fact(value) for figure, value in figures.items()}


def _as_fact(value: Value) -> object:
    """Convert a number or numbers to JSON, which has only finite ones."""
    if isinstance(value, Mapping):
        return {label: _as_fact(number) for label, number in value.items()}
    return value if math.isfinite(value) else None


class HealthLines:
    """Writes a health line every so often, from now until `close`."""

    def __init__(self, vitals: Vitals, log: Log, every_s: float) -> None:
        """Begin to write, on a thread of its own."""
        self._vitals = vitals
        self._log = log
        self._every_s = every_s
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._write_lines, name="health", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Write no more lines."""
        self._ending.set()
        self._thread.join()

    def _write_lines(self) -> None:
        before: HealthReading | None = None
        while not self._ending.wait(self._every_s):
            now = HealthReading(time.monotonic(), self._vitals.read())
            self._log.info(health_line(now, before), health=facts_of(now.figures))
            before = now
