"""Watching real fleets over Zenoh: from the start or late, with a world or without, at no cost to the ticks."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from monitor.live.attach import open_fleet
from monitor.live.positions_source import PositionsSource
from monitor.observation.source import Source, State
from monitor.replay.replay import Replay
from monitor.replay.run import open_run
from patrol.errors import BadInput
from patrol.journal.records import Status
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario
from runtime.messages.telemetry import Telemetry, pack_view
from runtime.net.link import Link, open_link
from runtime.process.lifeline import Ending
from runtime.security.keys import fleet_keys
from runtime.security.private_files import new_key
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run
from tests.routers import reach_patiently

PATIENCE = 600
"""Waits of a tenth of a second."""


def attached(run: Run) -> Source:
    run.until((run.folder / "control.json").exists)
    source = open_fleet(Ending(), access=run.folder)
    assert source is not None
    return source


def until(source: Source, what: Callable[[State], bool]) -> State:
    """The first state that is so."""
    for _ in range(PATIENCE):
        state = source.wait(0.1)
        if state is not None and what(state):
            return state
    raise AssertionError("waited in vain")


@pytest.mark.processes
def test_a_run_is_watched_controlled_and_watched_by_another_who_comes_late(start: Callable[..., Run]) -> None:
    scenario = {**COARSE, "duration": 100_000, "robots": 3 * [{}], "faults": [{"kind": "loss", "rate": 0.3}]}
    run = start(scenario)
    first = attached(run)
    assert first.control({"do": "pause"}).done
    until(first, lambda state: not state.running)
    assert first.control({"do": "fault", "fault": {"kind": "kill", "who": "r2"}}).done
    assert first.control({"do": "step", "ticks": 30}).done
    seen = until(first, lambda state: not state.running and state.robots[1:2] != () and _dead(state, 1))
    held = first.control({"do": "step", "ticks": 10})
    last = int(held.text.rpartition(" ")[2]) - 1
    seen = until(first, lambda state: state.k == last)
    late = attached(run)
    again = until(late, lambda state: state.k == last)
    assert seen.robots[1].status is again.robots[1].status is Status.DEAD
    assert [event.kind for event in late.events(0)] == [event.kind for event in first.events(0)]
    assert "operator" in {event.kind for event in late.events(0)}
    os.kill(run.process.pid, signal.SIGINT)
    ended = until(first, lambda state: state.ended is not None)
    assert ended.ended == "interrupted"
    assert run.end() == 130, run.errors
    truth = Replay(open_run(run.folder)).fog(last).last_seen
    for source in (first, late):
        np.testing.assert_array_equal(source.last_seen("truth"), truth)
        assert until_gone(source)
        source.close()
    links = open_run(run.folder).links
    assert seen.links is not None
    assert 0 < links.delivered[1:, 1:].sum() < links.delivered[1:, 1:].sum() + links.lost[1:, 1:].sum()


def _dead(state: State, place: int) -> bool:
    return state.robots[place].status is Status.DEAD


def until_gone(source: Source) -> bool:
    """A source whose fleet is gone goes on answering."""
    source.wait(0.0)
    return not source.control({"do": "pause"}).done


@pytest.mark.processes
def test_a_stopped_viewer_costs_no_tick(start: Callable[..., Run], tmp_path: Path) -> None:
    run = start({**COARSE, "duration": 100_000, "robots": 2 * [{}]})
    operator = attached(run)
    assert operator.control({"do": "pause"}).done  # until the viewer is there, however long that takes
    ready = tmp_path / "ready"
    with viewing(run.folder, ready, "source.wait(10.0)") as viewer:
        run.until(ready.exists)
        viewer.send_signal(signal.SIGSTOP)
        assert operator.control({"do": "go"}).done
        operator.close()
        run.until(lambda: run.unread(viewer.pid) > 0)
        unread = 0
        while (held := run.unread(viewer.pid)) > unread:  # until nothing more fits into its socket, and longer
            unread = held
            run.pass_ticks(100)
        run.interrupt()
        assert run.summary()["verdict"]["valid"]


@contextmanager
def viewing(folder: Path, ready: Path, looks: str) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer that looks at a source again and again, and makes a file after each time."""
    code = (
        "import sys, pathlib\n"
        "from monitor.live.attach import open_fleet\n"
        "from runtime.process.lifeline import Ending\n"
        "source = open_fleet(Ending(), access=pathlib.Path(sys.argv[1]))\n"
        f"while True:\n    {looks}\n    pathlib.Path(sys.argv[2]).touch()\n"
    )
    viewer = subprocess.Popen([sys.executable, "-P", "-c", code, str(folder), str(ready)])
    try:
        yield viewer
    finally:
        viewer.kill()
        viewer.wait()


def test_robots_without_a_world_are_heard(endpoint: str) -> None:
    keys = fleet_keys("real-1")
    scenario = load_scenario({**COARSE, "robots": [{"name": "anna"}, {"name": "bert"}], "step": 0.1})
    later = [0.0]
    links = open_link(endpoint, 20.0), open_link(endpoint, 20.0)
    source = PositionsSource(keys, prepare(scenario), *links, lambda: time.monotonic() + later[0])
    robot: Link = open_link(endpoint, 20.0)
    robot.live(keys.alive("anna"))
    said = Telemetry(3, "patrolling", (1.0, 2.0), (3.0, 4.0), None, 9, 1.5, 2)
    tell, position = robot.publisher(keys.telemetry("anna")), robot.broadcast(keys.position("anna"))
    state = None
    for sequence in range(1, PATIENCE):
        tell(pack_view(said))
        position(encode(Position.of(1, sequence, sequence * 0.1, Pose(50.0, 50.0, 0.0))))
        state = source.wait(0.2)
        if state is not None and state.robots[0].state and state.robots[0].pose is not None and source.events(0):
            break
    assert state is not None
    anna, bert = state.robots
    assert (anna.status, anna.goal, anna.decision_ms) == (Status.ALIVE, (3.0, 4.0), 1.5)
    assert anna.pose is not None
    assert (anna.pose.x, anna.pose.y) == (50.0, 50.0)
    assert (bert.status, bert.pose) == (Status.ABSENT, None)
    assert [(event.kind, event.robot) for event in source.events(0)] == [("connected", 1)]
    assert source.static().layers == ("heard",)
    assert not source.control({"do": "pause"}).done
    seen = source.last_seen("heard")
    assert seen is not None
    assert (seen >= 0).sum() > 100
    robot.close()
    later[0] += 60.0
    state = source.wait(0.0)
    assert state is not None
    assert state.robots[0].status is Status.LOST
    source.close()


def test_a_fleet_that_is_not_there_is_said_so(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    reach_patiently(monkeypatch)
    with pytest.raises(BadInput, match="no world of this fleet"):
        open_fleet(Ending(), router=endpoint, fleet="nobody-1", wait_s=0.3)
    with pytest.raises(BadInput, match="no fleet named"):
        open_fleet(Ending())


def test_the_page_of_a_run_is_given_the_run_s_key(start: Callable[..., Run], tmp_path: Path) -> None:
    key = tmp_path / "fleet.key"
    new_key(key)
    scenario = {**COARSE, "duration": 100_000, "robots": {"count": 1, "model": "holonomic"}, "radio": {"key": str(key)}}
    run = start(scenario, "--page")
    run.until(lambda: "monitor" in run.children())
    words = Path("/proc", str(run.children()["monitor"]), "cmdline").read_text(encoding="utf-8").split("\0")
    assert words[words.index("--key") + 1] == str(key)
    run.interrupt()
