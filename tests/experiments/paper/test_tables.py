"""The paper's tables: every cell can be run, every printed value is there, and ours are put beside them right."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from experiments.paper.claims import (
    FAILS,
    HOLDS,
    UNDECIDED,
    claims_section,
    claims_table,
    printed_ratio,
    ratio_of,
    verdict_of,
)
from experiments.paper.printed import MFOW, paper
from experiments.paper.tables import Cell, cells_of, cells_table, page_parts, plan_of, table_drawings
from experiments.sweeps.cases import case_rows
from experiments.sweeps.runner import SweepOutcome
from patrol.errors import BadInput
from patrol.scenario import PotentialFieldOptions
from tests.experiments.outcomes import outcome_of
from tests.present import present

SEEDS = (1, 2)
POINT_1 = {"point": 1.0}
Value = Callable[[str, int], float]


def printed(numbers: Sequence[int]) -> dict[str, float]:
    """The printed values of MFoW, by the names of their cases."""
    return {
        f"table {number} {row} {column}": value
        for number in numbers
        for row, values in paper().table(number).printed[MFOW].items()
        for column, value in zip(paper().table(number).columns, values, strict=True)
        if value is not None
    }


def outcome(numbers: Sequence[int], value: Value, metric: str = MFOW, **part: Any) -> SweepOutcome:
    """As if every run had come to a value that depends on its case and seed."""
    return outcome_of(plan_of(numbers, SEEDS, POINT_1, **part), lambda case, seed: {metric: value(case, seed)})


def cells(numbers: Sequence[int], value: Value, metric: str = MFOW, **part: Any) -> list[Cell]:
    found = cells_of(case_rows(outcome(numbers, value, metric, **part)))
    return [cell for cell in found if cell.metric == metric]


@pytest.mark.parametrize("number", paper().tables)
def test_every_cell_is_a_scenario_of_its_own(number: int) -> None:
    plan = plan_of([number], SEEDS, POINT_1)
    assert len({run.key for run in plan.runs}) == len(plan.runs) == 2 * len(plan.cases)
    for run in plan.runs:
        assert run.scenario.ticks == 10_000
        assert (run.scenario.point, run.scenario.sensor.range) == (1.0, 12.0)
        options = run.scenario.patrol.options
        assert isinstance(options, PotentialFieldOptions)
        assert (options.alpha, options.beta) == (40.0, 4000.0)
        assert {spec.speed for spec in run.scenario.roster} == {4.4}


@pytest.mark.parametrize("number", paper().tables)
def test_every_printed_value_has_its_place(number: int) -> None:
    table = paper().table(number)
    for rows in table.printed.values():
        assert list(rows) == list(table.rows)
        assert all(len(values) == len(table.columns) for values in rows.values())


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
    table = paper().table(number).printed[MFOW]
    rows = [math.fsum(value for value in row if value is not None) for row in table.values()]
    found = [math.fsum(rows)] if number in (2, 3) else [total for total in rows if total]
    assert found == pytest.approx(sums)


def test_claims_name_cells_that_are_there() -> None:
    for side in (side for one in paper().claims.values() for side in (one.lower, one.higher)):
        table = paper().table(side.table)
        assert side.row in table.printed[side.metric]
        assert set(side.columns) <= set(table.columns)


def test_ours_stand_beside_the_papers() -> None:
    wanted = printed([3])
    beside = cells(
        [3], lambda case, seed: wanted[case] * (0.9 if seed == 1 else 1.3), rows=["f3", "f4"], columns=["g4", "g5"]
    )
    assert [(cell.row, cell.column, cell.printed) for cell in beside] == [
        ("f3", "g4", 90.0), ("f3", "g5", 125.8), ("f4", "g4", 92.9), ("f4", "g5", 116.5)
    ]  # fmt: skip
    first = beside[0]
    assert present(first.found).mean == pytest.approx(99.0)
    assert first.ratio == pytest.approx(1.1)
    assert first.values == pytest.approx({1: 81.0, 2: 117.0})
    table = cells_table(beside)
    assert len(table.rows) == 4
    assert table.rows[0][:5] == [3, "f3", "g4", MFOW, 90.0]
    text = "\n\n".join(page_parts(beside, POINT_1, SEEDS))
    assert "| 3 | 4 | 0 | 1.10 | 0 | 0.000 |" in text
    assert "| f3 (s) | 99.0 ± 228.7 (90) x 1.10 |" in text
    assert "`patrol.options.alpha: 40`" in text
    assert "`point: 1.0`" in text
    for assumed in paper().table(3).assumed:
        assert assumed in text


@pytest.mark.parametrize(("factor", "far"), [(1.0, False), (1.24, False), (1.26, True), (0.81, False), (0.79, True)])
def test_cells_far_off_are_marked(factor: float, far: bool) -> None:
    (cell,) = cells([3], lambda *_: 90.0 * factor, rows=["f3"], columns=["g4"])
    assert cell.far_off is far
    assert ("**x " in cell.text) is far


def test_cells_without_runs_are_empty() -> None:
    plan = plan_of([3], SEEDS, {}, ["f3"], ["g4"])
    (cell,) = cells_of(case_rows(SweepOutcome(plan, {}, 0, 0.0)))
    assert (cell.found, cell.ratio, cell.text) == (None, None, "- (90)")
    assert cells_table([cell]).rows[0][5:8] == [None, None, None]


def test_dead_ends_are_further_rows() -> None:
    found = cells([7], lambda *_: 6.1, "dead_end_percent")
    assert (found[0].printed, found[0].ratio) == (6.1, 1.0)
    assert "| 5 cars, dead ends (%) | 6.1 ± 0.0 (6.1) x 1.00 |" in "\n".join(page_parts(found, {}, SEEDS))


def test_figures_have_a_row_a_column_a_colour_a_row_and_the_printed_values_as_marks() -> None:
    wanted = printed([5])
    cases = case_rows(outcome([5], lambda case, _: wanted[case] * 1.1))
    drawn = {drawing.name: drawing for drawing in table_drawings(cases, cells_of(cases))}
    assert list(drawn) == ["table-5-cases-mfow_mean_s", "table-5-curves-mfow_mean_s"]
    drawing = drawn["table-5-cases-mfow_mean_s"]
    assert "Black marks: printed values." in drawing.caption
    (axes,) = drawing.figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [f"robots={number}" for number in range(1, 6)]
    marks = [np.asarray(line.get_xydata())[0, 0] for line in axes.lines if line.get_color() == "black"]
    assert set(marks) == set(wanted.values())


@pytest.mark.parametrize(
    ("ask", "problem"),
    [
        (lambda: paper().table(1), "table 1: no such table; choose from 2 to 8"),
        (lambda: plan_of([2], SEEDS, {}, ["f6"]), "--rows f6: no such name in these tables"),
        (lambda: plan_of([2], SEEDS, {}, [], ["g0"]), "--columns g0: no such name in these tables"),
        (lambda: plan_of([2], SEEDS, {"sensor.range": -1.0}), "override sensor.range = -1"),
        (lambda: plan_of([2], SEEDS, {"patrol.fog": 1}), "patrol.fog: unknown key"),
    ],
)
def test_what_does_not_exist_is_bad_input(ask: Callable[[], Any], problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        ask()
    assert problem in str(caught.value)


def test_a_claim_runs_the_cells_that_it_compares_alone() -> None:
    claim = paper().claim("open-field")
    assert [case.name for case in plan_of([2, 3], SEEDS, {}, claim=claim).cases] == ["table 2 f3 g4", "table 3 f3 g4"]
    assert printed_ratio(claim) == pytest.approx(80.7 / 90.0)
    assert printed_ratio(paper().claim("repulsion")) is None
    with pytest.raises(BadInput, match="claim fuzy: no such claim; did you mean fuzzy"):
        paper().claim("fuzy")


def test_what_a_table_has_as_a_whole_is_its_level() -> None:
    wanted = printed([4])
    beside = cells([4], lambda case, _: wanted[case] * (0.8 if case.endswith("5") else 0.5))
    level = 0.5 * 1.6**0.2
    spread = math.log(1.6) * math.sqrt(0.2 * 0.8)
    assert f"| 4 | 20 | 16 | {level:.2f} | 4 | {spread:.3f} |" in "\n".join(page_parts(beside, {}, SEEDS))


@pytest.mark.parametrize(("ratio", "verdict"), [(0.8, HOLDS), (1.25, FAILS), (1.0, UNDECIDED)])
def test_claims_are_judged_cell_by_cell_and_seed_by_seed(ratio: float, verdict: str) -> None:
    def value(case: str, seed: int) -> float:
        own = 100.0 * int(case[-1]) * (1.0 + 0.5 * seed)
        return own * ratio * (1.0 + 0.01 * (-1) ** (seed + int(case[-1]))) if "mode" in case else own

    beside = cells([5], value)
    found = present(ratio_of(paper().claim("obstacles"), beside))
    assert verdict_of(found) == verdict
    assert found.count == 10
    assert found.mean == pytest.approx(ratio, rel=0.001)
    text = "\n".join(claims_section(claims_table(beside)))
    assert f"| obstacles | with more obstacles mode is better than vector sum | {verdict} | " in text


def test_a_claim_on_columns_is_judged_seed_by_seed() -> None:
    depth = dict(zip("01234567", (240, 250, 220, 200, 170, 170, 180, 190), strict=True))
    beside = cells([7], lambda case, seed: depth[case[-1]] * (1.0 + 0.1 * seed))
    found = present(ratio_of(paper().claim("dilatation"), beside))
    assert found.count == 2
    others = math.exp(math.fsum(math.log(depth[name]) for name in "012367") / 6.0)
    assert found.mean == pytest.approx(170.0 / others)
    assert verdict_of(found) == HOLDS
    assert not list(claims_section(claims_table(cells([2], lambda *_: 1.0))))
