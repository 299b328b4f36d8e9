"""A limit to the wall time that foreign code may take."""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType

ANSWER_S = 60.0
"""Longest wait of the world in lockstep for a robot's answer, s of wall time: longer than on any machine that is only
busy, and than in the first tick, in which robots may still load what they need."""

DECISION_LIMIT_S = 30.0
"""Wall time, s, that a policy of one's own may take to decide: enough on a busy machine, and less than the world waits
in lockstep."""

MOST_CALLS = 50_000
"""Greatest depth of nested calls, also for code that has raised Python's recursion limit. Leaving calls takes time:
without this depth, endless recursion would end long after its time limit."""

_SLICES = 256
"""Number of looks at the time within a limit."""
_MOST_AT_ONCE = 0.25
"""The share of a limit that counts between two looks: a process that is stopped for long uses up this much at most."""


class Late(BaseException):
    """The time is over. It is no `Exception`, so a policy that catches every `Exception` does not catch it."""


class deadline:  # noqa: N801 - a context manager
    """A block that is interrupted when it takes too long, and again and again until it is left.

    What is raised in a `__del__` or a callback of the garbage collector gets lost, so once is not enough. It works in
    the main thread of a process, and on code that comes back to Python now and then. Elsewhere there is no limit. A
    timer that was running goes on afterwards. When the whole process stands still, because it is stopped or the machine
    is suspended, at most a quarter of the limit counts each time.
    """

    def __init__(self, limit_s: float | None) -> None:
        """Set the limit."""
        self._limit_s = limit_s if threading.current_thread() is threading.main_thread() else None
        self._used_s = self._looked = 0.0

    def __enter__(self) -> None:
        """Begin the block, in which `Late` is raised when it takes too long or calls itself without end."""
        if self._limit_s is None:
            return
        self._looked = self._begun = time.monotonic()
        # Before `_raise_late` is there: it is for our own timer.
        self._before = signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._handler = signal.signal(signal.SIGALRM, self._raise_late)
        signal.setitimer(signal.ITIMER_REAL, self._limit_s / _SLICES, self._limit_s / _SLICES)

    def __exit__(self, *_raised: object) -> None:
        """End."""
        if self._limit_s is None:
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._handler)
        left_s, interval_s = self._before
        if left_s > 0.0:
            # At least a little: 0 would switch the timer off.
            signal.setitimer(signal.ITIMER_REAL, max(left_s - (time.monotonic() - self._begun), 1e-3), interval_s)

    def _raise_late(self, _signal: int, frame: FrameType | None) -> None:
        assert self._limit_s is not None
        if frame is not None and frame.f_code in (deadline.__enter__.__code__, deadline.__exit__.__code__):
            return  # the block has not begun, or is over: an exception here would leave the timer running
        before, self._looked = self._looked, time.monotonic()
        self._used_s += min(self._looked - before, _MOST_AT_ONCE * self._limit_s)
        if self._used_s >= self._limit_s:
            why = f"took longer than {self._limit_s:g} s to decide"
        elif _is_deep(frame):
            why = f"called itself more than {MOST_CALLS} times"
        else:
            return
        raise Late(why)


def _is_deep(frame: FrameType | None) -> bool:
    """Return True if calls are nested more than `MOST_CALLS` deep."""
    calls = 0
    while frame is not None and calls <= MOST_CALLS:
        # Without the bound, each look at endless recursion would walk all of its frames.
        frame, calls = frame.f_back, calls + 1
    return calls > MOST_CALLS
