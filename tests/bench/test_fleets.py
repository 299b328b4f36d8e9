"""Fleets of benchmarks: scenarios like any other, and patrols that go where they go otherwise."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bench import fleets
from bench.decisions import Patrol
from bench.fleets import fleet_time, square_scenario
from fogwatch.inprocess import Outcome, run_in_process
from patrol.scenario import load_scenario
from tests.fleets import COARSE

SMALL: dict[str, Any] = {**COARSE, "duration": 15.0, "robots": {"count": 3, "model": "holonomic"}}


def test_the_kilometre_is_a_scenario_like_any_other(tmp_path: Path) -> None:
    scenario = load_scenario(square_scenario(1000, tmp_path, loss=0.2))
    assert len(scenario.roster) == 1000
    assert [fault.kind for fault in scenario.faults] == ["loss"]
    assert load_scenario(square_scenario(5, tmp_path)).faults == ()


def test_ticks_that_are_skipped_are_run(monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes: list[Outcome] = []

    def kept(*arguments: Any, **options: Any) -> Outcome:
        outcomes.append(run_in_process(*arguments, **options))
        return outcomes[-1]

    monkeypatch.setattr(fleets, "run_in_process", kept)
    assert fleet_time(lambda _: SMALL, 3, 4, 1, 2) > 0.0
    assert [outcome.summary.ticks for outcome in outcomes] == [7, 7]


@pytest.mark.parametrize(("workers", "clock"), [(1, "process_time"), (2, "perf_counter")])
def test_neither_the_first_ticks_nor_what_follows_the_last_one_counts(
    workers: int, clock: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 0.0

    class Valid:
        verdict = type("Verdict", (), {"valid": True})

    def run(_prepared: object, *, watch: Callable[[Any], Callable[[Any], None]], **_: object) -> type[Valid]:
        nonlocal now_s
        after_tick = watch(None)
        for k in range(5):
            now_s += 100.0 if k < 2 else 1.0
            after_tick(SimpleNamespace(k=k))
        now_s += 1000.0
        return Valid

    monkeypatch.setattr(fleets, "run_in_process", run)
    monkeypatch.setattr(
        fleets, "time", SimpleNamespace(**{"process_time": None, "perf_counter": None, clock: lambda: now_s})
    )
    assert fleet_time(lambda _: SMALL, 2, 3, workers, 2) == 6.0


def test_an_invalid_run_is_no_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    class Invalid:
        verdict = type("Verdict", (), {"valid": False})

    monkeypatch.setattr(fleets, "run_in_process", lambda *_, **__: Invalid)
    with pytest.raises(RuntimeError, match="verdict is not valid"):
        fleet_time(lambda _: SMALL, 1, 1, 1, 1)


def test_a_measured_patrol_goes_where_it_goes_otherwise() -> None:
    scenario = load_scenario(SMALL)
    ticks = list(run_in_process(scenario).journal.ticks)
    patrol = Patrol(scenario)
    for tick in ticks[:-1]:
        assert [(row.x, row.y) for row in tick.robots] == patrol.places
        patrol.decide()
        patrol.next_tick()
