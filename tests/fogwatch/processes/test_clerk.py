"""The clerk of a run as processes: its verdict is that of the finished journal, and nothing depends on it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import fogwatch.launch.clerk_child
from fogwatch.api import RunOptions, execute
from fogwatch.launch.children import Child, Children
from fogwatch.launch.clerk_child import CLERK, ClerkChild
from fogwatch.launch.launcher import WORLD
from fogwatch.notebook.run import Run
from fogwatch.terminal.live_table import SilentDisplay
from patrol.journal import read_journal
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from patrol.scenario.controls import OPERATOR
from tests.fleets import COARSE
from worldsim.verdict.judge import Verdict, judge

pytestmark = pytest.mark.processes

PATIENCE_S = 600.0
"""How long the clerk may say nothing, on a machine with much else to do."""

PACED = {**COARSE, "pace": 4.0, "duration": 5000}


class Lines(SilentDisplay):
    """A display that keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def say(self, line: str) -> None:
        self.lines.append(line)


class Stage:
    """A run whose clerk starts with its first tick, and what a test wants to know of it.

    Attributes:
        clerk: The launcher's side of the clerk; None before the run begins.
        started: The processes of the run by name.
        display: What the run shows.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.clerk: ClerkChild | None = None
        self.started: dict[str, Child] = {}
        self.display = Lines()

    def loaded(self) -> bool:
        """Whether the clerk is at work."""
        return self.clerk is not None and self.clerk.loaded

    def kill(self, name: str) -> None:
        """Kill the clerk, or another process of the run, and wait for its end."""
        self.started[name].process.kill()
        self.started[name].process.wait()

    def run(self, stop: Callable[[], bool], scenario: dict[str, Any] = PACED, **options: Any) -> Run:
        """Run a scenario until `stop` says so."""
        files = {"picture": False, "recording": False, "report": False, "page": False}
        given = {**files, "display": self.display, "stop": stop, **options}
        return execute(load_scenario(scenario), RunOptions(self.folder, **given))

    def finished(self, result: Run) -> Verdict:
        """The verdict of the finished journal."""
        prepared = prepare(load_scenario(self.folder / "scenario.yaml"))
        return judge(read_journal(self.folder / "journal"), result.summary["exit_codes"], prepared)


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stage:
    """The run's clerk starts at once and as fast as anything, and is known to the test."""
    staged = Stage(tmp_path / "run")
    monkeypatch.setattr(fogwatch.launch.clerk_child, "AFTER_S", 0.0)
    monkeypatch.setattr(fogwatch.launch.clerk_child, "NICE", 0)
    monkeypatch.setattr(fogwatch.launch.clerk_child, "SILENT_S", PATIENCE_S)
    begun, spawn = ClerkChild.__init__, Children.spawn

    def begin(self: ClerkChild, *arguments: Any, **options: Any) -> None:
        staged.clerk = self
        begun(self, *arguments, **options)

    def start(self: Children, name: str, *arguments: Any, **more: Any) -> Child:
        staged.started[name] = spawn(self, name, *arguments, **more)
        return staged.started[name]

    monkeypatch.setattr(ClerkChild, "__init__", begin)
    monkeypatch.setattr(Children, "spawn", start)
    return staged


@pytest.fixture
def by_the_clerk_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is an error if the launcher judges."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("the launcher judges although there is a clerk")

    monkeypatch.setattr("worldsim.verdict.judge.judge", refuse)


@pytest.mark.usefixtures("by_the_clerk_alone")
def test_the_clerk_gives_verdict_summary_and_report(stage: Stage) -> None:
    result = stage.run(stage.loaded, report=True)
    assert result.interrupted
    assert result.verdict.valid
    assert result.verdict == stage.finished(result)
    summary = json.loads((stage.folder / "summary.json").read_text(encoding="utf-8"))
    assert summary == json.loads(json.dumps(result.summary))
    assert ">valid</span>" in (stage.folder / "report.html").read_text(encoding="utf-8")
    assert not list(stage.folder.glob("*.part"))
    assert not (stage.folder / "logs" / "clerk.log").read_text(encoding="utf-8")


