"""A tiny benchmark in this process: its tables hold the numbers of its runs."""

from __future__ import annotations

import csv
import io
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from experiments.benchmark import markdown
from experiments.benchmark import results as tables
from experiments.benchmark.conditions import faults_of
from experiments.benchmark.matrix import Matrix, plan_of, read_policies, read_terrains
from experiments.benchmark.page import drawings
from experiments.benchmark.page import page as html_page
from experiments.benchmark.presets import PRESETS, beside_published, preset_matrix
from experiments.sweeps.cases import cases_table
from experiments.sweeps.runner import SweepOutcome, run_sweep
from experiments.sweeps.stats import estimate
from patrol.errors import BadInput
from tests.experiments.sweeps.test_sweep_runs import Here
from tests.present import present

TINY = Matrix(
    policies=read_policies("committed,sebs:g2=50"),
    terrains=read_terrains("open"),
    teams=(2,),
    conditions=("none", "silence"),
    seeds=(1, 2),
    duration_s=30.0,
    settings={"point": 2.0, "robots.model": "holonomic"},
)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> SweepOutcome:
    return run_sweep(plan_of(TINY), tmp_path_factory.mktemp("benchmark"), workers=Here())


@pytest.fixture(scope="module")
def results(outcome: SweepOutcome) -> tables.BenchmarkResults:
    assert not outcome.failed
    return tables.results_of(TINY, outcome)


def test_there_is_a_line_for_each_run_and_one_for_each_cell(
    outcome: SweepOutcome, results: tables.BenchmarkResults
) -> None:
    runs = list(csv.DictReader(io.StringIO(tables.run_rows(results).csv())))
    made = [(run["condition"], run["policy"], run["seed"]) for run in runs]
    assert made == list(product(("none", "silence"), ("committed", "sebs:g2=50"), "12"))
    by_trace = {result.trace_hash: result for result in outcome.results.values()}
    for run in runs:
        metrics = by_trace[run["trace_hash"]].metrics
        assert float(run[tables.LATE]) == metrics[tables.LATE]
        assert float(run[tables.OVER_TOUR]) == pytest.approx(float(run[tables.LATE]) / float(run["best_tour_s"]))
        assert float(run["intruder_random_25s_percent"]) == metrics["intruder_random_25s_percent"]
    cells = list(csv.DictReader(io.StringIO(cases_table(tables.cell_rows(results)).csv())))
    assert len(cells) == 4
    expected = estimate([float(run[tables.LATE]) for run in runs[:2]])
    assert float(cells[0][tables.LATE]) == pytest.approx(expected.mean)
    assert float(cells[0][f"{tables.LATE}_low"]) == pytest.approx(expected.low)
    assert cells[0]["command"] == runs[0]["command"]
    assert cells[2]["command"].count("silence") == 1


def test_the_tables_show_what_was_seen_where_not_all_was(results: tables.BenchmarkResults) -> None:
    (_, _, cells), _ = results.groups
    table = tables.policy_table(cells)
    rows = table.rows
    assert table.heads == ["policy", "open", "mean fog (s)", "collisions", "attacks of 75 s (%)"]
    assert [row[0] for row in rows] == ["best tour found", "committed", "sebs:g2=50"]
    share = present(cells[0].mean(tables.SEEN))
    assert share < 1.0, "30 s are too short"
    assert rows[1][1] == f"({100 * share:.2f} % seen)"
    shown = {measure.metric: cells[0].text(measure) for measure in tables.MEASURES}
    assert shown[tables.LATE] == shown[tables.OVER_TOUR] == rows[1][1], "neither is an age"
    assert "seen" not in shown["fog_mean_s"]
    fog = cells[0].row.metrics["fog_mean_s"]
    assert rows[1][2] == f"{fog.mean:.0f}"
    text = markdown.page(TINY, results, command="fogwatch benchmark", computing_s=60.0)
    assert "    fogwatch benchmark        # 8 runs, 1 min of computing on one core" in text
    assert "## 2 robots, silence" in text
    assert "| *best tour found* | " in text
    assert f"| `committed` | {rows[1][1]} | {rows[1][2]} | " in text


def test_attacks_longer_than_the_run_are_none(results: tables.BenchmarkResults) -> None:
    assert all(result.mean(tables.INTRUDED) is None for result in results.cells)
    assert all(0.0 <= (result.mean("intruder_random_25s_percent") or 0.0) <= 100.0 for result in results.cells)
    drawn = [drawing.name for drawing in drawings(TINY, results)]
    assert drawn[:2] == ["attacks", f"dots-{tables.LATE}"], "no figure shows attacks of 75 s"
    assert f"dots-{tables.INTRUDED}" not in drawn


