"""Others' work while a benchmark runs: what the machine's cores did, less what the benchmark itself did."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

from experiments.bench.tools.measure import Unmeasured
from experiments.bench.tools.procfs import cores_busy_s

LEAST_S = 2.0
"""Wall time between two readings at least, s: the kernel counts the time of cores in hundredths of a second."""

Clocks = tuple[float, float, float]
"""Wall time, busy time of the cores, and processor time of the benchmark, s."""


def own_s() -> float:
    """Processor time of this process so far, and of its children and theirs that have ended and were waited for, s."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def clocks() -> Clocks:
    """What a reading is made from.

    Raises:
        Unmeasured: The kernel does not say.
    """
    return time.perf_counter(), cores_busy_s(), own_s()


class OthersWork:
    """Counts how many cores others keep busy, from one reading to the next."""

    def __init__(self, read: Callable[[], Clocks] = clocks) -> None:
        """Begin to count.

        Args:
            read: Reads the clocks; raises Unmeasured where it cannot.
        """
        self._read = read
        self._before = self._now()

    def cores(self) -> float | None:
        """How many cores others kept busy on average since the last reading; none of our processes may run now.

        Returns:
            The number of cores, or None where the last reading is too recent, and counting goes on, or where the kernel
            does not say.
        """
        before, now = self._before, self._now()
        if before is None or now is None or now[0] - before[0] < LEAST_S:
            return None
        self._before = now
        wall, busy, own = (later - earlier for later, earlier in zip(now, before, strict=True))
        return max(0.0, busy - own) / wall

    def _now(self) -> Clocks | None:
        try:
            return self._read()
        except Unmeasured:
            return None
