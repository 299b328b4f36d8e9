"""A process's reasons to leave or pause: a signal, or the death of the process that started it.

A launcher gives each child the reading end of a pipe that it alone can write to and never does. When the launcher ends,
however it ends, the pipe is at its end, and the child has `GRACE_S` to leave in order before it is made to.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import math
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import NoReturn

from patrol.classes.exits import end_now
from patrol.errors import BadInput
from runtime.process.failures import BAD_INPUT, CRASHED, INTERRUPTED, LEAST, allow_files, told
from runtime.reporting.logs import Log, crashed

GRACE_S = 1.5
LOADING_S = 5.0
"""Time after which an interrupt no longer waits for a library or a user's class to be loaded."""

_PR_SET_PDEATHSIG = 1
_POLL_S = 0.02
_LOADING = ("<frozen importlib._bootstrap>", str(Path("llvmlite", "binding", "executionengine.py")))


class InterruptedBySignal(KeyboardInterrupt):
    """A signal that ends the process wherever it is; caught as `KeyboardInterrupt`.

    A class of its own: where `KeyboardInterrupt` itself leaves the `exec` of a source text, as a library may run while
    it is imported, CPython ends the process by SIGINT whatever exit code it chose later.
    """


class Ending:
    """State of a process's end: whether it should leave, why, and how often it was asked to.

    The first request gives the reason. `patience` is the number of signals that are left to the reader of this object,
    None for all; each further one raises `InterruptedBySignal` wherever the process is.
    """

    def __init__(self, patience: int | None = None) -> None:
        self.patience = patience
        self.reason = ""
        self.times = 0
        self._asked = threading.Event()

    def __bool__(self) -> bool:
        return self._asked.is_set()

    def ask(self, reason: str) -> None:
        """Ask the process to leave soon; the first reason counts."""
        # Counted also after the first: handlers look at it.
        self.times += 1
        if not self._asked.is_set():
            self.reason = reason
            self._asked.set()

    def wait(self, timeout_s: float) -> bool:
        """Wait until asked to leave; return whether that has happened."""
        return self._asked.wait(timeout_s)

    def wait_for(self, path: Path, limit_s: float = math.inf) -> bool:
        """Wait until a path exists; return False when asked to leave or when the limit is over, before it does."""
        waited_s = 0.0
        while not path.exists():
            if waited_s >= limit_s or self._asked.wait(_POLL_S):
                return False
            waited_s += _POLL_S
        return True


def heed(lifeline: int | None, on_death: Callable[[], None] = lambda: None, *, patience: int | None = None) -> Ending:
    """Obey signals and the lifeline, a file descriptor, from now on; called on the main thread.

    `on_death` is called right before the process ends, when it has not left in time after its launcher's death.
    `patience` is that of `Ending`.
    """
    ending = Ending(patience)
    if lifeline is not None:
        # A stopped process continues when its launcher dies, so that it can notice. This comes before the handlers:
        # a process that catches SIGTERM is known to have done it.
        _when_orphaned(signal.SIGCONT)

    def by_signal(number: int, frame: FrameType | None) -> None:
        ending.ask(f"told to by {signal.Signals(number).name}")
        # A second signal: whoever sends it waits, perhaps behind a pipe that is full.
        if ending.times > 1:
            _give_up_output()
        if ending.patience is not None and ending.times > ending.patience:
            interrupt(number, frame)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # as nohup has it
            signal.signal(number, by_signal)
    if lifeline is not None:
        threading.Thread(target=_hold_lifeline, args=(lifeline, ending, on_death), daemon=True).start()
    return ending


def interrupt(_number: int, frame: FrameType | None, tries: int = 0) -> None:
    """Raise InterruptedBySignal, as a signal's handler; a little later where the exception would do harm or be lost.

    LLVM, calling back for compiled code, would go on with memory that was not filled; an import that is broken off
    leaves locks of libraries taken; what a `__del__` raises is dropped.
    """
    _give_up_output()
    if _is_loading(frame) and tries * _POLL_S < LOADING_S:
        _interrupt_soon(tries + 1)
        return
    # An interrupt that was put off must not come a second time.
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    print_lost = sys.unraisablehook

    def see_lost(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, InterruptedBySignal):
            sys.unraisablehook = print_lost
            _interrupt_soon(tries + 1)
        else:
            print_lost(lost)

    # Python drops what a `__del__` raises, and calls this hook: then it is tried again.
    sys.unraisablehook = see_lost
    raise InterruptedBySignal


def _give_up_output() -> None:
    """Drop output that has no reader: a full pipe would hold up the end, also in a write that has begun."""
    for number in (1, 2):
        with contextlib.suppress(OSError, ValueError):
            if not select.select([], [number], [], 0)[1]:
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, number)  # the write is tried again when the signal's handler returns
                os.close(nowhere)


