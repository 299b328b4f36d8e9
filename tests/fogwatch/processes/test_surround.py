"""An intruder's contacts over real Zenoh: the same trace as in one process."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fleets import one_and_many

pytestmark = pytest.mark.processes


def test_robots_surround_an_intruder_the_same_as_processes_and_in_one(tmp_path: Path) -> None:
    scenario = {
        "terrain": {"builtin": "open"},
        "point": 0.5,
        "duration": 40,
        "robots": {"count": 3, "model": "holonomic"},
        "intruders": [{"place": [50.0, 40.0], "for": 30.0}, {"place": [52.0, 43.0]}],
    }
    one, many = one_and_many(scenario, tmp_path)
    assert many.summary["messages"] == one.summary["messages"]
    assert one.summary["messages"]["frames"] > 3 * 80
    assert one.summary["messages"]["rejected"] == 0
