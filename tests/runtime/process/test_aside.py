"""Work in a copy of this process: results, errors, and ends."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest

from patrol.errors import BadInput
from runtime.process.aside import Aside, in_two
from runtime.starting.forking import can_fork

pytestmark = pytest.mark.skipif(not can_fork(), reason="this system makes no copies")


def test_a_copy_does_the_work_meanwhile() -> None:
    with Aside(os.getpid) as work:
        assert work.result() != os.getpid()


def test_an_error_is_raised_here() -> None:
    def fail() -> None:
        raise BadInput(f"no such thing in {os.getpid()}")

    with Aside(fail) as work, pytest.raises(BadInput, match=f"no such thing in {os.getpid()}"):
        work.result()


def test_work_of_a_copy_that_is_killed_is_done_here() -> None:
    here = os.getpid()

    def die_in_copy() -> int:
        if os.getpid() != here:
            os.kill(os.getpid(), 9)
        return os.getpid()

    with Aside(die_in_copy) as work:
        assert work.result() == here


def test_work_whose_result_is_not_wanted_ends_and_cleans_up(tmp_path: Path) -> None:
    def write() -> None:
        part = tmp_path / "part"
        try:
            part.write_text(str(os.getpid()))
            time.sleep(600.0)
        finally:
            part.rename(tmp_path / "removed")

    with Aside(write):
        while not (tmp_path / "part").exists() or not (tmp_path / "part").read_text():
            time.sleep(0.01)
    copy = int((tmp_path / "removed").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(copy, 0)


def test_another_thread_makes_no_copy() -> None:
    found: list[int] = []
    thread = threading.Thread(target=lambda: found.append(Aside(os.getpid).result()))
    thread.start()
    thread.join()
    assert found == [os.getpid()]


def test_a_result_is_there_where_ended_children_are_forgotten() -> None:
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        assert Aside(lambda: 5).result() == 5
    finally:
        signal.signal(signal.SIGCHLD, before)


@pytest.mark.parametrize("count", range(5))
def test_work_in_two_gives_results_in_order_and_half_of_them_from_a_copy(count: int) -> None:
    results = in_two(lambda item: (item, os.getpid()), range(count))
    assert [item for item, _ in results] == list(range(count))
    assert [process == os.getpid() for _, process in results] == [place % 2 == 0 for place in range(count)]
