"""A router that stands still, and goes on: nobody is lost for it, and a run in lockstep is the same as without."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping
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
    run = start({**OPEN, "duration": 100_000})
    silences(run)
    run.assert_undisturbed()


def test_at_a_pace_robots_miss_their_deadlines_and_none_is_lost(start: Callable[..., Run]) -> None:
    run = start({**OPEN, "duration": 100_000, "pace": 4})
    late = silences(run)["late_commands"]
    assert set(run.statuses().values()) == {"alive"}
    assert len(late) == 3
    assert all(missed > 10 for missed in late.values())
    assert run.summary()["verdict"]["warnings"][0].startswith("the router did not answer for ")
