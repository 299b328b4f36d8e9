"""Fleets in benchmarks: they run as any other, and their readings are what the ticks were."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.bench.measures import fleets, one_fleet
from experiments.bench.measures.decisions import Patrol
from experiments.bench.measures.fleets import (
    CELL,
    STEP_S,
    blocks,
    growth_of,
    measures_of,
    measures_of_whole,
    run_apart,
    square_scenario,
    tasks,
)
from experiments.bench.measures.one_fleet import FleetReadings, run_fleet
from experiments.bench.tools.measure import QUICK, Effort, Unmeasured
from experiments.inprocess import run_in_process
from patrol.scenario import load_scenario

SMALL: dict[str, Any] = {
    "terrain": {"builtin": "open"},
    "point": 1.0,
    "duration": 15.0,
    "robots": {"count": 3, "model": "holonomic"},
}

RUN = FleetReadings(
    skipped=40,
    before_s=2.5,
    before_wall_s=3.0,
    wall=[0.2] * 10,
    processor=[0.1] * 10,
    closing_s=0.5,
    closing_wall_s=0.75,
    peak_mb=300.0,
    frame_bytes=17.0,
    valid=True,
    completed=True,
    mfow_late_s=4.0,
    trace="",
)


def test_stretches_hold_every_tick_once() -> None:
    assert blocks([1.0, 2.0, 3.0], count=5) == [(1.0, 1), (2.0, 1), (3.0, 1)]
    found = blocks([1.0] * 23, count=5)
    assert sum(ticks for _, ticks in found) == 23
    assert all(total == ticks for total, ticks in found)
    with pytest.raises(Unmeasured, match="no tick was done"):
        blocks([])


def test_robot_seconds_per_second_and_core_are_what_the_ticks_simulated() -> None:
    readings = RUN
    found = {one.name: one for one in measures_of(readings, 6)}
    assert found["robot-seconds per second and core"].values == pytest.approx([6 * STEP_S / 0.1] * 5)
    assert found["robot-seconds per second and core"].says.startswith("20 with")  # 30 robot-s in 1.5 s
    assert found["times real time"].values == pytest.approx([STEP_S / 0.2] * 5)
    assert found["memory per robot"].values == (50.0,)
    assert found["until the first tick"].values == (3.0,)
    assert found["until the first tick"].unit == "s, wall"
    with pytest.raises(Unmeasured, match="verdict is not valid"):
        measures_of(replace(RUN, valid=False), 6)


def test_a_whole_run_is_told_by_each_clock_for_itself_and_only_when_it_is_whole() -> None:
    processor, wall = measures_of_whole(RUN)
    assert processor.values == pytest.approx((2.5 + 10 * 0.1 + 0.5,))
    assert wall.values == pytest.approx((3.0 + 10 * 0.2 + 0.75,))
    assert (processor.unit, wall.unit) == ("s", "s, wall")
    with pytest.raises(Unmeasured, match="the run ended after 10 ticks, before its last"):
        measures_of_whole(replace(RUN, completed=False))
    with pytest.raises(Unmeasured, match="verdict is not valid"):
        measures_of_whole(replace(RUN, valid=False))


def test_a_robot_in_a_large_fleet_is_compared_stretch_by_stretch() -> None:
    shorter = replace(RUN, processor=[0.4] * 5)
    longer = replace(RUN, processor=[0.1] * 5 + [0.9] * 5)
    found = growth_of(shorter, 12, longer, 6)
    assert found.values == pytest.approx([0.4 / 12 / (0.1 / 6)] * 5), "later ticks do not count"
    assert found.says == "stretch by stretch, over the same 5 ticks"
    assert growth_of(longer, 6, shorter, 12).values == pytest.approx([0.1 / 6 / (0.4 / 12)] * 5)
    with pytest.raises(Unmeasured, match="no tick was done"):
        growth_of(replace(RUN, processor=[]), 12, RUN, 6)


def test_a_fleet_runs_once_however_many_rows_tell_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, float, int]] = []

    def stub(scenario: Mapping[str, Any], seconds: float, *, threads: int, skip: int) -> FleetReadings:
        assert skip == fleets.SKIP_TICKS
        asked.append((f"{scenario['name']}{' lost' if scenario['faults'] else ''}", seconds, threads))
        return RUN

    monkeypatch.setattr(fleets, "run_apart", stub)
    monkeypatch.setattr(fleets, "square_scenario", named)
    monkeypatch.setattr(fleets, "_paper_cell", lambda _: [])
    monkeypatch.setattr(fleets, "cores", lambda: 2)
    effort = Effort(repeats=1, seconds=30.25, quick=False)  # of this test alone, since runs are kept
    for task in tasks():
        task.run(effort)
    assert len(asked) == len(set(asked)) == 2 * len(fleets.SIZES) + len(fleets.SIDES) + 2
    longer = {name: seconds / effort.seconds for name, seconds, _ in asked}
    assert (longer["square-1000-200"], longer["square-1000-500"], longer["square-1000-1000 lost"]) == (1.0, 2.0, 4.0)


def named(size: int, _: Path, loss: float, side: int) -> dict[str, Any]:
    return {"name": f"square-{side}-{size}", "faults": [loss] if loss else []}


def test_a_fleet_that_is_measured_does_what_it_does_otherwise() -> None:
    scenario = load_scenario(SMALL)
    readings = run_fleet(scenario, 1e9, skip=4, threads=1)
    end = run_in_process(scenario).journal.end
    assert end is not None
    assert readings.trace == end.trace_hash
    assert len(readings.wall) == len(readings.processor) == scenario.ticks - 4
    assert readings.valid
    assert readings.completed
    assert readings.before_wall_s > 0.0
    assert readings.closing_wall_s > 0.0
    assert readings.peak_mb > 50.0
    assert 10.0 < readings.frame_bytes < 64.0


def test_a_measured_patrol_goes_where_it_goes_otherwise() -> None:
    scenario = load_scenario(SMALL)
    ticks = list(run_in_process(scenario).journal.ticks)
    patrol = Patrol(scenario)
    for tick in ticks[:-1]:
        assert [(row.x, row.y) for row in tick.robots] == patrol.places
        patrol.decide()
        patrol.next_tick()


@pytest.mark.accept
def test_a_cell_of_the_paper_is_run_whole_at_fine_points() -> None:
    (cell,) = (task for task in tasks() if task.name.startswith(CELL))
    found = cell.run(QUICK)
    assert [one.name for one in found] == ["processor time", "the whole run"]
    assert all(one.says.startswith("100 ticks") and one.values[0] > 0.0 for one in found)


def test_a_fleet_ends_when_its_time_is_over() -> None:
    scenario = load_scenario({**SMALL, "duration": 5000.0})
    readings = run_fleet(scenario, 0.0, skip=2, threads=1)
    assert len(readings.wall) < scenario.ticks - 2
    assert readings.valid
    assert not readings.completed


def test_a_fleet_that_does_not_come_to_what_counts_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_fleet, "PATIENCE_S", 0.0)
    readings = run_fleet(load_scenario(SMALL), 1e9, skip=10, threads=1)
    assert readings.wall == []
    with pytest.raises(Unmeasured, match="no tick was done"):
        measures_of(readings, 3)


def test_the_kilometre_is_a_scenario_like_any_other(tmp_path: Path) -> None:
    scenario = load_scenario(square_scenario(1000, tmp_path, loss=0.2))
    assert len(scenario.roster) == 1000
    assert [fault.kind for fault in scenario.faults] == ["loss"]
    assert load_scenario(square_scenario(5, tmp_path)).faults == ()


@pytest.mark.processes
@pytest.mark.accept
def test_a_fleet_of_its_own_process_ends_when_nobody_waits_for_it() -> None:
    lifeline, ours = os.pipe()
    command = [sys.executable, "-P", "-m", "experiments.bench.measures.one_fleet", str(lifeline)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, pass_fds=[lifeline]) as process:
        os.close(lifeline)
        assert process.stdin is not None
        task = {"scenario": {**SMALL, "duration": 100_000.0}, "settings": {}, "seconds": 1e9, "skip": 4, "threads": 1}
        process.stdin.write(json.dumps(task))
        process.stdin.close()
        os.close(ours)
        assert process.wait(300) == 130


@pytest.mark.processes
@pytest.mark.accept
def test_a_fleet_of_its_own_process_answers_or_says_why_not() -> None:
    assert run_apart(SMALL, 1e9).trace == run_fleet(load_scenario(SMALL), 1e9, 4, 1).trace
    assert len(run_apart(SMALL, 1e9, settings={"duration": 5.0}).wall) == 6
    with pytest.raises(Unmeasured, match=r"the fleet's process failed: .*robots\.count"):
        run_apart({**SMALL, "robots": {"count": 0}}, 1.0)