def _interrupt_soon(tries: int) -> None:
    signal.signal(signal.SIGALRM, partial(interrupt, tries=tries))
    signal.setitimer(signal.ITIMER_REAL, _POLL_S)


def forget_interrupt() -> None:
    """Cancel an interrupt that was put off: what it was to end is over."""
    handler = signal.getsignal(signal.SIGALRM)
    if isinstance(handler, partial) and handler.func is interrupt:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


atexit.register(forget_interrupt)
"""While the interpreter puts itself away, the alarm would end the process by its signal."""


def _is_loading(frame: FrameType | None) -> bool:
    """Return True while something is imported, and where LLVM may have called back."""
    while frame is not None:
        if frame.f_code.co_filename.endswith(_LOADING):
            return True
        frame = frame.f_back
    return False


def rest_before_pause(rest: Callable[[], None], go_on: Callable[[], None]) -> None:
    """Have something come to rest before a terminal's Ctrl-Z (SIGTSTP) pauses this process; called on the main thread.

    SIGSTOP, which no process can notice, still pauses it at once.
    """

    def by_signal(_number: int, _frame: FrameType | None) -> None:
        rest()
        # The handler has replaced what SIGTSTP does by itself, so the stop has to be asked for.
        os.kill(os.getpid(), signal.SIGSTOP)
        go_on()

    signal.signal(signal.SIGTSTP, by_signal)


def run_process(main: Callable[[], int]) -> NoReturn:
    """Run a process's main function and end the process with its exit code.

    An exception is printed and ends the process with `CRASHED`, or with one line and `BAD_INPUT` where a limit of the
    machine explains it.
    """
    try:
        allow_files(LEAST, "this process")
        code = main()
    except SystemExit as asked:
        code = asked.code if isinstance(asked.code, int) else 0
    except BaseException as error:  # noqa: BLE001 - the process is over, and must not hang on threads of libraries
        limit = str(error) if isinstance(error, BadInput) else told(error)
        if limit is not None:
            Log("", "").error(limit)
            code = BAD_INPUT
        else:
            crashed(error)
            code = CRASHED
    leave(code)


def leave(code: int) -> NoReturn:
    """End the process now, whatever threads of libraries are doing."""
    # Ending at once flushes no stream.
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    end_now(code)


def _hold_lifeline(lifeline: int, ending: Ending, on_death: Callable[[], None]) -> None:
    while True:
        try:
            # Nothing is ever written to the pipe, so only its end lets a read return, and returns nothing.
            if not os.read(lifeline, 1):
                break
        except InterruptedError:
            continue
        except OSError:
            break
    ending.ask("its launcher has died")
    if os.getpgrp() == os.getpid():
        _signal_children(_list_children(), signal.SIGTERM)  # those that foreign code has started in this process
    threading.Event().wait(GRACE_S)
    on_death()
    leave(INTERRUPTED)


def die_when_orphaned(lifeline: int | None) -> None:
    """Have the system kill this process as soon as its parent dies; for one that must not run a thread for that.

    The end of the thread that has started this process counts as the parent's death. What this process forks is not
    killed with it. The lifeline, a file descriptor, tells whether the parent has died before.
    """
    _when_orphaned(signal.SIGKILL)
    # A parent that died before the call above sends no signal any more.
    if lifeline is not None and select.select([lifeline], [], [], 0)[0]:
        leave(INTERRUPTED)


@contextlib.contextmanager
def ending_children() -> Iterator[None]:
    """End the processes that foreign code starts in a block, where the system lists a process's children.

    They have `GRACE_S` to leave in order before they are killed.
    """
    before = _list_children()
    try:
        yield
    finally:
        _end_children(_list_children() - before)


def _end_children(pids: set[int]) -> None:
    waited_s = 0.0
    _signal_children(pids, signal.SIGTERM)
    while waited_s < GRACE_S and any(map(_is_running, pids)):
        threading.Event().wait(_POLL_S)
        waited_s += _POLL_S
    _signal_children(pids, signal.SIGKILL)


def _signal_children(children: set[int], number: signal.Signals) -> None:
    for pid in filter(_is_running, children):
        with contextlib.suppress(OSError):
            os.kill(pid, number)


def _list_children() -> set[int]:
    pids: set[int] = set()
    for children in Path("/proc/self/task").glob("*/children"):
        with contextlib.suppress(OSError):  # its thread has ended since
            pids.update(map(int, children.read_text(encoding="ascii").split()))
    return pids


def _is_running(child: int) -> bool:
    """Return True until a child of this process has ended; it is left to be waited for by the code that started it."""
    try:
        return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
    except OSError:
        return False


def _when_orphaned(number: signal.Signals) -> None:
    """Have the system send a signal to this process when its parent dies, where the system offers that."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)
