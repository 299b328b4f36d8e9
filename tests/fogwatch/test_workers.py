"""Fleets in several workers: what else there is to them than the same trace (`tests.fogwatch.test_inprocess`)."""

import os
import signal
from multiprocessing import active_children
from pathlib import Path

import pytest

from agent.policies.commitment import Commitment
from fogwatch.inprocess import run_in_process
from fogwatch.workers import WorkerEnded
from patrol.journal import TickRecord, read_journal
from tests.fogwatch.test_inprocess import DISCS, FAILING, scenario

STRANGER = """

class Stranger(Exception):
    def __init__(self, first, second):
        super().__init__(first + second)
"""
"""An exception that cannot be pickled and read again."""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_worker_that_ends_ends_the_run_and_the_other_workers(number: int, tmp_path: Path) -> None:
    def kill_one(record: TickRecord) -> None:
        if record.k == 3:
            os.kill(next(p.pid for p in active_children() if p.pid and p.name == "worker 1"), number)

    with pytest.raises(WorkerEnded, match=rf"worker 1 of 2 has ended with exit code -{number}"):
        run_in_process(scenario(robots=DISCS), workers=2, progress=kill_one, journal=tmp_path / "journal")
    assert not active_children()
    journal = read_journal(tmp_path / "journal")
    assert [record.k for record in journal.ticks] == [0, 1, 2, 3]
    assert journal.end
    assert "worker 1 of 2" in journal.end.reason


def test_a_mistake_in_a_worker_is_raised_with_where_it_was_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise KeyboardInterrupt("a mistake")

    monkeypatch.setattr(Commitment, "decide", broken)
    with pytest.raises(KeyboardInterrupt, match="a mistake") as raised:
        run_in_process(scenario(robots=DISCS), workers=2)
    assert "in broken" in raised.value.__notes__[0]
    assert not active_children()


@pytest.mark.parametrize("raised", ['RuntimeError("no idea")', 'Stranger("no", " idea")'])
def test_a_policy_that_fails_in_a_worker_is_told_with_its_traceback(raised: str, tmp_path: Path) -> None:
    path, told = tmp_path / "failing.py", []
    path.write_text(FAILING.replace('RuntimeError("no idea")', raised) + STRANGER, encoding="utf-8")
    failing = scenario(robots=DISCS, patrol={"policy": f"{path}:Failing"}, ticks=12)
    run_in_process(failing, workers=2, failure=lambda *failure: told.append(failure))
    [(number, reason, error)] = told
    assert number == 2
    assert "no idea" in reason
    assert f"raise {raised}" in str(error)
