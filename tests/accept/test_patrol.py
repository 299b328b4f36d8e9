"""What the patrol promises, measured: the paper's open field, a real floor plan, both ways equal at full length."""

from __future__ import annotations

from pathlib import Path
from statistics import mean

import numpy as np
import pytest

from experiments.inprocess import run_in_process
from patrol.journal import read_journal
from patrol.scenario import load_scenario, open_scenario

pytestmark = pytest.mark.accept

CUMBERLAND = Path(__file__).parents[3] / "shared" / "maps" / "cumberland.yaml"


@pytest.mark.parametrize(("sensor_range", "low", "high"), [(10.0, 90.0, 120.0), (12.0, 70.0, 95.0)])
def test_three_robots_on_the_open_field_patrol_like_the_papers(sensor_range: float, low: float, high: float) -> None:
    """The paper prints 90.0 s (Table 3, f3 g4); which radius and point size that was is not known."""
    values = []
    for seed in (1, 2, 3):
        scenario = load_scenario(
            {
                "terrain": {"builtin": "open"},
                "point": 0.5,
                "seed": seed,
                "robots": {"count": 3, "model": "holonomic"},
                "sensor": {"range": sensor_range},
                "patrol": {"dilatation": 0.0},
            }
        )
        outcome = run_in_process(scenario)
        assert outcome.verdict.valid
        values.append(outcome.summary["mfow_mean_s"])
    assert low <= mean(values) <= high


@pytest.mark.skipif(not CUMBERLAND.exists(), reason="the real floor plan lies outside this project")
def test_a_real_floor_plan_is_patrolled_for_an_hour(tmp_path: Path) -> None:
    overrides = {
        "robots.count": 4,
        "robots.model": "holonomic",
        "robots.radius": 0.3,
        "robots.speed": 1.0,
        "duration": 3600.0,
        "patrol.dilatation": 2.0,
    }
    outcome = run_in_process(open_scenario(str(CUMBERLAND), overrides), journal=tmp_path / "journal")
    assert outcome.verdict.valid
    assert outcome.summary["seen_share"] >= 0.995
    mfow = np.array([tick.mfow for tick in read_journal(tmp_path / "journal").ticks]) * 0.5
    # Once everything has been seen, the stalest point must not simply grow older: each quarter falls below its start.
    quarters = np.array_split(mfow[len(mfow) // 4 :], 3)
    assert all(quarter.max() < 900.0 for quarter in quarters)
    assert quarters[-1].max() < 1.5 * max(quarter.max() for quarter in quarters[:-1])
