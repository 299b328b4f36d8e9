"""Hearing only those near: nothing changes where near is everywhere, and something does where near is nowhere."""

from __future__ import annotations

from typing import Any

from experiments.bench.measures.horizon import decisions_that_differ, horizon_m
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario

SMALL: dict[str, Any] = {
    "terrain": {"builtin": "open"},
    "point": 1.0,
    "duration": 60.0,
    "robots": {"count": 3, "model": "holonomic"},
}


def small(**settings: object) -> Prepared:
    return prepare(load_scenario(SMALL, settings))


def test_who_hears_everybody_from_near_or_far_decides_the_same() -> None:
    assert decisions_that_differ(small(), 1e6) == (0.0, 0.0, 2.0)


def test_who_hears_nobody_decides_otherwise_now_and_then() -> None:
    differ, turned, heard = decisions_that_differ(small(), 0.0)
    assert heard == 0.0
    assert 0.0 < turned <= differ < 1.0


def test_the_horizon_shrinks_with_the_accuracy_that_is_asked_for() -> None:
    exact, rough = (horizon_m(small(**{"patrol.tolerance": tolerance})) for tolerance in (1e-16, 1e-2))
    assert 0.0 < rough < exact < 200.0
