"""Viewers of a fleet of real processes: during ticks that are long, stopped in the middle, or killed."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fleets import COARSE
from tests.fogwatch.conftest import Run
from tests.fogwatch.processes.test_feed import attached, until, viewing

pytestmark = pytest.mark.processes

FAST: dict[str, Any] = {**COARSE, "robots": 3 * [{"model": "holonomic"}]}


def test_during_a_tick_of_minutes_operators_are_obeyed_and_viewers_let_in(start: Callable[..., Run]) -> None:
    run = start({**FAST, "duration": 100_000, "pace": "realtime"})
    operator = attached(run)
    until(operator, lambda state: state.k > 2)
    assert operator.control({"do": "pace", "factor": 0.001}).done
    slow = until(operator, lambda state: state.pace == 0.001)
    late = attached(run)
    assert until(late, lambda state: state.pace == 0.001).k <= slow.k + 1
    late.close()
    assert operator.control({"do": "pace", "factor": 10.0}).done
    until(operator, lambda state: state.k > slow.k + 20)
    assert [event.kind for event in operator.events(0)].count("operator") == 2
    operator.close()
    run.interrupt()
    assert set(run.statuses().values()) == {"alive"}


def test_viewers_that_ask_for_all_and_stop_reading_cost_no_robot(start: Callable[..., Run], tmp_path: Path) -> None:
    """They ask for all so far, again and again, and read every key that viewers may read."""
    run = start({**FAST, "point": 0.1, "duration": 100_000})
    operator = attached(run)
    run.until(lambda: run.ticks() > 5)
    for number in range(3):
        assert operator.control({"do": "pause"}).done  # until the viewer is there, however long that takes
        ready = tmp_path / f"ready-{number}"
        with viewing(run.folder, ready, "list(source._client.so_far())") as viewer:
            run.until(ready.exists)
            assert operator.control({"do": "go"}).done
            run.pass_ticks(20)  # while it asks and reads
            viewer.send_signal(signal.SIGSTOP)
            run.pass_ticks(50)
    operator.close()
    run.interrupt()
    assert set(run.statuses().values()) == {"alive"}
