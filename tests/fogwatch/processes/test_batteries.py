"""Batteries in a fleet of processes: the charge that robots sense goes over the wire, and the trace is the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fleets import COARSE, one_and_many

pytestmark = pytest.mark.processes


def test_robots_that_charge_leave_the_same_trace(tmp_path: Path) -> None:
    battery = {"capacity": 1.0, "idle": 10, "drive": 30, "charge": 200, "start": 0.6}
    scenario = {
        **COARSE,
        "duration": 60,
        "robots": {"count": 2, "model": "holonomic", "radius": 0.4, "speed": 1.5, "battery": battery},
        "docks": [{"place": [30.5, 30.5]}, {"place": [70.5, 60.5]}],
        "faults": [{"kind": "pause", "who": "r2", "at": 10, "for": 5}],
    }
    one, many = one_and_many(scenario, tmp_path)
    figures = {name: facts["battery"] for name, facts in many.summary["robots"].items()}
    assert figures == {name: facts["battery"] for name, facts in one.summary["robots"].items()}
    assert any(battery["patrol_share"] < 1.0 for battery in figures.values())
