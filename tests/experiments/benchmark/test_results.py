"""A tiny benchmark in this process: its tables hold the numbers of its runs."""

import csv
import io
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from experiments.benchmark.conditions import condition_of
from experiments.benchmark.matrix import Matrix, read_conditions, read_policies, read_terrains
from experiments.benchmark.plane import plane_drawings
from experiments.benchmark.presets import preset_named, presets
from experiments.benchmark.results import (
    INTRUDED,
    LATE,
    MEASURES,
    OVER_CAPACITY,
    OVER_TOUR,
    SEEN,
    cell_rows,
    groups_of,
    page_parts,
    policy_table,
    run_rows,
    with_ratios,
)
from experiments.intruders.infiltrator import WATCHING
from experiments.sweeps.cases import CaseRow, case_rows
from experiments.sweeps.figures import drawings
from experiments.sweeps.run_metrics import GAINED, moving_metric
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
    return with_ratios(run_sweep(TINY.plan(), tmp_path_factory.mktemp("benchmark"), workers=Here()))


@pytest.fixture(scope="module")
def rows(outcome: SweepOutcome) -> list[CaseRow]:
    assert not outcome.failed
    return case_rows(outcome)


def test_there_is_a_line_for_each_run_and_one_for_each_cell(outcome: SweepOutcome, rows: list[CaseRow]) -> None:
    runs = list(csv.DictReader(io.StringIO(run_rows(outcome).csv())))
    made = [(run["condition"], run["policy"], run["seed"]) for run in runs]
    assert made == list(product(("none", "silence"), ("committed", "sebs:g2=50"), "12"))
    by_trace = {result.trace_hash: result for result in outcome.results.values()}
    for run in runs:
        metrics = by_trace[run["trace_hash"]].metrics
        assert float(run[LATE]) == metrics[LATE]
        assert float(run[OVER_TOUR]) == pytest.approx(float(run[LATE]) / float(run["best_tour_s"]))
        assert float(run["intruder_random_25s_percent"]) == metrics["intruder_random_25s_percent"]
    cells = list(csv.DictReader(io.StringIO(cell_rows(rows, 1).csv())))
    assert len(cells) == 4
    expected = estimate([float(run[LATE]) for run in runs[:2]])
    assert float(cells[0][LATE]) == pytest.approx(expected.mean)
    assert float(cells[0][f"{LATE}_low"]) == pytest.approx(expected.low)
    assert cells[0]["command"] == runs[0]["command"]
    assert cells[2]["command"].count("silence") == 1


def test_the_tables_show_what_was_seen_where_not_all_was(rows: list[CaseRow]) -> None:
    (name, group), _ = groups_of(rows)
    assert name == "2 robots, no fault"
    table = policy_table(group)
    assert table.heads == ["policy", "open", "mean fog (s)", "collisions", "attacks of 75 s (%)", "planned (%)"]
    assert [row[0] for row in table.rows] == ["*best tour found*", "`committed`", "`sebs:g2=50`"]
    share = group[0].metrics[SEEN].mean
    assert share < 1.0, "30 s are too short"
    assert table.rows[1][1] == f"({100 * share:.2f} % seen)"
    assert [row[-1] for row in table.rows] == ["", "100", "-"], "sebs has no plan"
    assert table.rows[1][2] == f"{group[0].metrics['fog_mean_s'].mean:.0f}"
    text = "\n".join(page_parts(TINY, rows, None))
    assert "duration = 30.0, point = 2.0, robots.model = holonomic; seeds 1, 2." in text
    assert "## 2 robots, silence" in text
    assert "| *best tour found* | " in text
    assert f"| `committed` | {table.rows[1][1]} | {table.rows[1][2]} | " in text


def test_attacks_longer_than_the_run_are_none(rows: list[CaseRow]) -> None:
    assert all(INTRUDED not in row.metrics for row in rows)
    assert all(0.0 <= row.metrics["intruder_random_25s_percent"].mean <= 100.0 for row in rows)
    assert not list(plane_drawings(rows)), "no figure shows attacks of 75 s"
    drawn = {drawing.name: drawing for drawing in drawings(rows, "benchmark", shown=MEASURES)}
    assert f"cases-{INTRUDED}" not in drawn
    assert "Hollow: some ground was never seen." in drawn[f"cases-{LATE}"].caption
    assert "Hollow" not in drawn["cases-fog_mean_s"].caption


WAYS = [[f"{n} {way} 10" for n, way in ((v - 1, "W"), (v + 1, "E")) if 0 <= n < 40] for v in range(40)]
GRAPH = "40 688 499 0.075 0 0\n" + "\n".join(
    f"{vertex} {20 + 10 * vertex} 100 {len(ways)} {' '.join(ways)}" for vertex, ways in enumerate(WAYS)
)
"""A graph with as many vertices as that of cumberland."""


@pytest.fixture
def terrain(tmp_path: Path) -> str:
    (tmp_path / "c.yaml").write_text("image: c.pgm\n")
    (tmp_path / "c.graph").write_text(GRAPH)
    return f"{tmp_path / 'c.graph'}+{tmp_path / 'c.yaml'}"


def preset_matrix(name: str, terrain: str, **settings: object) -> Matrix:
    dotted = {field.replace("__", "."): value for field, value in settings.items()}
    return preset_named(name).matrix(read_policies("sebs"), read_terrains(terrain), (1,), dotted)


