import math
import os
import urllib.request
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from patrol.errors import BadInput
from patrol.scenario import load_scenario
from runtime.process.context import AskedToLeave, PortTaken, ProcessContext, run_with
from runtime.process.lifeline import Ending
from runtime.process.options import Meeting, ProcessParser
from runtime.reporting.logs import Log
from runtime.security.credentials import Credentials
from runtime.security.keys import fleet_keys
from runtime.security.mesh import Mesh
from runtime.security.roles import robot_role
from runtime.starting.readiness import StartFailure, StartPipe, StartReport


@pytest.fixture(autouse=True)
def no_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.process.context.heed", lambda *_, **__: Ending())


def parsed(*words: str) -> Namespace:
    return ProcessParser("python -m test", "", "", reports_start=True).parse_args(words)


def raising(error: Exception) -> Callable[[ProcessContext], int]:
    def work(_: ProcessContext) -> int:
        raise error

    return work


def test_the_exit_code_is_that_of_the_work_and_what_it_opened_is_closed() -> None:
    closed: list[str] = []

    def work(process: ProcessContext) -> int:
        process.closing.callback(closed.append, "first")
        process.closing.callback(closed.append, "second")
        return 7

    assert run_with(parsed(), "test", work) == 7
    assert closed == ["second", "first"]


@pytest.mark.parametrize(
    ("error", "failure"),
    [(BadInput("no such file"), StartFailure.OTHER), (PortTaken("the port is busy"), StartFailure.PORT_BUSY)],
)
def test_bad_input_is_one_line_and_the_launcher_learns_of_it(
    error: BadInput, failure: StartFailure, capsys: pytest.CaptureFixture[str]
) -> None:
    start = StartPipe()
    options = parsed("--ready", str(os.dup(start.child_end)))
    assert run_with(options, "test", raising(error)) == 2
    assert capsys.readouterr().err == f"test: {error}\n"
    assert run_with(parsed("--health", "0"), "test", raising(AssertionError())) == 2
    assert capsys.readouterr().err == "test: --health 0: give from 0.1 to 86400 seconds\n"
    assert start.report() == StartReport("", failure, str(error))
    start.close()


def test_a_process_that_is_asked_to_leave_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_with(parsed(), "test", raising(AskedToLeave())) == 130
    assert capsys.readouterr().err == ""


def test_metrics_and_log_have_the_name_that_the_process_has_learnt(capsys: pytest.CaptureFixture[str]) -> None:
    def work(process: ProcessContext) -> int:
        process.follow("r1", fleet="yards-1")
        address = capsys.readouterr().err.removeprefix("r1: metrics at ").strip()
        with urllib.request.urlopen(address, timeout=300.0) as answer:
            assert 'process="r1",fleet="yards-1"' in answer.read().decode()
        told.append(address)
        raise BadInput("too late")

    told: list[str] = []
    assert run_with(parsed("--metrics", "127.0.0.1:0"), "agent", work) == 2
    assert capsys.readouterr().err == "r1: too late\n"
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(told[0], timeout=300.0)


def test_a_process_that_was_revoked_and_connects_again_and_again_fills_no_log(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = Mesh("f", {"robot-r1.1": robot_role("r1"), "robot-r2.2": robot_role("r2")}, {})
    tells: list[Callable[[str, bool], None]] = []
    link = SimpleNamespace(mesh=mesh, neighbours=SimpleNamespace(names=(), tell=tells.append), close=list)
    monkeypatch.setattr("runtime.net.open_links.open_links", lambda *_: (link, link))
    clock_s = [0.0]
    monkeypatch.setattr("runtime.process.context.time", SimpleNamespace(monotonic=lambda: clock_s[0]))
    met = Meeting("", fleet_keys("f"), Credentials("f", "", robot_role("r1"), mesh=mesh))
    ProcessContext(Namespace(wait=60.0), Log("r1"), Ending()).open_links(met)
    for clock_s[0] in (0.0, 5.0, 12.0):
        for name in ("robot-r2.1", "robot-r1.1", "robot-r2.2"):
            tells[0](name, True)
            tells[0](name, False)
    warnings = [
        "r1: robot-r2.1 connects: no member, so what it sends is refused",
        "r1: another process is r1 as well; end it, or revoke r1: it has a copy",
    ]
    member = ["r1: r2 is connected", "r1: r2 is no longer connected"]
    assert capsys.readouterr().err.splitlines() == [*warnings, *member, *member, *warnings, *member]


class Leaving(Ending):
    """Remembers how long somebody would have waited, and does not."""

    limit_s = 0.0

    def wait_for(self, path: Path, limit_s: float = math.inf) -> bool:
        self.limit_s = limit_s
        self.ask("enough")
        return path.exists()


@pytest.mark.parametrize(("lifeline", "limit_s"), [(5, math.inf), (None, 60.0)])
def test_static_fields_are_waited_for_as_long_as_there_is_a_launcher(
    lifeline: int | None, limit_s: float, tmp_path: Path
) -> None:
    """It computes them while agents start; a large map takes it minutes."""
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 1}})
    ending = Leaving()
    options = Namespace(static=tmp_path / "static", wait=60.0, lifeline=lifeline)
    with pytest.raises(AskedToLeave):
        ProcessContext(options, Log("r1"), ending).prepare(scenario)
    assert ending.limit_s == limit_s


def test_a_process_that_prepares_by_itself_says_what_was_assumed(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 1.0, "robots": {"count": 1, "radius": 0.5}})
    ProcessContext(Namespace(), Log("r1"), Ending()).prepare(scenario)
    given, assumed = capsys.readouterr().err.splitlines()
    assert given == "r1: given: radius 0.5 m, points of 1 m"
    sensor = "sensor of 10 m (all round, stopped by walls)"
    assert assumed == f"r1: assumed: car, speed 4.4 m/s, turning radius 3.5 m, {sensor}, steps of 0.5 s (auto)"
