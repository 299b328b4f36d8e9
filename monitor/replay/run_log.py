"""The links and the trapped robots at any tick of a run. Its journal is read once, in slices, while a page shows it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from monitor.observation.link_counts import LinkLog
from monitor.observation.traps import TrapWatch
from monitor.replay.replay import Replay

if TYPE_CHECKING:
    from monitor.observation.source import Trapped
    from monitor.replay.run import Run
    from patrol.journal.records import Event, TickRecord

BUDGET_S = 0.02
"""Wall time for reading the journal in one call, s."""

MEMORY = 16 << 20
"""Bytes for the fog's snapshots; the fog is read forwards only."""

_STRIDE = 32
"""Ticks by which the fog advances between two looks at the clock."""


class RunLog:
    """The trapped robots by tick, the `events` that say so, and `links`, the frame counts of each link by tick."""

    def __init__(self, run: Run, now: Callable[[], float] = time.monotonic) -> None:
        """Start with nothing read."""
        self._run = run
        self._now = now
        self._replay = Replay(run, MEMORY)
        self._fog_k = -1
        self._records = iter(run.journal.ticks)
        self._next: TickRecord | None = next(self._records, None)
        self._watch = TrapWatch(run.prepared)
        self.links = LinkLog(run.index)
        self._ticks = 0
        self._changes: list[tuple[int, dict[int, Trapped]]] = [(0, {})]
        self.events: list[Event] = []

    @property
    def done(self) -> bool:
        """True if the whole journal is read."""
        return self._next is None

    def at(self, k: int) -> dict[int, Trapped] | None:
        """Return the robots that were trapped at tick k, by number; None while the journal is not read that far."""
        if self._ticks <= k and not self.done:
            return None
        return next(trapped for first, trapped in reversed(self._changes) if first <= k)

    def read(self) -> None:
        """Read on for about `BUDGET_S`."""
        until = self._now() + BUDGET_S
        while self._next is not None:
            if self._fog_ready(self._next.k):
                self._take_tick(self._next)
                self._next = next(self._records, None)
            if self._now() > until:
                return

    def _fog_ready(self, k: int) -> bool:
        """Advance the fog towards tick k, where it may be needed; whether it has arrived."""
        if not self._watch.needs_fog(k):
            return True
        # In strides: one long replay of the fog would keep the page waiting.
        self._fog_k = min(max(self._fog_k, 0) + _STRIDE, k)
        self._replay.fog(self._fog_k)
        return self._fog_k == k

    def _take_tick(self, record: TickRecord) -> None:
        self.links.tick(record)
        events = self._watch.tick(record, lambda: self._replay.fog(record.k).last_seen, self._run.closings)
        self._ticks = record.k + 1
        self.events += events
        if events:
            self._changes.append((record.k, self._watch.open))
