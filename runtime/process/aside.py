"""Work that a copy of this process does meanwhile, on another processor.

A copy begins with all that this process has loaded and computed, so that nothing is handed over but the result. It
leads a session of its own, so that Ctrl-C reaches this process alone, and dies with it. Where no copy can be made, and
where one ends without a result, as by an exception, this process does the work when the result is asked for: errors are
raised as if there were no copy.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Generic, NoReturn, Self, TypeVar

from patrol.classes.exits import end_now
from runtime.process.lifeline import die_when_orphaned, interrupt
from runtime.starting.forking import can_fork, fork_process

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


class Aside(Generic[_Result]):
    """Some work, whose result can be pickled. Leaving the context ends a copy that still works at it."""

    def __init__(self, work: Callable[[], _Result]) -> None:
        """Begin."""
        self._work = work
        self._copy = 0  # its process id; 0 without one
        if not can_fork() or threading.current_thread() is not threading.main_thread():
            return  # what another thread has locked would stay locked in the copy
        # Only the copy writes; its end closes the pipe, which ends the wait for a result.
        self._source, sink = Pipe(duplex=False)
        parent = os.getpid()
        with sink, suppress(OSError):
            # A copy that is ended before it can handle that does so once it can.
            masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
            try:
                if (copy := fork_process()) == 0:
                    _work_in_copy(work, sink, parent)
                self._copy = copy
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, masked)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._copy:
            copy, self._copy = self._copy, 0
            with suppress(ProcessLookupError, ChildProcessError):  # where this process does not ask for its children
                os.kill(copy, signal.SIGTERM)
                os.waitpid(copy, 0)
            self._source.close()

    def result(self) -> _Result:
        """Return the result of the work, once."""
        with self:
            if self._copy:
                with suppress(EOFError, OSError):
                    work_result: _Result = pickle.loads(self._source.recv_bytes())
                    return work_result
        return self._work()


def in_two(work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Do some work for each item, for every other one in a copy, and return the results in the items' order.

    For example, of five items the copy does the second and the fourth.
    """
    with Aside(lambda: [work(item) for item in items[1::2]]) as others:
        own = iter([work(item) for item in items[::2]])
        copied = iter(others.result())
    return [next(copied if place % 2 else own) for place in range(len(items))]


def _work_in_copy(work: Callable[[], object], sink: Connection, parent: int) -> NoReturn:
    try:
        with suppress(BaseException):  # the parent does the work again
            os.setsid()
            signal.signal(signal.SIGTERM, interrupt)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
            die_when_orphaned(None)
            if os.getppid() == parent:
                sink.send_bytes(pickle.dumps(work()))
    finally:
        end_now(0)
