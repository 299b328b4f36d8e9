"""A router that stands still, and goes on: nobody is lost for it, and a run in lockstep is the same as without."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import fogwatch
from patrol.journal import read_journal
from tests.fleets import COARSE

if TYPE_CHECKING:
    from tests.fogwatch.conftest import Run

pytestmark = pytest.mark.processes

OPEN: dict[str, Any] = {**COARSE, "point": 0.5, "robots": {"count": 3, "model": "holonomic"}}


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


def test_in_lockstep_nothing_changes(start: Callable[..., Run], tmp_path: Path) -> None:
    scenario = {**OPEN, "duration": 600}
    run = start(scenario)
    stall(run)
    assert run.end() == 0, run.errors
    assert run.summary()["verdict"]["valid"]
    assert run.summary()["trace_hash"] == fogwatch.run(scenario, out=tmp_path / "one", picture=False).trace_hash
    end = read_journal(run.folder / "journal").end
    assert end is not None
    assert end.notes["router_silent_s"] > 10.0


def test_at_a_pace_robots_miss_their_deadlines_and_none_is_lost(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000, "pace": "realtime"})
    stall(run)
    ticks = run.ticks()
    run.until(lambda: run.ticks() > ticks + 20)
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130, run.errors
    summary = run.summary()
    assert {robot["status"] for robot in summary["robots"].values()} == {"alive"}
    end = read_journal(run.folder / "journal").end
    assert end is not None
    assert end.notes["router_silent_s"] > 10.0
    assert all(missed > 10 for missed in end.notes["late_commands"].values())
    assert len(end.notes["late_commands"]) == 3