WAYS = [[f"{n} {way} 10" for n, way in ((v - 1, "W"), (v + 1, "E")) if 0 <= n < 40] for v in range(40)]
GRAPH = "40 688 499 0.075 0 0\n" + "\n".join(
    f"{vertex} {20 + 10 * vertex} 100 {len(ways)} {' '.join(ways)}" for vertex, ways in enumerate(WAYS)
)
"""A graph with as many vertices as that of cumberland."""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "c.yaml").write_text("image: c.pgm\n")
    (tmp_path / "c.graph").write_text(GRAPH)
    return tmp_path / "c.yaml", tmp_path / "c.graph"


def test_presets_set_the_published_conditions(files: tuple[Path, Path]) -> None:
    matrix = preset_matrix("magec", read_policies("sebs"), (1,), *files, {"radio.forget_after": "30"})
    assert (matrix.teams, matrix.duration_s) == ((6,), 1800.0)
    assert matrix.conditions == ("none", "loss-50", "loss-90+deaths")
    settings = matrix.cells[2].settings
    assert settings["robots.model"] == "differential"
    assert settings["robots.speed"] == 0.52
    assert settings["terrain.graph"] == {"file": str(files[1]), "visit": 0.25}
    assert settings["radio.forget_after"] == "30"
    faults: Any = settings["faults"]
    assert [(fault["kind"], fault.get("at")) for fault in faults] == [("loss", None), ("kill", 300.0), ("kill", 1100.0)]
    settings = preset_matrix("m2bench", read_policies("sebs"), (1,), *files, {}).cells[0].settings
    assert (settings["duration"], settings["robots.count"], settings["robots.speed"]) == (500.0, 6, 1.0)
    assert settings["robots.starts"] == [[1.5 + 0.75 * vertex, 7.5] for vertex in (0, 8, 16, 24, 32, 39)]
    assert "faults" not in settings
    assert settings["terrain.patrolled"] == "vertices"
    assert settings["sensor.range"] == pytest.approx(0.4 - 0.1 * 2**0.5, abs=1e-6)
    assert settings["point"] == 0.1
    jittered = preset_matrix("m2bench-jitter", read_policies("sebs"), (1,), *files, {}).cells[-1].settings
    assert jittered == settings | {"faults": faults_of("jitter-25", 500.0)}
    with pytest.raises(BadInput, match=r"--point 0\.2: visits within 0\.4 m need at most 0\.1"):
        preset_matrix("m2bench", read_policies("sebs"), (1,), *files, {"point": 0.2})


def test_a_preset_says_where_its_files_come_from(files: tuple[Path, Path], tmp_path: Path) -> None:
    policies = read_policies("sebs")
    where = "maps/cumberland of the public repository github.com/davidbsp/patrolling_sim"
    with pytest.raises(BadInput, match=f"--preset magec: needs --map cumberland.yaml and --graph .*{where}"):
        preset_matrix("magec", policies, (1,), files[0], None, {})
    with pytest.raises(BadInput, match=f"--graph .*gone.graph: no such file; get it from {where}"):
        preset_matrix("magec", policies, (1,), files[0], tmp_path / "gone.graph", {})
    files[1].write_text("1 1 1 1 0 0 0 1 1 0")
    with pytest.raises(BadInput, match=f"has 1 vertices, cumberland 40; get it from {where}"):
        preset_matrix("magec", policies, (1,), *files, {})


def test_published_numbers_stand_beside_ours(results: tables.BenchmarkResults) -> None:
    table = beside_published(PRESETS["m2bench"], results.cells)
    rows = table.rows
    assert table.heads[:5] == ["theirs", "condition", "ours", "WI (s) theirs", "WI (s) ours"]
    by_system = {row[0]: row for row in rows}
    assert by_system["SEBS"][2:5] == ["sebs", "199.4", "-"], "sebs:g2=50 is another policy"
    assert ["-", "silence", "sebs:g2=50"] in [row[:3] for row in rows]
    for preset in PRESETS.values():
        assert {one.condition for one in preset.published} == set(preset.conditions)
        assert {len(one.values) for one in preset.published} == {len(preset.measures)}
        plan = {policy.name for policy in read_policies("ahpa,cbls,cr,dtag,dtap,er,gbs,hcr,hpcc,random,sebs")}
        assert {one.policy for one in preset.published if one.policy} <= plan
    shown = html_page(TINY, results, [], command="fogwatch benchmark", preset=PRESETS["m2bench"])
    assert "terrain.patrolled: vertices" in shown
    assert "`" not in shown
    assert tables.MEASURES[0].metric == tables.LATE
