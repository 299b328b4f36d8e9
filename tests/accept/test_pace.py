"""The pace of a fleet of processes, on a machine that has nothing else to do."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from patrol.journal import read_journal
from tests.fogwatch.conftest import Run

pytestmark = [pytest.mark.accept, pytest.mark.processes, pytest.mark.timeout(3600)]

PACED: dict[str, Any] = {"terrain": {"builtin": "open"}, "point": 0.5}


@pytest.fixture
def paced(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Starts a run at a pace; the lifeline ends its processes with it."""
    runs: list[Run] = []

    def begin(**facts: Any) -> Run:
        runs.append(Run({**PACED, **facts}, tmp_path / "run"))
        return runs[-1]

    yield begin
    for run in runs:
        run.process.kill()
        run.process.communicate()


def test_a_paused_agent_slows_nobody_down(paced: Callable[..., Run]) -> None:
    run = paced(duration=60, pace=20, watchdog=1.0, robots={"count": 2, "model": "holonomic"})
    run.until(lambda: run.ticks() > 10)
    agent = run.children()["r1"]
    os.kill(agent, signal.SIGSTOP)
    run.until(lambda: run.ticks() > 60)
    os.kill(agent, signal.SIGCONT)
    assert run.end() == 0, run.errors
    assert run.summary()["ticks"] == 120
    assert run.summary()["realtime_factor"] == pytest.approx(20, rel=0.2)


def test_while_an_agent_is_paused_the_others_decide_all_the_time(paced: Callable[..., Run]) -> None:
    """Its queues fill up after some hundreds of ticks; whoever waits for room in them then serves nobody."""
    ticks = 2000
    run = paced(duration=0.5 * ticks, pace=50, robots={"count": 3, "model": "holonomic"})
    run.until(lambda: run.ticks() > 50)
    agent = run.children()["r1"]
    os.kill(agent, signal.SIGSTOP)
    run.until(lambda: run.ticks() > ticks - 150)
    os.kill(agent, signal.SIGCONT)
    assert run.end() == 0, run.errors
    decided = {2: 0, 3: 0}
    longest = 0
    for tick in read_journal(run.folder / "journal").ticks:
        for row in tick.robots[1:]:
            if row.decision_ms is not None:
                decided[row.number] = tick.k
            longest = max(longest, tick.k - decided[row.number])
    assert longest < 100, f"no decision for {longest} ticks"
    assert run.summary()["realtime_factor"] == pytest.approx(50, rel=0.2)
