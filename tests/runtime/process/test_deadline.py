import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import FrameType
from typing import Any

import pytest

from runtime.process.deadline import DECISION_LIMIT_S, MOST_CALLS, Late, deadline

SHORT_S = 0.05
LONG_S = 300.0
EVER_S = 10_000.0
JIFFY_S = 0.01
"""The kernel may round what is left of a timer up by one of its ticks: 1 to 10 ms."""


@pytest.fixture(autouse=True)
def lost(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Note what is raised where it gets lost, such as in a `__del__`.

    A built-in function does so: the next signal could interrupt one in Python, such as pytest's own.
    """
    noted: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", noted.append)
    return noted


@pytest.fixture(autouse=True)
def quiet_timer() -> Iterator[None]:
    """Put back what others, such as pytest's own limit, wait for."""
    handler = signal.getsignal(signal.SIGALRM)
    left = signal.setitimer(signal.ITIMER_REAL, 0.0)
    yield
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, *left)


def spin(seconds: float = LONG_S) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


@pytest.mark.parametrize("work", [spin, time.sleep])
def test_what_takes_too_long_is_ended_in_the_middle(work: Callable[[float], None]) -> None:
    begun = time.monotonic()
    with pytest.raises(Late, match=r"^took longer than 0\.05 s to decide$"), deadline(SHORT_S):
        work(LONG_S)
    assert time.monotonic() - begun < LONG_S


def test_a_process_that_stood_still_has_time_left() -> None:
    """However long it was stopped, one signal waits for it."""
    with deadline(LONG_S):
        signal.raise_signal(signal.SIGALRM)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_code_that_catches_every_exception_does_not_go_on() -> None:
    went_on = False
    with pytest.raises(Late), deadline(SHORT_S):  # noqa: PT012
        try:
            spin()
        except Exception:  # noqa: BLE001
            went_on = True
        went_on = True
    assert not went_on


def test_an_interruption_that_gets_lost_comes_again(lost: list[Any]) -> None:
    class Deleted:
        def __del__(self) -> None:
            spin()

    with pytest.raises(Late), deadline(SHORT_S):  # noqa: PT012
        Deleted()
        spin()
    assert lost
    assert {raised.exc_type for raised in lost} == {Late}


def test_code_that_calls_itself_without_end_is_over_before_its_time() -> None:
    def call() -> None:
        call()

    before = sys.getrecursionlimit()
    try:
        with pytest.raises(Late, match=f"^called itself more than {MOST_CALLS} times$"), deadline(DECISION_LIMIT_S):  # noqa: PT012
            sys.setrecursionlimit(10**9)
            call()
    finally:
        sys.setrecursionlimit(before)


def test_no_limit_touches_no_timer() -> None:
    handler = signal.getsignal(signal.SIGALRM)
    with deadline(None):
        assert signal.getsignal(signal.SIGALRM) is handler
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize("late", [True, False])
def test_what_the_block_raises_comes_out_and_the_handler_is_put_back(late: bool) -> None:
    def own(_signal: int, _frame: FrameType | None) -> None:
        raise AssertionError("this timer was not set")

    signal.signal(signal.SIGALRM, own)
    with pytest.raises(Late if late else KeyError), deadline(SHORT_S if late else LONG_S):  # noqa: PT012
        if late:
            spin()
        raise KeyError
    assert signal.getsignal(signal.SIGALRM) is own
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize("late", [True, False])
def test_a_timer_that_ran_before_goes_on_afterwards(late: bool) -> None:
    begun = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, EVER_S, 7.0)
    with suppress(Late), deadline(SHORT_S if late else LONG_S):
        spin(LONG_S if late else 0.0)
    left_s, interval_s = signal.getitimer(signal.ITIMER_REAL)
    spent_s = time.monotonic() - begun
    assert EVER_S - spent_s - 1.0 <= left_s <= EVER_S - (SHORT_S if late else 0.0) + JIFFY_S
    assert interval_s == pytest.approx(7.0)


def test_a_timer_that_was_due_meanwhile_rings_afterwards() -> None:
    rung: list[int] = []
    signal.signal(signal.SIGALRM, lambda number, _frame: rung.append(number))
    due_s = SHORT_S
    while True:
        signal.setitimer(signal.ITIMER_REAL, due_s)
        with deadline(LONG_S):
            early = len(rung)
            spin(2.0 * due_s)
            assert len(rung) == early
        if not early:
            break
        rung.clear()  # it rang before the block began: once more, with more time
        due_s *= 2.0
    end = time.monotonic() + LONG_S
    while not rung and time.monotonic() < end:
        pass
    assert rung == [signal.SIGALRM]


def test_other_threads_know_no_limit() -> None:
    done: list[str] = []

    def work() -> None:
        with deadline(SHORT_S):
            spin(4.0 * SHORT_S)
        done.append("done")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(LONG_S)
    assert done == ["done"]
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
