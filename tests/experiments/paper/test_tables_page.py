"""The page that holds the paper's tables beside ours."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from experiments.paper import tables_page as paper_report
from experiments.paper.orderings import judge_orderings
from experiments.paper.printed import Remark, paper
from experiments.paper.tables import PaperSetup, TableComparison, compare, plan_of
from experiments.paper.tables_page import UNEXPLAINED, page
from tests.experiments.outcomes import outcome_of

SETUP = PaperSetup(0.5, 12.0, (1, 2), {"sensor.angle": 180})


def comparison_of(number: int, factors: dict[tuple[str, str], float]) -> TableComparison:
    """A table whose runs came to the printed values, times a factor where one is given; 1 % apart by seed."""
    table = paper().table(number)
    plan = plan_of([table], {"": SETUP})
    ours = {
        table.case(row.name, column.name): (value or 100.0) * factors.get((row.name, column.name), 1.0)
        for row, values in zip(table.rows, table.measures[0].values, strict=True)
        for column, value in zip(table.columns, values, strict=True)
    }
    return compare(table, SETUP, outcome_of(plan, lambda case, seed: {"mfow_mean_s": ours[case] * (1 + 0.01 * seed)}))


def page_of(comparison: TableComparison, **pictures: str) -> str:
    judged = judge_orderings(paper().orderings, [comparison])
    return page([comparison], judged, SETUP, command="fogwatch reproduce table 5", computing_s=600.0, pictures=pictures)


def test_the_page_says_how_it_was_made_and_shows_each_cell() -> None:
    text = page_of(comparison_of(5, {("mode", "2"): 2.0}))
    assert "`fogwatch reproduce table 5`: 10 min of computing" in text
    assert "`patrol.options.alpha: 40`" in text
    assert "`sensor.angle: 180`" in text
    assert "`sensor.angle: 360`" not in text
    table = paper().table(5)
    row = next(line for line in text.splitlines() if line.startswith("| mode (s) |"))
    cells = row.strip("| ").split(" | ")[1:]
    assert len(cells) == len(table.columns)
    assert cells[0].endswith("(534.9) x 1.02")
    assert cells[1].endswith("(231.7) **x 2.03**")
    for assumed in table.assumed:
        assert assumed in text
    assert "| with more obstacles mode is better than vector sum |" in text


def test_each_far_off_cell_has_its_word(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = comparison_of(5, {("mode", "2"): 2.0, ("vector", "4"): 0.4})
    here: dict[str, Any] = {"table": 5, "rows": ("mode",), "columns": ()}
    remarks = (Remark(4, (), (), "of another table"), Remark(**here, says="the streets are narrower"))
    data = replace(paper(), remarks=remarks)
    monkeypatch.setattr(paper_report, "paper", lambda: data)
    text = page_of(comparison)
    assert "2 of 10 cells." in text
    assert "- the streets are narrower: Table 5 mode, robots 2 (x 2.03)." in text
    assert f"- {UNEXPLAINED}: Table 5 vector, robots 4 (x 0.41)." in text
    assert "of another table" not in text


def test_pictures_are_linked() -> None:
    text = page_of(comparison_of(5, {}), **{"terrain clutter": "c.png", "table 5": "t.png"})
    assert "![terrain clutter](c.png)" in text
    assert "![Table 5](t.png)" in text
    assert "0 of 10 cells." in text


def test_every_remark_speaks_of_cells_that_are_there() -> None:
    for remark in paper().remarks:
        table = paper().table(remark.table)
        rows = [row.name + measure.suffix for measure in table.measures for row in table.rows]
        assert set(remark.rows) <= set(rows)
        assert set(remark.columns) <= {column.name for column in table.columns}
