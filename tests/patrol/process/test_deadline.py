"""A limit to the time of somebody else's code: it rings in the middle, and leaves no trace where it need not."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from types import FrameType

import pytest

from patrol.process.deadline import Late, deadline

SHORT_S = 0.05
LONG_S = 60.0


@pytest.fixture(autouse=True)
def quiet_timer() -> Iterator[None]:
    """Put back what others, such as pytest's own limit, wait for."""
    handler = signal.getsignal(signal.SIGALRM)
    left = signal.setitimer(signal.ITIMER_REAL, 0.0)
    yield
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, *left)


def spin(seconds: float = LONG_S) -> None:
    """Compute for so long."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def test_what_takes_too_long_is_ended_in_the_middle() -> None:
    begun = time.monotonic()
    with pytest.raises(Late, match=r"^took longer than 0\.05 s to decide$"), deadline(SHORT_S):
        spin()
    assert time.monotonic() - begun < LONG_S / 2.0


def test_a_process_that_stood_still_has_time_left() -> None:
    """However long it was stopped, one signal waits for it."""
    with deadline(LONG_S):
        signal.raise_signal(signal.SIGALRM)


def test_who_sleeps_is_ended_too() -> None:
    begun = time.monotonic()
    with pytest.raises(Late), deadline(SHORT_S):
        time.sleep(LONG_S)
    assert time.monotonic() - begun < LONG_S / 2.0


def test_code_that_catches_every_exception_does_not_go_on() -> None:
    went_on = False
    with pytest.raises(Late), deadline(SHORT_S):  # noqa: PT012
        try:
            spin()
        except Exception:  # noqa: BLE001
            went_on = True
        went_on = True
    assert not went_on


def test_what_is_done_in_time_hears_no_bell() -> None:
    with deadline(LONG_S):
        pass
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


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
    signal.setitimer(signal.ITIMER_REAL, 100.0, 7.0)
    begun = time.monotonic()
    with suppress(Late), deadline(SHORT_S if late else LONG_S):
        spin(LONG_S if late else 0.0)
    left_s, interval_s = signal.getitimer(signal.ITIMER_REAL)
    spent_s = time.monotonic() - begun
    assert 100.0 - spent_s - 1.0 <= left_s <= 100.0 - (SHORT_S if late else 0.0)
    assert interval_s == pytest.approx(7.0)


def test_a_timer_that_was_due_meanwhile_rings_afterwards() -> None:
    rung: list[int] = []
    signal.signal(signal.SIGALRM, lambda number, _frame: rung.append(number))
    signal.setitimer(signal.ITIMER_REAL, SHORT_S)
    with deadline(LONG_S):
        spin(4.0 * SHORT_S)
        assert not rung
    spin(2.0 * SHORT_S)
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
