"""Ticks of a run per second of wall time."""

from __future__ import annotations

from collections import deque

WINDOW_S = 3.0
"""Wall time over which the rate is taken, s."""
SAMPLE_S = 0.1
"""Least wall time between two samples, s."""


class TickRate:
    """The rate of ticks over the last `WINDOW_S`. Times are s of any clock."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, int]] = deque()

    def clear(self) -> None:
        """Forget all ticks: what comes next has another rate."""
        self._samples.clear()

    def add(self, now_s: float, k: int) -> None:
        """Take in a tick."""
        if not self._samples or now_s >= self._samples[-1][0] + SAMPLE_S:
            self._samples.append((now_s, k))

    def at(self, now_s: float, k: int) -> float:
        """Return the ticks per second of wall time; 0 without ticks."""
        while len(self._samples) > 2 and self._samples[1][0] <= now_s - WINDOW_S:
            self._samples.popleft()
        if not self._samples:
            return 0.0
        since, before = self._samples[0]
        return (k - before) / (now_s - since) if now_s > since else 0.0
