"""The paper's tables: every cell can be run, every printed value is there, and ours are put beside them right."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, get_args

import pytest

from experiments.paper.calibrate import best_radius, calibration_plan, crossing, fit_as_json, fit_radii, radius_setups
from experiments.paper.orderings import HELD, NOT_HELD, UNDECIDED, judge_orderings
from experiments.paper.printed import PaperTable, Side, paper
from experiments.paper.tables import (
    PaperSetup,
    TableComparison,
    as_json,
    as_table,
    compare,
    fit_of,
    plan_of,
    to_mean_fog_text,
)
from experiments.sweeps.plan import Plan
from experiments.sweeps.runner import SweepOutcome
from patrol.errors import BadInput
from patrol.scenario import PotentialFieldOptions
from tests.experiments.outcomes import outcome_of
from tests.present import present

SETUP = PaperSetup(1.0, 12.0, (1, 2))
TABLES = list(paper().tables.values())


def runnable(table: PaperTable) -> PaperTable:
    """The rows whose kind of paths this version has."""
    kinds = get_args(PotentialFieldOptions.model_fields["paths"].annotation)
    settings = {row.name: {**table.settings, **row.settings} for row in table.rows}
    return table.part([name for name, own in settings.items() if own.get("patrol.options.paths", "wave") in kinds], [])


def mfow_of(plan: Plan, value: Callable[[str, int], float], metric: str = "mfow_mean_s") -> SweepOutcome:
    """As if every run had come to a value that depends on its case and seed."""
    return outcome_of(plan, lambda case, seed: {metric: value(case, seed)})


def beside_ours(table: PaperTable, value: Callable[[str, int], float], metric: str = "mfow_mean_s") -> TableComparison:
    return compare(table, SETUP, mfow_of(plan_of([table], {"": SETUP}), value, metric))


def printed(table: PaperTable) -> dict[str, float]:
    """The first measure's values, where it has them, by the names of their cells' cases."""
    return {
        table.case(row.name, column.name): value
        for row, values in zip(table.rows, table.measures[0].values, strict=True)
        for column, value in zip(table.columns, values, strict=True)
        if value is not None
    }


@pytest.mark.parametrize("table", TABLES, ids=lambda table: str(table.number))
def test_every_cell_is_a_scenario_of_its_own(table: PaperTable) -> None:
    plan = plan_of([runnable(table)], {"": SETUP})
    assert len({run.key for run in plan.runs}) == len(plan.runs) == 2 * len(plan.cases)
    for run in plan.runs:
        assert run.scenario.ticks == 10_000
        assert (run.scenario.point, run.scenario.sensor.range) == (1.0, 12.0)
        options = run.scenario.patrol.options
        assert isinstance(options, PotentialFieldOptions)
        assert (options.alpha, options.beta) == (40.0, 4000.0)
        assert {spec.speed for spec in run.scenario.roster} == {4.4}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: str(table.number))
def test_every_printed_value_has_its_place(table: PaperTable) -> None:
    for measure in table.measures:
        assert len(measure.values) == len(table.rows)
        assert all(len(row) == len(table.columns) for row in measure.values)
    assert len({row.name for row in table.rows}) == len(table.rows)


@pytest.mark.parametrize(
    ("number", "sums"),
    [
        (2, [7930.0]),
        (3, [5520.9]),
        (4, [830.0, 893.9, 790.0, 693.7]),
        (5, [1171.2, 1266.1]),
        (6, [1572.1, 1307.9, 1372.3]),
        (7, [1631.7]),
        (8, [1590.6, 1572.9, 1510.8]),
    ],
)
def test_printed_values_add_up(number: int, sums: list[float]) -> None:
    rows = [math.fsum(value for value in row if value is not None) for row in paper().table(number).measures[0].values]
    found = [math.fsum(rows)] if number in (2, 3) else [total for total in rows if total]
    assert found == pytest.approx(sums)


def test_the_cells_that_a_radius_is_fitted_to_are_41_of_50() -> None:
    values = [value for number in (2, 3) for value in printed(paper().table(number)).values()]
    assert len(values) == 50
    assert sum(value < paper().fit_below for value in values) == 41


def test_orderings_name_cells_that_are_there() -> None:
    sides: list[Side] = [side for one in paper().orderings for side in (one.lower, one.higher)]
    for side in sides:
        table = paper().table(side.table)
        names = {row.name + measure.suffix for row in table.rows for measure in table.measures}
        assert side.row in names
        assert set(side.columns) <= {column.name for column in table.columns}


def test_ours_stand_beside_the_papers() -> None:
    table = paper().table(3).part(["f3", "f4"], ["g4", "g5"])
    wanted = printed(table)
    beside = beside_ours(table, lambda case, seed: wanted[case] * (0.9 if seed == 1 else 1.3))
    cells = [(cell.row, cell.column, cell.paper) for cell in beside.cells]
    assert cells == [("f3", "g4", 90.0), ("f3", "g5", 125.8), ("f4", "g4", 92.9), ("f4", "g5", 116.5)]
    says = json.loads(json.dumps(as_json(beside), allow_nan=False))
    assert (says["table"], says["point"], says["sensor_range"], says["run_computing_s"]) == (3, 1.0, 12.0, 16.0)
    first = says["cells"][0]
    assert first["mean"] == pytest.approx(99.0)
    assert first["ratio"] == pytest.approx(1.1)
    assert first["seeds"] == 2
    low, high = first["ci95"]
    assert (low + high) / 2.0 == pytest.approx(99.0)
    assert first["values"] == pytest.approx({"1": 81.0, "2": 117.0})
    assert to_mean_fog_text(beside) is None
    lines = as_table(beside).rows
    assert len(lines) == 4
    assert lines[0][:4] == ["f3", "g4", "s", 90.0]
    found = present(fit_of([beside]))
    assert found.cells == 4
    assert found.median_ratio == pytest.approx(1.1)


@pytest.mark.parametrize(("factor", "far"), [(1.0, False), (1.49, False), (1.51, True), (0.68, False), (0.66, True)])
def test_cells_far_off_are_marked(factor: float, far: bool) -> None:
    table = paper().table(3).part(["f3"], ["g4"])
    (cell,) = beside_ours(table, lambda *_: 90.0 * factor).cells
    assert cell.far_off is far


def test_cells_without_runs_are_empty() -> None:
    table = paper().table(3).part(["f3"], ["g4"])
    plan = plan_of([table], {"": SETUP})
    beside = compare(table, SETUP, SweepOutcome(plan, {}, 0, 0.0))
    (cell,) = as_json(beside)["cells"]
    assert (cell["mean"], cell["ci95"], cell["ratio"], cell["seeds"]) == (None, None, None, 0)
    assert fit_of([beside]) is None


def test_a_table_says_how_mean_mfow_stands_to_mean_fog() -> None:
    table = paper().table(3).part(["f3", "f4"], ["g4"])
    plan = plan_of([table], {"": SETUP})
    fog_s = {True: 40.0, False: 30.0}
    outcome = outcome_of(plan, lambda case, _: {"mfow_mean_s": 90.0, "fog_mean_s": fog_s[" f3 " in case]})
    beside = compare(table, SETUP, outcome)
    assert [cell.to_mean_fog for cell in beside.cells] == [2.25, 3.0]
    assert to_mean_fog_text(beside) == "MFoW : mean fog 2.2 to 3.0, median 2.6"
    three = paper().table(3).part(["f3", "f4", "f5"], ["g4"])
    fogs_s = {"f3": 45.0, "f4": 40.0, "f5": 9.0}
    skewed = outcome_of(
        plan_of([three], {"": SETUP}),
        lambda case, _: {"mfow_mean_s": 90.0, "fog_mean_s": next(s for f, s in fogs_s.items() if f" {f} " in case)},
    )
    says = "MFoW : mean fog 2.0 to 10.0, median 2.2"  # 2.25
    assert to_mean_fog_text(compare(three, SETUP, skewed)) == says
    written = as_table(beside)
    assert [written.heads[-1], *(row[-1] for row in written.rows)] == ["to_mean_fog", 2.25, 3.0]


def test_dead_ends_are_further_rows() -> None:
    table = runnable(paper().table(7))
    cell = present(beside_ours(table, lambda *_: 6.1, "dead_end_percent").cell("5 cars, dead ends", "0"))
    assert (cell.paper, cell.unit, cell.ratio) == (6.1, "%", 1.0)


def table_2(range_m: float, more: dict[str, Any]) -> Plan:
    return plan_of([paper().table(2)], {"": PaperSetup(0.5, range_m, (1,), more)})


@pytest.mark.parametrize(
    ("ask", "problem"),
    [
        (lambda: paper().table(1), "table 1: no such table; choose from 2 to 8"),
        (lambda: paper().table(2).part(["f6"], []), "--rows = f6: table 2 has no such row"),
        (lambda: paper().table(2).part([], ["g0"]), "--columns = g0: table 2 has no such column"),
        (lambda: table_2(-1.0, {}), "override sensor.range = -1"),
        (lambda: table_2(9.0, {"patrol.fog": 1}), "patrol.fog: unknown key"),
        (lambda: radius_setups(0.5, [10, 10], (1,), {}), "--ranges: expected different numbers"),
        (lambda: radius_setups(0.5, [math.nan], (1,), {}), "--ranges: expected different numbers"),
    ],
)
def test_what_does_not_exist_is_bad_input(ask: Callable[[], Any], problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        ask()
    assert problem in str(caught.value)


def calibration(bias: Callable[[float], float]) -> tuple[dict[str, PaperSetup], SweepOutcome]:
    """As if runs with radius r had come to the printed values times bias(r)."""
    setups = radius_setups(1.0, [10.0, 12.0, 14.0], (1,), {})
    wanted = {f"{case}{end}": (value, setup) for number in (2, 3) for end, setup in setups.items()
              for case, value in printed(paper().table(number)).items()}  # fmt: skip

    def value(case: str, _: int) -> float:
        paper_s, setup = wanted[case]
        return paper_s * bias(setup.sensor_range)

    return setups, mfow_of(calibration_plan(setups), value)


def test_calibration_finds_the_radius_with_the_median_ratio_nearest_to_1() -> None:
    setups, outcome = calibration(lambda radius: math.exp(0.1 * (12.4 - radius)))
    fits = fit_radii(setups, outcome)
    best = present(best_radius(fits))
    assert best.radius == 12.0
    assert [one.near.cells for one in fits] == [41, 41, 41]
    assert [one.whole.cells for one in fits] == [50, 50, 50]
    assert [one.near.median_ratio for one in fits] == pytest.approx([math.exp(0.1 * d) for d in (2.4, 0.4, -1.6)])
    assert fits[0].near.correlation == pytest.approx(1.0)
    assert crossing(fits) == pytest.approx(12.4)


def test_a_ratio_that_never_passes_1_has_no_crossing() -> None:
    fits = fit_radii(*calibration(lambda _: 2.0))
    assert crossing(fits) is None
    assert best_radius([]) is None


def test_tables_2_and_3_are_fitted_together() -> None:
    tables = [paper().table(2), paper().table(3)]
    wanted = printed(tables[0]) | printed(tables[1])
    outcome = mfow_of(plan_of(tables, {"": SETUP}), lambda case, _: wanted[case] * 1.05)
    beside = [compare(table, SETUP, outcome) for table in tables]
    says = present(fit_as_json(beside))
    assert says["near"]["median_ratio"] == pytest.approx(1.05)
    assert says["all"]["cells"] == 50
    assert fit_as_json(beside[:1]) is None


@pytest.mark.parametrize(("ratio", "verdict"), [(0.8, HELD), (1.25, NOT_HELD), (1.0, UNDECIDED)])
def test_orderings_are_judged_cell_by_cell_and_seed_by_seed(ratio: float, verdict: str) -> None:
    table = paper().table(5)

    def value(case: str, seed: int) -> float:
        own = 100.0 * int(case[-1]) * (1.0 + 0.5 * seed)
        return own * ratio * (1.0 + 0.01 * (-1) ** (seed + int(case[-1]))) if "mode" in case else own

    (judged,) = judge_orderings(paper().orderings, [beside_ours(table, value)])
    assert judged.verdict == verdict
    assert judged.ratio is not None
    assert judged.ratio.count == 10
    assert judged.ratio.mean == pytest.approx(ratio, rel=0.001)


def test_an_ordering_of_columns_is_judged_seed_by_seed() -> None:
    table = paper().table(7)
    depth = dict(zip("01234567", (240, 250, 220, 200, 170, 170, 180, 190), strict=True))
    beside = beside_ours(table, lambda case, seed: depth[case[-1]] * (1.0 + 0.1 * seed))
    (judged,) = judge_orderings(paper().orderings, [beside])
    assert judged.ratio is not None
    assert judged.ratio.count == 2
    others = math.exp(math.fsum(math.log(depth[name]) for name in "012367") / 6.0)
    assert judged.ratio.mean == pytest.approx(170.0 / others)
    assert judged.verdict == HELD
