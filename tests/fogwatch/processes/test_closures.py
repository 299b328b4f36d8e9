"""Closures in a fleet of processes: what robots see blocked goes over the wire, and the trace is the same."""

from __future__ import annotations

from pathlib import Path

import pytest

import fogwatch
from tests.fleets import COARSE, one_and_many

pytestmark = pytest.mark.processes


def test_robots_among_closures_leave_the_same_trace(tmp_path: Path) -> None:
    scenario = {
        **COARSE,
        "duration": 60,
        "robots": {"count": 2, "model": "holonomic", "radius": 0.4, "speed": 2.0},
        "closures": [
            {"name": "wall", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[5, 40]]},
            {"name": "box", "polygon": [[20, 40], [24, 40], [24, 44], [20, 44]], "closes": 0.1, "opens": 0.1},
        ],
    }
    one, _ = one_and_many(scenario, tmp_path)
    open_s = fogwatch.run({**scenario, "closures": []}, out=tmp_path / "open", picture=False)
    assert open_s.trace_hash != one.trace_hash