@pytest.mark.accept
def test_a_clerk_that_is_killed_during_the_run_is_not_missed(stage: Stage) -> None:
    def stop() -> bool:
        if not stage.loaded():
            return False
        stage.kill(CLERK)
        return True

    result = stage.run(stop, report=True)
    assert result.verdict.valid
    assert result.verdict == stage.finished(result)
    assert ">valid</span>" in (stage.folder / "report.html").read_text(encoding="utf-8")


def test_a_clerk_that_is_killed_before_the_report_is_not_missed(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    begin_report = ClerkChild.begin_report

    def kill_then_begin(self: ClerkChild) -> bool:
        stage.kill(CLERK)
        return begin_report(self)

    monkeypatch.setattr(ClerkChild, "begin_report", kill_then_begin)
    assert stage.run(stage.loaded, report=True).verdict.valid
    assert ">valid</span>" in (stage.folder / "report.html").read_text(encoding="utf-8")


def test_a_clerk_that_says_nothing_is_given_up(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fogwatch.launch.clerk_child, "SILENT_S", 0.0)

    def stop() -> bool:
        if not stage.loaded():
            return False
        stage.started[CLERK].process.send_signal(signal.SIGSTOP)
        return True

    result = stage.run(stop, report=True)
    assert result.verdict.valid
    assert result.verdict == stage.finished(result)
    assert (stage.folder / "report.html").exists()


def test_a_clerk_that_cannot_start_is_no_reason_to_end_a_run(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    spawn, refused = Children.spawn, []

    def no_room_for_a_clerk(self: Children, name: str, *arguments: Any, **more: Any) -> Child:
        if name == CLERK:
            refused.append(name)
            raise BlockingIOError("no room for one more process")
        return spawn(self, name, *arguments, **more)

    monkeypatch.setattr(Children, "spawn", no_room_for_a_clerk)
    assert stage.run(lambda: bool(refused)).verdict.valid
    assert refused == [CLERK]


@pytest.mark.usefixtures("by_the_clerk_alone")
def test_a_run_whose_world_is_killed_is_unknown_to_the_clerk_too(stage: Stage) -> None:
    def stop() -> bool:
        if stage.loaded():
            stage.kill(WORLD)
        return False

    result = stage.run(stop)
    assert result.verdict.outcome == "unknown"
    assert result.summary["exit_codes"]["the world"] == -signal.SIGKILL


class Operator:
    """Adds a fault once the clerk is at work, and ends the run when that is in the journal; used as ``stop``."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._asked = False
        self._over = False

    def __call__(self) -> bool:
        if self._over or not self._stage.loaded():
            return False
        if not self._asked:
            words = ["control", str(self._stage.folder), "fault", "{kind: loss, rate: 0.5}"]
            subprocess.run([sys.executable, "-P", "-m", "fogwatch", *words], check=True, capture_output=True)
            self._asked = True
        self._over = any(event.kind == OPERATOR for event in read_journal(self._stage.folder / "journal").events)
        return self._over


@pytest.mark.usefixtures("by_the_clerk_alone")
def test_faults_that_an_operator_adds_are_judged_by_the_clerk(stage: Stage) -> None:
    result = stage.run(Operator(stage))
    assert result.verdict == stage.finished(result)
    assert "refused frames" in [check.name for check in result.verdict.checks]


def test_the_recovery_from_an_operators_first_fault_is_judged_too(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scenario has no fault, so a clerk was started, which does not know of the second run."""
    second_runs: list[Prepared] = []
    monkeypatch.setattr("fogwatch.inprocess.fault_free_mfow", lambda given, _: second_runs.append(given))
    assert stage.run(Operator(stage), recovery=True).verdict.valid
    assert [given.scenario.faults[0].kind for given in second_runs] == ["loss"]
