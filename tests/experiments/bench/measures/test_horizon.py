"""Hearing only those near: nothing changes where near is everywhere, and something does where near is nowhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from experiments.bench.measures import horizon
from experiments.bench.measures.horizon import decisions_that_differ, horizon_m, late_mfow
from experiments.bench.measures.one_fleet import FleetReadings
from experiments.bench.tools.measure import QUICK
from patrol.exchange import Sensed
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from worldsim.world import World

SMALL: dict[str, Any] = {
    "terrain": {"builtin": "open"},
    "point": 1.0,
    "duration": 60.0,
    "robots": {"count": 3, "model": "holonomic"},
}


def small(**settings: object) -> Prepared:
    return prepare(load_scenario(SMALL, settings))


def test_who_hears_everybody_from_near_or_far_decides_the_same() -> None:
    assert decisions_that_differ(small(), 1e6, 120) == (0.0, 0.0, 2.0)


def test_who_hears_nobody_decides_otherwise_now_and_then() -> None:
    differ, turned, heard = decisions_that_differ(small(), 0.0, 1000)
    assert heard == 0.0
    assert 0.0 < turned <= differ < 1.0


def test_so_many_ticks_are_compared_on_any_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []
    begin = World.begin_tick

    def counted(world: World) -> Mapping[int, Sensed]:
        begun.append(world.tick)
        return begin(world)

    monkeypatch.setattr(World, "begin_tick", counted)
    decisions_that_differ(small(), 0.0, 7)
    assert begun == list(range(7))


def test_a_run_that_several_distances_are_compared_with_is_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[bool, object]] = []

    def stub(scenario: Mapping[str, Any], _: float, settings: Mapping[str, object]) -> FleetReadings:
        asked.append((bool(scenario["faults"]), settings["seed"]))
        return FleetReadings(4, 0.0, 0.0, [], [], 0.0, 0.0, 1.0, 1.0, True, True, float(len(asked)), "")

    monkeypatch.setattr(horizon, "run_apart", stub)
    monkeypatch.setattr(horizon, "TICKS_QUICK", 1)
    late_mfow.cache_clear()
    nearest, *farther = (task for task in horizon.tasks() if task.name.startswith("paper's policy"))
    says = {one.name: one.says for one in nearest.run(QUICK)}
    assert says["decisions that differ"].endswith("m, 10 robots, the first 1 ticks")
    for task in farther:
        task.run(QUICK)
    late_mfow.cache_clear()
    assert sorted(asked) == [(False, 1), (True, 1), (True, 1), (True, 1)]


def test_on_one_area_a_larger_team_has_a_nearer_horizon_where_reach_goes_by_area() -> None:
    alone, together = (
        horizon_m(small(**{"patrol.reach": "area", "patrol.tolerance": 1e-2, "robots.count": count}))
        for count in (1, 4)
    )
    assert together < alone


def test_the_horizon_shrinks_with_the_accuracy_that_is_asked_for() -> None:
    exact, rough = (horizon_m(small(**{"patrol.tolerance": tolerance})) for tolerance in (1e-16, 1e-2))
    assert 0.0 < rough < exact < 200.0
