"""Process faults on real processes over real Zenoh: the same trace as in one, and nothing left behind."""

import os
import signal
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from fogwatch.launch import child_control
from monitor.replay.player import Player
from monitor.replay.replay import play
from monitor.replay.run import open_run
from patrol.journal import RobotTick, Status, read_journal
from runtime.starting.forking import can_fork
from tests.fleets import COARSE, one_and_many
from tests.fogwatch.conftest import Run
from tests.fogwatch.processes.test_feed import attached
from tests.recordings import read_recording
from worldsim.faults import LOOKED_AT, STOPPED

pytestmark = pytest.mark.processes


def acts(*planned: tuple[str, str, float]) -> list[dict[str, Any]]:
    """Faults of kinds that act on a robot at a time."""
    return [{"kind": kind, "who": who, "at": at} for kind, who, at in planned]


EVERYTHING = [
    *acts(("kill", "anna", 3), ("restart", "anna", 7), ("restart", "bert", 9), ("join", "dora", 6)),
    *acts(
        ("restart", "dora", 10), ("leave", "emil", 8), ("kill", "emil", 9), ("pause", "carl", 14), ("join", "fern", 11)
    ),
    {"kind": "kill", "who": "bert", "at": 4, "wreck": "removed"},
    {"kind": "pause", "who": "carl", "at": 5, "for": 6},
    {"kind": "loss", "rate": 0.3, "at": 2, "for": 10},
]
NAMES = ["anna", "bert", "carl", "dora", "emil"]
SPARES = ["fern", "gil"]


def each(run: Run, first: int, what: Callable[[RobotTick], bool]) -> bool:
    """Return True if it was so of each robot in some tick, from the first on."""
    columns = list(zip(*(tick.robots for tick in run.records(first)), strict=True))
    return bool(columns) and all(any(map(what, column)) for column in columns)


def restart(run: Run, robot: str) -> None:
    with closing(attached(run)) as operator:
        assert operator.control({"do": "fault", "fault": {"kind": "restart", "who": robot}}).done


@pytest.mark.parametrize("model", [pytest.param("holonomic", marks=pytest.mark.accept), "car"])
def test_every_process_fault_leaves_the_same_trace(model: str, tmp_path: Path) -> None:
    scenario = {
        **COARSE,
        "duration": 16,
        "robots": [{"name": name, "model": model, "spare": name in SPARES or None} for name in (*NAMES, *SPARES)],
        "radio": {"trail": 2, "forget_after": 2},
        "patrol": {"options": {"separation": "claims"}},
        "faults": EVERYTHING,
    }
    one, many = one_and_many(scenario, tmp_path)
    journals = [read_journal(run.folder / "journal") for run in (one, many)]
    told = [[event for event in journal.events if event.kind != LOOKED_AT] for journal in journals]
    assert told[0] == told[1]
    looks = [[(e.robot, e.detail) for e in journal.events if e.kind == LOOKED_AT] for journal in journals]
    assert looks == [[], [(3, STOPPED)] * 3]  # twice paused, once to go on
    codes = {"the router": 0, "the world": 0, "anna": -9, "anna (2)": 0, "bert": -9, "bert (2)": 0}
    codes |= {"carl": 0, "dora": -9, "dora (2)": 0, "emil": 0, "fern": 0}
    assert many.summary["exit_codes"] == codes
    statuses = [facts["status"] for facts in many.summary["robots"].values()]
    assert statuses == ["alive", "alive", "paused", "alive", "left", "alive", "absent"]
    header, *lines = (many.folder / "ticks.csv").read_text(encoding="ascii").splitlines()
    last = dict(zip(header.split(","), lines[-1].split(","), strict=True))
    assert [last[name] for name in ("living", "paused", "dead", "lost", "away")] == ["4", "1", "0", "0", "2"]