def test_presets_set_the_published_conditions(terrain: str) -> None:
    matrix = preset_matrix("magec", terrain, radio__forget_after="30")
    assert (matrix.teams, matrix.duration_s) == ((6,), 1800.0)
    assert matrix.conditions == ("none", "loss-50", "loss-90+deaths")
    assert matrix.settings["robots.model"] == "differential"
    assert matrix.settings["robots.speed"] == 0.52
    assert matrix.settings["terrain.graph"] == {"file": terrain.partition("+")[0], "visit": 0.25}
    assert matrix.settings["radio.forget_after"] == "30"
    matrix = preset_matrix("m2bench", terrain)
    assert (matrix.teams, matrix.duration_s, matrix.settings["robots.speed"]) == ((6,), 500.0, 1)
    assert matrix.settings["robots.starts"] == [[1.5 + 0.75 * vertex, 7.5] for vertex in (0, 8, 16, 24, 32, 39)]
    assert matrix.conditions == ("none",)
    assert matrix.settings["terrain.patrolled"] == "vertices"
    assert matrix.settings["sensor.range"] == pytest.approx(0.4 - 0.1 * 2**0.5, abs=1e-6)
    assert matrix.settings["point"] == 0.1
    jittered = preset_matrix("m2bench-jitter", terrain)
    assert jittered.settings == matrix.settings
    assert condition_of(jittered.conditions[-1], 500.0).faults[0]["jitter"]["size"] == 0.25


def test_a_preset_says_where_its_files_come_from(terrain: str, tmp_path: Path) -> None:
    where = "maps/cumberland of the public repository github.com/davidbsp/patrolling_sim"
    for other in ("yards", "gone.graph+gone.yaml", f"yards,{terrain}"):
        with pytest.raises(BadInput, match=rf"needs --terrains cumberland.graph\+cumberland.yaml; get .*{where}"):
            preset_matrix("magec", other)
    (tmp_path / "c.graph").write_text("1 1 1 1 0 0 0 1 1 0")
    with pytest.raises(BadInput, match=f"has 1 vertices, cumberland 40; get it from {where}"):
        preset_matrix("magec", terrain)


def test_published_numbers_stand_beside_ours(rows: list[CaseRow]) -> None:
    table = preset_named("m2bench").beside_ours(rows)
    assert table.heads[:5] == ["theirs", "condition", "ours", "WI (s) theirs", "WI (s) ours"]
    by_system = {row[0]: row for row in table.rows}
    assert by_system["SEBS"][2:5] == ["sebs", "199.4", "-"], "sebs:g2=50 is another policy"
    assert ["-", "silence", "sebs:g2=50"] in [row[:3] for row in table.rows]
    for preset in (preset for preset in presets().values() if preset.published):
        assert {line[2] for line in preset.published} == set(preset.conditions)
        assert {len(line) for line in preset.published} == {3 + len(preset.measures)}
        policies = {policy.name for policy in read_policies("ahpa,cbls,cr,dtag,dtap,er,gbs,hcr,hpcc,random,sebs")}
        assert {line[1] for line in preset.published if line[1]} <= policies
    shown = "\n".join(page_parts(TINY, rows, preset_named("m2bench")))
    assert "## Beside M2Bench's stored results" in shown
    assert "(`terrain.patrolled: vertices`)" in shown


def test_the_preset_of_conditions_has_a_table_for_each_ground(tmp_path: Path) -> None:
    preset = preset_named("conditions")
    assert {OVER_CAPACITY, moving_metric(WATCHING), GAINED} < set(preset.measures)
    conditions = read_conditions("none,speeds,one-death")
    tiny = {"duration": 100.0, "point": 2.0}
    matrix = preset.matrix(read_policies("committed"), read_terrains("open"), (1,), tiny, conditions)
    outcome = with_ratios(run_sweep(matrix.plan(), tmp_path, workers=Here()))
    assert not outcome.failed
    for run in outcome.plan.runs:
        metrics = outcome.results[run.key].metrics
        late, length_m = present(metrics[LATE]), present(metrics["best_tour_m"])
        speed = sum((0.5, 0.75, 1.0, 1.25)) * 4.4 if "speeds" in run.case else 4 * 4.4
        assert metrics[OVER_CAPACITY] == pytest.approx(late * speed / length_m)
    parts = list(page_parts(matrix, case_rows(outcome), preset))
    assert parts[-3] == "## Conditions of real fleets: open"
    assert parts[-2].startswith("capacity: the length of the best tour found"), "points of 2 m, not the preset's"
    as_it_is = list(page_parts(replace(matrix, settings={}), case_rows(outcome), preset))
    assert as_it_is[-2].startswith("point = 1; capacity: the length of the best tour found")
    head, _, *lines = parts[-1].splitlines()
    assert head == "| condition | policy | MFoW / capacity | planned (%) | bumps |", "100 s are too short for intruders"
    assert [line.split(" | ")[:2] for line in lines] == [[f"| {name}", "`committed`"] for name in conditions]


def test_the_preset_of_conditions_can_be_planned_in_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    office = Path("examples/maps/office.yaml").absolute()
    monkeypatch.chdir(tmp_path)
    preset = preset_named("conditions")
    terrains = f"{present(preset.terrains)},{office}"
    matrix = preset.matrix(read_policies("cr"), read_terrains(terrains), (1,), {})
    plan = matrix.plan()
    assert len(plan.cases) == 25 * 3
    assert {run.scenario.duration for run in plan.runs} == {1200.0}
    by_point = {1.0: (4.4, 1.0), 0.2: (1.0, 0.3)}
    for run in plan.runs:
        last = run.scenario.roster[1]
        assert last.radius == by_point[run.scenario.point][1]
        if "speeds" not in run.case:
            assert last.speed == by_point[run.scenario.point][0]
    assert {run.scenario.terrain.map is None for run in plan.runs} == {True, False}
