"""A limit to the wall time that foreign code may take."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

ANSWER_S = 60.0
"""Longest wait of the world in lockstep for a robot's answer, s of wall time: longer than on any machine that is only
busy, and than in the first tick, in which robots may still load what they need."""

DECISION_LIMIT_S = 30.0
"""Wall time, s, that a policy of one's own may take to decide: enough on a busy machine, and less than the world waits
in lockstep."""

_SLICES = 32
"""Number of looks at the time within a limit."""
_MOST_AT_ONCE = 0.25
"""The share of a limit that counts between two looks: a process that is stopped for long uses up this much at most."""


class Late(BaseException):
    """The time is over. No `Exception`, so that code that catches all of these does not go on."""


@contextmanager
def deadline(limit_s: float | None) -> Iterator[None]:
    """Raise in the middle of a block that takes too long.

    It works in the main thread of a process, and on code that comes back to Python now and then. Elsewhere there is no
    limit. A timer that was running goes on afterwards. When the whole process stands still, because it is stopped or
    the machine is suspended, at most a quarter of the limit counts each time.

    Args:
        limit_s: Wall time, s; None for no limit.

    Raises:
        Late: The block has taken longer.
    """
    if limit_s is None or threading.current_thread() is not threading.main_thread():
        yield
        return

    used_s, looked = 0.0, time.monotonic()

    def ring(_signal: int, _frame: object) -> None:
        nonlocal used_s, looked
        before, looked = looked, time.monotonic()
        used_s += min(looked - before, _MOST_AT_ONCE * limit_s)
        if used_s >= limit_s:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            raise Late(f"took longer than {limit_s:g} s to decide")

    left_s, interval_s = signal.setitimer(signal.ITIMER_REAL, 0.0)  # before `ring` is there, which is for our own timer
    begun = time.monotonic()
    handler = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, limit_s / _SLICES, limit_s / _SLICES)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        if left_s > 0.0:
            signal.setitimer(signal.ITIMER_REAL, max(left_s - (time.monotonic() - begun), 1e-3), interval_s)
