"""Whoever watches a fleet of real processes: during ticks that are long, stopped in the middle, or killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.request import urlopen

import pytest

from tests.fleets import COARSE
from tests.fogwatch.processes.test_feed import attached, until
from tests.fogwatch.processes.test_page import address_of

if TYPE_CHECKING:
    from tests.fogwatch.conftest import Run

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


@contextmanager
def asking_viewer(folder: Path, ready: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that asks for all so far, again and again, and reads every key that viewers may read."""
    code = (
        "import sys, pathlib\n"
        "from monitor.live.attach import open_fleet\n"
        "from patrol.process.lifeline import Ending\n"
        "source = open_fleet(Ending(), access=pathlib.Path(sys.argv[1]))\n"
        "while True:\n"
        "    list(source._client.so_far())\n"
        "    pathlib.Path(sys.argv[2]).touch()\n"
    )
    viewer = subprocess.Popen([sys.executable, "-P", "-c", code, str(folder), str(ready)])
    try:
        yield viewer
    finally:
        viewer.kill()
        viewer.wait()


def test_viewers_that_ask_for_all_and_stop_reading_cost_no_robot(start: Callable[..., Run], tmp_path: Path) -> None:
    run = start({**FAST, "point": 0.1, "duration": 100_000})
    operator = attached(run)
    run.until(lambda: run.ticks() > 5)
    for number in range(3):
        assert operator.control({"do": "pause"}).done  # until the viewer is there, however long that takes
        ready = tmp_path / f"ready-{number}"
        with asking_viewer(run.folder, ready) as viewer:
            run.until(ready.exists)
            assert operator.control({"do": "go"}).done
            run.pass_ticks(20)  # while it asks and reads
            viewer.send_signal(signal.SIGSTOP)
            run.pass_ticks(50)
    operator.close()
    run.interrupt()
    assert set(run.statuses().values()) == {"alive"}


def test_a_page_that_is_killed_is_served_again_at_its_address(start: Callable[..., Run]) -> None:
    pytest.importorskip("starlette")
    run = start({**FAST, "duration": 100_000, "pace": 2.0}, "--page")
    address = address_of(run)
    for _ in range(2):
        with urlopen(address) as page:
            assert page.status == 200
        os.kill(run.children()["monitor"], signal.SIGKILL)
        assert run.process.stderr is not None
        line = next(line for line in run.process.stderr if line.startswith("the page"))
        assert line.startswith("the page was killed by SIGKILL; starting it again (")
        run.until(lambda: serves(address))
    run.interrupt()


def serves(address: str) -> bool:
    with suppress(OSError), urlopen(address) as page:
        return bool(page.status == 200)
    return False
