"""The figures of a sweep: which there are, and that they show the numbers and name the test."""

from pathlib import Path

import numpy as np
from PIL import Image

from experiments.sweeps.cases import CaseRow, paired_tests
from experiments.sweeps.figures import drawings
from experiments.sweeps.plan import Label
from experiments.sweeps.stats import estimate
from monitor.figures.style import DPI

# Not the product's own, so that a wrong one there is noticed.
MOST_ROWS = 80


def row(dilatation: object, direction: str, values: list[float]) -> CaseRow:
    settings = {"patrol.options.dilatation": dilatation, "patrol.options.direction": direction}
    mfow = {"mfow_mean_s": dict(enumerate(values, start=1))}
    other = None if direction == "mode" else f"dilatation={dilatation} direction=mode"
    changes = [100.0 * (value - 80.0) / 80.0 for value in values]
    change = {} if other is None else {"mfow_mean_s": estimate(changes)}
    name = f"dilatation={dilatation} direction={direction}"
    return CaseRow(name, settings, len(values), 0, 0, {"mfow_mean_s": estimate(values)}, mfow, other, change)


def rows(numbers: list[object]) -> list[CaseRow]:
    values = {"mode": [78.0, 80.0, 82.0], "vector": [70.0, 75.0, 78.0]}
    return [row(number, direction, values[direction]) for number in numbers for direction in values]


def test_a_number_with_three_values_gets_curves_and_compared_cases_a_change(tmp_path: Path) -> None:
    drawn = {drawing.name: drawing for drawing in drawings(rows([0, 2, 5]), "trial")}
    assert list(drawn) == ["cases-mfow_mean_s", "change-mfow_mean_s", "curves-mfow_mean_s"]
    (axes,) = drawn["curves-mfow_mean_s"].figure.axes
    assert axes.get_xlabel() == "patrol.options.dilatation"
    assert axes.get_legend_handles_labels()[1] == ["direction=mode", "direction=vector"]
    lines = [np.asarray(line.get_xydata()).tolist() for line in axes.lines]
    assert next(line for line in lines if len(line) == 3) == [[0.0, 80.0], [2.0, 80.0], [5.0, 80.0]]
    change = drawn["change-mfow_mean_s"]
    assert "two-sided paired t-test" in change.caption
    notes = [text.get_text() for text in change.figure.axes[0].texts]
    assert len(notes) == 3
    (test, *_) = paired_tests(rows([0, 2, 5]))
    assert test.p is not None
    assert notes == [f"p = {3 * test.p:.3f}"] * 3, "the three tests are equal, and each is corrected for all"
    assert change.figure.axes[0].get_xlabel() == "change of mean MFoW against direction=mode (%), n = 3"
    png, svg, pdf = change.save(tmp_path)
    assert png.stat().st_size > 1000
    assert notes[0] in svg.read_text(encoding="utf-8")
    assert pdf.read_bytes().startswith(b"%PDF")


def test_settings_that_are_no_numbers_get_no_curves() -> None:
    for third in ([], [True]):
        names = [drawing.name for drawing in drawings(rows([0, 2, *third]), "trial")]
        assert names == ["cases-mfow_mean_s", "change-mfow_mean_s"]


def test_a_large_sweep_has_no_figure_with_a_row_for_each_case() -> None:
    names = [drawing.name for drawing in drawings(rows(list(range(MOST_ROWS + 1))), "trial")]
    assert names == ["curves-mfow_mean_s"]


def test_policies_under_faults_have_a_row_a_fault_and_a_colour_a_policy_in_a_columns_width(tmp_path: Path) -> None:
    def case(policy: str, fault: str) -> CaseRow:
        labels = (Label("patrol.policy", "policy", policy, given=True), Label("faults", "faults", fault, given=True))
        mfow = {"mfow_mean_s": {1: 30.0, 2: 32.0}}
        change = {} if policy == "ours" else {"mfow_mean_s": estimate([1.0, 2.0])}
        against = None if policy == "ours" else f"ours {fault}"
        means = {"mfow_mean_s": estimate([30.0, 32.0])}
        return CaseRow(f"{policy} {fault}", {}, 2, 0, 0, means, mfow, against, change, labels)

    grouped = [case(policy, fault) for policy in ("ours", "theirs") for fault in ("no fault", "half lost")]
    cases, change = drawings(grouped, "trial", 88 / 25.4)
    for drawing, series in ((cases, ["ours", "theirs"]), (change, ["theirs"])):
        (axes,) = drawing.figure.axes
        assert [label.get_text() for label in axes.get_yticklabels()] == ["no fault", "half lost"]
        assert axes.get_legend_handles_labels()[1] == series
    png, _, _ = cases.save(tmp_path)
    with Image.open(png) as image:
        assert abs(image.width - 88 / 25.4 * DPI) < 1.0
