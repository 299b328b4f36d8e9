"""Whole fleets as real processes over real Zenoh: what they do when everything is well, and when something dies."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from patrol.exchange import Sensed
from patrol.journal import Status
from patrol.pose import Pose
from runtime.messages.phases import PhaseA, encode
from runtime.security.private_files import new_key
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run

pytestmark = pytest.mark.processes

OPEN: dict[str, Any] = {**COARSE, "point": 0.5, "duration": 100_000, "robots": {"count": 2, "model": "holonomic"}}

MADE_MAP = "P2\n24 20\n255\n" + "\n".join(
    " ".join("0" if x in (0, 23) or y in (0, 19) or (x == 12 and 4 < y < 15) else "254" for x in range(24))
    for y in range(20)
)

MODELS_ON_TERRAINS = [
    (model, terrain)
    for terrain in ("open", "yards", "made")
    for model in ("holonomic", "differential", "car")
    if (model, terrain) != ("holonomic", "open")
]


@pytest.mark.parametrize(
    ("model", "terrain"),
    [
        pytest.param("holonomic", "open", marks=pytest.mark.kind("lockstep")),
        ("mixed", "made"),
        *(pytest.param(*both, marks=pytest.mark.accept) for both in MODELS_ON_TERRAINS),
    ],
)
def test_a_run_is_the_same_as_processes_and_in_one(
    model: str, terrain: str, start: Callable[..., Run], tmp_path: Path
) -> None:
    (tmp_path / "made.pgm").write_text(MADE_MAP, encoding="ascii")
    (tmp_path / "made.yaml").write_text(
        "image: made.pgm\nresolution: 1.0\norigin: [-3, 2, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n",
        encoding="utf-8",
    )
    where = {"map": str(tmp_path / "made.yaml")} if terrain == "made" else {"builtin": terrain}
    models = ("holonomic", "differential", "car") if model == "mixed" else (model,) * 3
    scenario = {**OPEN, "terrain": where, "duration": 30, "robots": [{"model": one} for one in models]}
    run = start(scenario)
    assert run.end() == 0, run.errors
    assert (run.summary()["ended"], run.summary()["ticks"]) == (
        "completed",
        120 if terrain == "made" else 60,  # on a map with little room a step is half as long
    )
    run.assert_undisturbed()
    again = fogwatch.run(run.folder / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == run.summary()["trace_hash"]


EVERYTHING = ["claims", "artificial-obstacles", "semaphores", "repulsion"]


@pytest.mark.parametrize(
    ("rules", "keyed"),
    [
        pytest.param({"paths": "regions", "fuzzy": True, "separation": EVERYTHING}, True, id="regions"),
        pytest.param({"paths": "straight", "direction": "vector"}, False, id="straight", marks=pytest.mark.accept),
    ],
)
def test_so_it_is_under_other_rules(
    rules: dict[str, Any], keyed: bool, start: Callable[..., Run], tmp_path: Path
) -> None:
    new_key(tmp_path / "fleet.key")
    scenario = {**OPEN, "terrain": {"builtin": "yards"}, "duration": 30}
    patrol = {"policy": "potential-field", "avoidance": "none", "options": {**rules, "random_move": 0.3}}
    radio = {"trail": 2, "key": str(tmp_path / "fleet.key") if keyed else None}
    run = start({**scenario, "patrol": patrol, "radio": radio})
    assert run.end() == 0, run.errors
    assert run.summary()["ticks"] == 60
    run.assert_undisturbed()


def test_a_paused_agent_changes_nothing(start: Callable[..., Run]) -> None:
    once = len(encode(PhaseA(1, 2**62, 20, 2**62, Sensed(20, Pose(1.0, 2.0, 3.0)))))
    run = start(OPEN)
    run.until(lambda: run.ticks() > 20)
    agent = run.children()["r2"]
    os.kill(agent, signal.SIGSTOP)
    before = run.ticks()
    # Before the answer comes one message, less than thrice as long with all that Zenoh adds; then the same again.
    run.until(lambda: run.unread(agent) > 3 * once)
    assert run.ticks() <= before + 2
    os.kill(agent, signal.SIGCONT)
    run.pass_ticks(20)
    run.interrupt()
    run.assert_undisturbed()


def test_a_router_that_dies_is_started_again_and_nothing_changes(start: Callable[..., Run]) -> None:
    run = start(OPEN)
    run.until(lambda: run.ticks() > 20)
    first = run.children()["fogwatch.router"]
    os.kill(first, signal.SIGKILL)
    run.until(lambda: run.children().get("fogwatch.router", first) != first)
    run.pass_ticks(20)
    run.interrupt()
    assert "router was killed by SIGKILL" in run.errors
    run.assert_undisturbed()


def test_a_robot_may_have_any_name(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 2, "robots": [{"name": "world"}, {"name": "router"}]})
    assert run.end() == 0, run.errors
    assert set(run.summary()["exit_codes"]) == {"the router", "the world", "world", "router"}
    logs = {path.name for path in (run.folder / "logs").iterdir()}
    assert logs == {"fork-server.log", "router.log", "world.log", "robot-router.log", "robot-world.log"}


def test_an_agent_that_dies_before_the_run_begins_ends_it_with_a_reason(start: Callable[..., Run]) -> None:
    run = start(OPEN)
    run.until(lambda: "worldsim" in run.children())
    world = run.children()["worldsim"]
    os.kill(world, signal.SIGSTOP)  # so that it cannot begin
    run.until(lambda: "r1" in run.children())
    os.kill(run.children()["r1"], signal.SIGKILL)
    os.kill(world, signal.SIGCONT)
    assert run.end() == 3, run.errors
    assert "the run could not begin: r1 was killed by SIGKILL\n" in run.errors  # and left nothing in its log
    assert not run.children()


def test_a_run_can_be_interrupted_before_it_begins(start: Callable[..., Run]) -> None:
    run = start(OPEN)
    run.until(lambda: len(run.children()) == 4)
    run.interrupt()
    assert run.errors.endswith("fogwatch: interrupted\n")
    run.until(lambda: not run.children())
    assert run.summary()["ended"] == "interrupted" if run.folder.exists() else True


@pytest.mark.parametrize(("robots", "number"), [(2, signal.SIGINT), (40, signal.SIGTERM)])
def test_a_run_can_be_interrupted_while_it_prepares(
    robots: int, number: signal.Signals, start: Callable[..., Run]
) -> None:
    """A fleet of two is spawned before its terrain is ready, one of 40 afterwards."""
    run = start({**OPEN, "point": 0.1, "robots": {"count": robots, "model": "holonomic"}})
    run.until((run.folder / "scenario.yaml").exists)
    run.process.send_signal(number)
    assert run.end() == 130, run.errors
    assert run.errors.endswith("fogwatch: interrupted\n")
    # On a busy machine the signal may come when the run has begun; only then is there anything to keep.
    assert not run.folder.exists() or run.summary()["ended"] == "interrupted"
    run.until(lambda: not run.children())


def test_a_second_signal_ends_at_once(start: Callable[..., Run]) -> None:
    run = start(OPEN)
    run.until(lambda: run.ticks() > 20)
    for pid in run.children().values():
        os.kill(pid, signal.SIGSTOP)  # nobody leaves in order
    run.process.send_signal(signal.SIGINT)
    run.process.send_signal(signal.SIGTERM)
    assert run.end() == 130, run.errors
    assert not run.children()


@pytest.mark.kind("paced")
def test_a_paced_run_waits_for_nobody_and_counts(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "pace": 20, "watchdog": 1.0})
    run.until(lambda: run.ticks() > 10)
    agent = run.children()["r1"]
    os.kill(agent, signal.SIGSTOP)
    stopped = run.ticks()
    run.until(lambda: run.ticks() > stopped + 50)
    going = run.ticks()
    os.kill(agent, signal.SIGCONT)
    run.until(lambda: any(decisions(run, 1, going)))
    run.interrupt()
    summary = run.summary()
    assert summary["realtime_factor"] < 20 * 1.1, "it does not wait for the next tick"
    assert summary["deadlines"]["late_commands"]["r1"] >= 49
    rows = run.rows(1)
    assert any((row.c0, row.c1) == (0.0, 0.0) for row in rows[stopped:going]), "the watchdog did not stop it"
    assert all(row.status is Status.ALIVE for row in rows)


def test_at_a_pace_a_paused_agent_silences_nobody_else(start: Callable[..., Run]) -> None:
    """Its queues fill up after some hundreds of ticks; whoever waits for room in them then serves nobody.

    tests/accept/test_pace.py measures for how long the others decide nothing, on a quiet machine.
    """
    run = start({**OPEN, "pace": 100, "robots": {"count": 3, "model": "holonomic"}})
    run.until(lambda: run.ticks() > 50)
    paused = run.children()["r1"]
    os.kill(paused, signal.SIGSTOP)
    run.pass_ticks(1500)
    assert run.unread(paused) > 0
    full = run.ticks()
    for number in (2, 3):
        run.until(lambda: any(decisions(run, number, full)))  # noqa: B023 - asked at once
    os.kill(paused, signal.SIGCONT)
    run.interrupt()
    assert set(run.summary()["exit_codes"].values()) == {0}


def decisions(run: Run, number: int, first: int) -> list[bool]:
    """Of each tick so far from the first on, whether the robot decided in it."""
    return [row.decision_ms is not None for row in run.rows(number, first)]
