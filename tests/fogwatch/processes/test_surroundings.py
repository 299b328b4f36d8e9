"""Fleets in bad surroundings: a full disk, a run folder that is moved away, and a router that stands still."""

import os
import shutil
import signal
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

from patrol.journal import read_journal
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run
from tests.full_disk import full_disk

pytestmark = pytest.mark.processes

OPEN: dict[str, Any] = {**COARSE, "robots": {"count": 2, "model": "holonomic"}}
THREE: dict[str, Any] = {**COARSE, "point": 0.5, "robots": {"count": 3, "model": "holonomic"}}


@pytest.fixture
def small_files() -> Iterator[None]:
    """No file of a process that is started here grows beyond 100 kB."""
    with full_disk(100_000):
        yield


@pytest.mark.usefixtures("small_files")
def test_a_run_that_cannot_be_recorded_says_why_and_leaves_no_half_recording(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000}, "--recording")
    assert run.end() == 3, run.errors
    said = "the run cannot be recorded any more (File too large), so it ends here; make room"
    assert any(": not recorded: " in line and said in line for line in run.errors.splitlines()), "also without its log"
    assert "Traceback" not in run.errors
    assert not list(run.folder.glob("*.part"))
    verdict = run.summary()["verdict"]
    assert verdict["outcome"] == "unknown"
    assert verdict["checks"][0]["detail"].endswith("without an end record"), "no half record is left"


def test_a_folder_that_is_moved_away_gets_its_summary(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000})
    run.until(lambda: run.ticks() > 20)
    moved = run.folder.with_name("elsewhere")
    run.folder.rename(moved)
    run.interrupt()
    assert f"the run's folder was moved to {moved}; the summary is written there" in run.errors
    run.folder = moved
    assert run.summary()["ended"] == "interrupted"
    assert not (moved / "control.json").exists()


def test_a_folder_that_is_deleted_is_reported(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000})
    run.until(lambda: run.ticks() > 20)
    shutil.rmtree(run.folder)
    os.kill(run.process.pid, signal.SIGINT)
    assert run.end() != 0
    assert "the run's folder was moved away or deleted" in run.errors
    assert "Traceback" not in run.errors


def stall(run: Run) -> None:
    """Stop the router for longer than any robot may take to answer."""
    log = run.folder / "logs" / "world.log"
    run.until(lambda: run.ticks() > 20)
    router = run.children()["fogwatch.router"]
    os.kill(router, signal.SIGSTOP)
    try:
        run.until(lambda: log.read_text(encoding="utf-8").count("the router has not answered for") == 2)
    finally:
        os.kill(router, signal.SIGCONT)
    run.until(lambda: "the router answers again" in log.read_text(encoding="utf-8"))


def silences(run: Run) -> Mapping[str, Any]:
    """The notes of a run that has gone on after its router's silence."""
    stall(run)
    run.pass_ticks(20)
    run.interrupt()
    end = read_journal(run.folder / "journal").end
    assert end is not None
    assert end.notes["router_silent_s"] > 10.0
    return end.notes


def test_in_lockstep_nothing_changes(start: Callable[..., Run]) -> None:
    run = start({**THREE, "duration": 100_000})
    silences(run)
    run.assert_undisturbed()


def test_at_a_pace_robots_miss_their_deadlines_and_none_is_lost(start: Callable[..., Run]) -> None:
    run = start({**THREE, "duration": 100_000, "pace": 4})
    late = silences(run)["late_commands"]
    assert set(run.statuses().values()) == {"alive"}
    assert len(late) == 3
    assert all(missed > 10 for missed in late.values())
    assert run.summary()["verdict"]["warnings"][0].startswith("the router did not answer for ")
