"""Promises of the patrol, measured: the paper's open field, a real floor plan, both ways equal at full length."""

import json
import subprocess
import sys
import time
from math import inf
from pathlib import Path
from statistics import mean, median

import numpy as np
import pytest

import fogwatch
from fogwatch.inprocess import make_minds, run_in_process
from patrol.exchange import Reply
from patrol.journal import read_journal
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from worldsim.world import World

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]

CUMBERLAND = Path(__file__).parents[3] / "shared" / "maps" / "cumberland.yaml"


@pytest.mark.parametrize(("sensor_range", "low", "high"), [(10.0, 90.0, 120.0), (12.0, 70.0, 95.0)])
def test_three_robots_on_the_open_field_patrol_like_the_papers(sensor_range: float, low: float, high: float) -> None:
    """The paper prints 90.0 s (Table 3, f3 g4); which radius and point size that was is not known."""
    values = []
    for seed in (1, 2, 3):
        facts = {"terrain": {"builtin": "open"}, "point": 0.5, "seed": seed, "sensor": {"range": sensor_range}}
        patrol = {"policy": "potential-field", "options": {"separation": "none"}}
        robots = {"count": 3, "model": "holonomic"}
        outcome = run_in_process(load_scenario({**facts, "robots": robots, "patrol": patrol}))
        assert outcome.verdict.valid
        values.append(outcome.summary.mfow_mean_s or inf)
    assert low <= mean(values) <= high


@pytest.mark.skipif(not CUMBERLAND.exists(), reason="the real floor plan lies outside this project")
def test_a_real_floor_plan_is_patrolled_for_an_hour_by_processes(tmp_path: Path) -> None:
    robots = ["--robots", "4", "--model", "holonomic", "--radius", "0.3", "--speed", "1"]
    words = [*robots, "--duration", "3600"]
    out = tmp_path / "run"
    command = [sys.executable, "-P", "-m", "fogwatch", "run", str(CUMBERLAND), *words, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["seen_share"] >= 0.995
    mfow = np.array([tick.mfow for tick in read_journal(out / "journal").ticks]) * 0.5
    settled = mfow[len(mfow) // 6 :]
    assert settled.max() < 500.0
    first, second = np.array_split(settled, 2)
    assert second.mean() < 1.3 * first.mean()


@pytest.mark.parametrize("model", ["car", "holonomic"])
@pytest.mark.parametrize("terrain", ["open", "yards", "clutter"])
def test_the_default_algorithm_is_the_same_both_ways(terrain: str, model: str, tmp_path: Path) -> None:
    hashes = set()
    for seed, in_process in ((1, True), (1, False), (2, True)):
        overrides = {"duration": 30.0, "robots.count": 3, "robots.model": model, "seed": seed}
        out = tmp_path / f"{seed}-{in_process}"
        result = fogwatch.run(terrain, out=out, in_process=in_process, overrides=overrides)
        assert result.verdict.valid
        hashes.add((seed, result.trace_hash))
    assert len(hashes) == 2
    assert len({trace for _, trace in hashes}) == 2


@pytest.mark.parametrize(
    ("terrain", "separation", "limit_ms"),
    [("yards", "none", 25.0), ("site", "none", 60.0), ("yards", "claims", 45.0), ("site", "claims", 60.0)],
)
def test_a_decision_at_ten_centimetres_is_quick(terrain: str, separation: str, limit_ms: float) -> None:
    """CPU time of one thread, so that a busy machine is no failure."""
    prepared = prepare(
        load_scenario({"terrain": {"builtin": terrain}, "patrol": {"options": {"separation": separation}}})
    )
    minds = make_minds(prepared)
    world = World(prepared)
    spent = []
    for _ in range(300):
        reports = world.begin_tick()
        heard = world.exchange({number: minds[number].frames(sensed) for number, sensed in reports.items()})
        replies = {}
        for number, sensed in reports.items():
            begun = time.thread_time()
            decision = minds[number].step(sensed, heard[number])
            spent.append(1000.0 * (time.thread_time() - begun))
            replies[number] = Reply(decision.command, decision.state, decision.goal, 0.0, decision.rejected)
        world.end_tick(replies)
    assert median(spent) < limit_ms
