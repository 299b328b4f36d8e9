"""A router that stands still, and goes on: nobody is lost for it, and a run in lockstep is the same as without."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

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


def test_in_lockstep_nothing_changes(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000})
    stall(run)
    run.pass_ticks(20)
    run.interrupt()
    run.assert_undisturbed()
    end = read_journal(run.folder / "journal").end
    assert end is not None
    assert end.notes["router_silent_s"] > 10.0


def test_at_a_pace_robots_miss_their_deadlines_and_none_is_lost(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000, "pace": 4})
    stall(run)
    run.pass_ticks(20)
    run.interrupt()
    summary = run.summary()
    assert {robot["status"] for robot in summary["robots"].values()} == {"alive"}
    end = read_journal(run.folder / "journal").end
    assert end is not None
    assert end.notes["router_silent_s"] > 10.0
    assert all(missed > 10 for missed in end.notes["late_commands"].values())
    assert len(end.notes["late_commands"]) == 3
    assert summary["verdict"]["warnings"][0].startswith("the router did not answer for ")
