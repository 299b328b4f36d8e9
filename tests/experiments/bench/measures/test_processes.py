"""Fleets as processes in benchmarks: what is waited for, and that every process ends."""

from __future__ import annotations

import pytest

from experiments.bench.measures.processes import (
    WITHOUT_FILES,
    _await_line,
    _memory,
    _newest_agent,
    _program,
    _runs,
    _start_up,
    fleet,
)
from experiments.bench.tools.measure import QUICK, Unmeasured
from experiments.bench.tools.procfs import family_of, memory_of

pytestmark = [pytest.mark.processes, pytest.mark.accept]

FAST = ("open", "--robots", "2", "--model", "holonomic", "--point", "1", *WITHOUT_FILES)


def test_a_fleet_runs_until_the_block_is_left() -> None:
    with fleet(*FAST, "--duration", "5000") as (process, folder):
        _await_line(process, folder, 5)
        programs = sorted(_program(one) for one in family_of(process.pid))
        assert programs == ["agent", "agent", "agent.fork_server", "fogwatch", "fogwatch.router", "worldsim"]
        agent = _newest_agent(process, "r2", 1)
        assert memory_of(agent.pid).rss > 10.0
        with pytest.raises(Unmeasured, match="found no process of robot r3"):
            _newest_agent(process, "r3", 1)
    assert process.returncode == 130
    assert not folder.exists()


def test_whole_runs_starts_and_memory_are_measured() -> None:
    coarse = ("--point", "1")
    for measured, readings in (
        (_runs("open", (*coarse, *WITHOUT_FILES), QUICK), 1),
        (_start_up("open", QUICK, coarse), 2),
    ):
        assert all(len(one.values) == readings and min(one.values) > 0.0 for one in measured)
    held = {one.name: one.values for one in _memory("open", QUICK, coarse)}
    assert len(held["an agent, resident"]) == 5
    assert len(held["the world, resident"]) == len(held["the router, resident"]) == 1
    for rss, pss, own in zip(
        *(held[f"an agent, {what}"] for what in ("resident", "its share (PSS)", "of its own")), strict=True
    ):
        assert 0.0 < own <= pss <= rss


def test_a_run_that_ends_too_early_is_not_waited_for() -> None:
    with (
        fleet(*FAST, "--duration", "2") as (process, folder),
        pytest.raises(Unmeasured, match="fogwatch run ended with 0 before tick 50"),
    ):
        _await_line(process, folder, 50)
