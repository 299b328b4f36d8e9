"""An intruder's contacts over real Zenoh: the same trace as in one process."""

from __future__ import annotations

from pathlib import Path

import pytest

import fogwatch

pytestmark = pytest.mark.processes


def test_robots_surround_an_intruder_the_same_as_processes_and_in_one(tmp_path: Path) -> None:
    scenario = {
        "terrain": {"builtin": "open"},
        "point": 0.5,
        "duration": 40,
        "robots": {"count": 3, "model": "holonomic"},
        "intruders": [{"place": [50.0, 40.0], "for": 30.0}, {"place": [52.0, 43.0]}],
    }
    one = fogwatch.run(scenario, out=tmp_path / "one", picture=False)
    many = fogwatch.run(scenario, out=tmp_path / "many", in_process=False, picture=False)
    assert many.summary["verdict"]["valid"]
    assert many.trace_hash == one.trace_hash
    assert many.summary["messages"] == one.summary["messages"]
    assert one.summary["messages"]["frames"] > 3 * 80
    assert one.summary["messages"]["rejected"] == 0
