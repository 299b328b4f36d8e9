"""One-way zones in a fleet of processes: the trace is that of one process."""

from __future__ import annotations

from pathlib import Path

import pytest

import fogwatch
from tests.fleets import one_and_many
from tests.ring import LOWER, UPPER, write_ring, zone

pytestmark = pytest.mark.processes


def test_one_way_zones_leave_the_same_trace(tmp_path: Path) -> None:
    scenario = {
        "terrain": {"map": str(write_ring(tmp_path))},
        "point": 0.5,
        "duration": 60,
        "robots": {"count": 3, "model": "differential", "radius": 0.3, "speed": 1.0},
        "sensor": {"range": 3},
        "zones": [zone("aisle", LOWER, 0), zone("back", UPPER, 180)],
    }
    one, _ = one_and_many(scenario, tmp_path)
    plain = fogwatch.run({**scenario, "zones": []}, out=tmp_path / "plain", picture=False)
    assert plain.trace_hash != one.trace_hash
