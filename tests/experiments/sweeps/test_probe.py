"""The estimate of a sweep's time: runs are tried as they will be made, and what is loaded once does not count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.sweeps import progress
from experiments.sweeps.plan import Base, Case, Run, make_plan
from experiments.sweeps.progress import seconds_per_run
from experiments.sweeps.worker import run_task
from fogwatch.inprocess import Outcome, run_in_process
from patrol.prepare import Prepared
from patrol.scenario import Scenario, as_mapping

# Not the product's own, so that a wrong one there is noticed.
LOADING_TICKS = 2
TICKS = 100

ROBOTS = {"count": 2, "model": "holonomic"}
BASE = {"terrain": {"builtin": "open"}, "point": 1, "step": 0.5, "duration": 400, "robots": ROBOTS}
LOADING_S, TICK_S = 1000.0, 0.25


def runs(*cases: dict[str, object]) -> Sequence[Run]:
    named = [Case(str(number), case) for number, case in enumerate(cases)]
    return make_plan("trial", Base(BASE, Path(), "trial"), named, (1,)).runs


class Machine:
    """One on which the first run loads something and each tick takes its time."""

    def __init__(self) -> None:
        self.now = 0.0
        self.ticks: list[int] = []

    def run(self, scenario: Scenario | Prepared, games: bool) -> None:
        assert not games
        ticks = (scenario.scenario if isinstance(scenario, Prepared) else scenario).ticks
        self.now += ticks * TICK_S + (0.0 if self.ticks else LOADING_S)
        self.ticks.append(ticks)


def test_what_the_first_run_loads_is_not_part_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine()
    monkeypatch.setattr(progress, "run_scenario", machine.run)
    monkeypatch.setattr(progress, "ENOUGH_S", 1e9)
    assert seconds_per_run(runs({}, {"duration": 200}), lambda: machine.now) == pytest.approx((800 + 400) / 2 * TICK_S)
    assert machine.ticks == [LOADING_TICKS, TICKS, TICKS]


def test_a_run_that_cannot_be_made_is_left_out_and_the_next_one_loads() -> None:
    bad: dict[str, object] = {"robots.starts": [[3, 3], [3.5, 3]]}
    assert seconds_per_run(runs(bad), lambda: 0.0) is None
    assert seconds_per_run(runs(bad, {"duration": 2}), lambda: 0.0) == 0.0


@pytest.mark.parametrize("games", [False, True])
def test_a_run_is_tried_as_it_will_be_made(monkeypatch: pytest.MonkeyPatch, games: bool) -> None:
    how: list[dict[str, Any]] = []

    def noting(scenario: Scenario | Prepared, **words: Any) -> Outcome:
        how.append({name: value is not None if name in ("look", "watch") else value for name, value in words.items()})
        return run_in_process(scenario, **words)

    monkeypatch.setattr("fogwatch.inprocess.run_in_process", noting)
    (run,) = runs({"duration": 2})
    task = {"key": "k", "case": "c", "seed": 1, "scenario": as_mapping(run.scenario), "games": games}
    assert run_task(task)["error"] is None
    seconds_per_run([replace(run, games=games)])
    assert how == [how[0]] * 3
    assert how[0] == {"keep": False, "verify_fog": False, "look": True, "watch": games}


def test_runs_are_tried_all_over_the_list(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six of twelve, every second one: they last 200, 400, ... 1,200 s, with two ticks a second."""
    machine = Machine()
    monkeypatch.setattr(progress, "run_scenario", machine.run)
    monkeypatch.setattr(progress, "ENOUGH_S", 1e9)
    cases: list[dict[str, object]] = [{"duration": 200 + 100 * number} for number in range(12)]
    listed = runs(*cases)
    assert seconds_per_run(listed, lambda: machine.now) == pytest.approx(2 * 700 * TICK_S)