def test_a_launcher_that_stops_nobody_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The world speaks to nobody who is paused, so that nothing else shows whether a process was stopped."""
    monkeypatch.setattr(child_control, "pause", lambda _child: None)
    faults = [{"kind": "pause", "who": "r2", "at": 2, "for": 2}]
    scenario = {**COARSE, "duration": 6, "robots": 2 * [{}], "faults": faults}
    run = fogwatch.run(scenario, out=tmp_path, in_process=False, picture=False)
    assert [check.name for check in run.verdict.failed] == ["the paused stand still"]
    assert "r2 was paused at tick 4, but its process has the state " in run.verdict.failed[0].detail


def test_a_planned_death_is_told_as_planned(start: Callable[..., Run]) -> None:
    run = start({**COARSE, "duration": 10, "robots": 3 * [{}], "faults": [{"kind": "kill", "who": "all", "at": 3}]})
    assert run.end() == 0, run.errors
    assert "tick 6: r2 dead: f1 kill" in run.errors
    assert "was killed by" not in run.errors
    assert run.summary()["ticks"] == 20
    assert set(run.statuses().values()) == {"dead"}


def test_another_death_beside_a_planned_one_is_named_and_the_others_go_on(start: Callable[..., Run]) -> None:
    run = start({**COARSE, "duration": 100_000, "robots": 3 * [{}], "faults": [{"kind": "kill", "who": "r1", "at": 3}]})
    run.until(lambda: run.ticks() > 20)
    os.kill(run.children()["r2"], signal.SIGKILL)
    assert run.process.stderr is not None
    assert any("r2 was killed by SIGKILL" in line for line in run.process.stderr)
    run.until(lambda: run.rows(2)[-1].status is Status.LOST)
    restart(run, "r2")
    run.until(lambda: run.rows(2)[-1].status is Status.ALIVE)
    run.interrupt()
    assert list(run.failed()) == ["nobody lost"]
    assert "r2" in run.failed()["nobody lost"]
    assert run.statuses() == {"r1": "dead", "r2": "alive", "r3": "alive"}
    assert run.rows(2)[0].status is Status.ALIVE
    assert run.summary()["robots"]["r3"]["decisions"] == run.summary()["ticks"]


@pytest.mark.parametrize(
    ("pace", "number"),
    [
        ("lockstep", signal.SIGINT),
        (10, signal.SIGINT),
        pytest.param("lockstep", signal.SIGTERM, marks=pytest.mark.accept),
    ],
)
def test_an_interrupted_run_lets_the_paused_go_ends_everything_and_can_be_read(
    pace: str | float, number: signal.Signals, start: Callable[..., Run]
) -> None:
    faults = [{"kind": "pause", "who": ["r1", "r2"], "at": 3}]
    run = start({**COARSE, "duration": 100_000, "pace": pace, "robots": 3 * [{}], "faults": faults})
    run.until(lambda: run.ticks() > 20)
    assert len(run.children()) == 5
    run.process.send_signal(number)
    assert run.end() == 130, run.errors
    assert not run.children()
    summary = run.summary()
    assert (summary["ended"], summary["ticks"] > 20) == ("interrupted", True)
    assert summary["exit_codes"] == dict.fromkeys(["the router", "the world", "r1", "r2", "r3"], 0)
    journal = read_journal(run.folder / "journal")
    assert journal.end is not None
    assert not journal.truncated


def test_a_run_can_be_interrupted_while_a_robot_is_started(start: Callable[..., Run]) -> None:
    run = start({**COARSE, "duration": 100_000, "robots": 2 * [{}]})
    run.until(lambda: run.ticks() > 20)
    first = run.children()["r1"]
    with closing(attached(run)) as operator:
        assert operator.control({"do": "fault", "fault": {"kind": "restart", "who": "r1"}}).done
        run.until(lambda: run.children().get("r1", first) != first)
        run.process.send_signal(signal.SIGINT)  # at once, while it loads
    assert run.end() == 130, run.errors
    assert not run.children()
    assert run.summary()["ended"] == "interrupted"
    assert run.summary()["exit_codes"]["r1"] == -9
    assert run.failed() == {}


def test_nothing_outlives_a_killed_launcher_not_even_a_paused_process(start: Callable[..., Run]) -> None:
    faults = acts(("pause", "r1", 3), ("restart", "r2", 4))
    run = start({**COARSE, "duration": 100_000, "robots": 2 * [{}], "faults": faults})
    run.until(lambda: run.ticks() > 20)
    run.process.kill()
    run.process.wait()
    run.until(lambda: not run.children())
    assert not (run.folder / "static").exists()
    assert len(run.records()) > 20


@pytest.mark.skipif(not can_fork(), reason="this system has no fork server")
def test_without_the_fork_server_a_run_goes_on_and_robots_are_still_started(start: Callable[..., Run]) -> None:
    run = start({**COARSE, "duration": 100_000, "robots": 2 * [{}]})
    run.until(lambda: run.ticks() > 20)
    os.kill(run.fork_server(), signal.SIGKILL)
    first = run.children()["r2"]
    restart(run, "r2")
    run.until(lambda: run.children().get("r2", first) != first)
    run.pass_ticks(20)
    run.interrupt()
    assert run.summary()["verdict"]["valid"], run.summary()["verdict"]
    codes = {"the router": 0, "the world": 0, "r1": 0, "r2": -9, "r2 (2)": 0}
    assert run.summary()["exit_codes"] == codes


def test_at_a_pace_robots_come_when_their_processes_are_there(start: Callable[..., Run]) -> None:
    faults = acts(("kill", "r1", 2), ("restart", "r1", 4), ("join", "r2", 4), ("leave", "r4", 6))
    faults.append({"kind": "pause", "who": "r3", "at": 2, "for": 6})
    run = start({**COARSE, "duration": 100_000, "pace": 5, "robots": 4 * [{}], "faults": faults})
    run.until(lambda: run.ticks() > 16)
    for number in (1, 2, 3):  # the last of them to come back does so before tick 16
        run.until(lambda: any(row.decision_ms is not None for row in run.rows(number, 16)))  # noqa: B023 - asked at once
    run.interrupt()
    summary = run.summary()
    assert summary["verdict"]["valid"], summary["verdict"]
    assert run.statuses() == {"r1": "alive", "r2": "alive", "r3": "alive", "r4": "left"}
    assert summary["exit_codes"]["r1"] == -9
    assert set(summary["exit_codes"].values()) == {0, -9}


def test_the_router_and_agents_die_in_turn_at_a_pace(start: Callable[..., Run]) -> None:
    """Robots that cannot be reached stop; they drive again when the router is back; the dead are named."""
    run = start({**COARSE, "duration": 100_000, "pace": 10, "watchdog": 1.0, "robots": 3 * [{}]})
    run.until(lambda: run.ticks() > 20)
    before = run.ticks()
    run.process.send_signal(signal.SIGSTOP)  # nobody starts another router, for as long as it takes
    last = run.children()["fogwatch.router"]
    os.kill(last, signal.SIGKILL)
    run.until(lambda: each(run, before, _stands))
    stopped = run.ticks()
    run.process.send_signal(signal.SIGCONT)
    run.until(lambda: run.children().get("fogwatch.router", last) != last)
    os.kill(run.children()["fogwatch.router"], signal.SIGKILL)
    run.until(lambda: each(run, stopped, _drives))
    assert {row.status for tick in run.records() for row in tick.robots} == {Status.ALIVE}
    for dead in ("r1", "r2"):
        os.kill(run.children()[dead], signal.SIGKILL)
        run.until(lambda: run.rows(int(dead[1]))[-1].status is Status.LOST)  # noqa: B023 - asked at once
    at = run.ticks()
    run.until(lambda: any(_drives(row) for row in run.rows(3, at)))
    os.kill(run.children()["r3"], signal.SIGKILL)
    assert run.end() == 1, run.errors  # nobody is left to wait for
    assert not run.children()
    assert run.errors.count("router was killed by SIGKILL") == 2
    failed = run.failed()
    assert set(failed) == {"complete", "nobody lost"}
    assert failed["complete"].endswith("nobody is living any more")
    assert all(name in failed["nobody lost"] for name in ("r1", "r2", "r3"))


def _stands(row: RobotTick) -> bool:
    return row.c0 == row.c1 == 0.0 and row.decision_ms is None


def _drives(row: RobotTick) -> bool:
    return row.decision_ms is not None and (row.c0, row.c1) != (0.0, 0.0)


@pytest.mark.parametrize("pace", ["lockstep", pytest.param(10, marks=pytest.mark.accept)])
def test_a_dead_world_ends_the_run_unjudged_whatever_is_under_way(pace: str | float, start: Callable[..., Run]) -> None:
    faults = [{"kind": "pause", "who": "r1", "at": 3}, {"kind": "kill", "who": "r2", "at": 4}]
    scenario = {**COARSE, "duration": 100_000, "pace": pace, "robots": 3 * [{}], "faults": faults}
    run = start(scenario, "--recording", "--report")
    run.until(lambda: run.ticks() > 20)
    os.kill(run.children()["worldsim"], signal.SIGKILL)
    assert run.end() == 3, run.errors
    assert not run.children()
    summary = run.summary()
    assert summary["verdict"]["outcome"] == "unknown"
    assert summary["ticks"] > 20
    assert summary["robots"]["r2"]["status"] == "dead"
    assert summary["exit_codes"]["the world"] == -9
    assert "the world was killed by SIGKILL" in run.errors
    killed = open_run(run.folder)
    assert (killed.ended, killed.ticks > 20) == (None, True)
    assert play(killed, []) is None, "its fog is the one that was measured, tick by tick"
    player = Player(killed)
    for k in (killed.ticks - 1, 3, killed.ticks // 2):
        assert player.control({"do": "seek", "k": k}).done
        state = player.wait(60.0)
        assert state is not None
        assert (state.k, state.mfow_s) == (k, killed.mfow[k] * killed.step)
    recorded = read_recording(run.folder / "recording.mcap")
    assert recorded.is_whole
    assert recorded.facts["ended"] == "cut off"
    assert len(recorded.topics["/mfow"]) == len(recorded.topics["/r1/pose"]) == killed.ticks
    assert "The run was cut off" in (run.folder / "report.html").read_text(encoding="utf-8")
