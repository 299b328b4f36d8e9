"""Worker processes of a sweep: how waiting for them ends."""

from __future__ import annotations

import selectors
import signal
import sys
import threading

import pytest

from experiments.sweeps.workers import LocalWorkers

ENDLESS = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 1_000_000, "robots": {"count": 1}}


@pytest.mark.processes
def test_a_signal_that_does_not_wake_the_wait_ends_it() -> None:
    """So it is with Ctrl-C that comes just before the wait begins; here another thread takes the signal."""
    waiting = threading.main_thread().ident
    assert waiting is not None
    over = threading.Event()

    def interrupt() -> None:
        while sys._current_frames()[waiting].f_code.co_filename != selectors.__file__:
            if over.wait(0.01):
                return
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with pytest.raises(KeyboardInterrupt), LocalWorkers(1) as workers:
            next(workers.work([{"key": "k", "case": "endless", "seed": 1, "scenario": ENDLESS}]))
    finally:
        over.set()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        thread.join()
