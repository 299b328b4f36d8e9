"""The table of a sweep for a paper: its columns, what its caption says, and columns that are refused."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from experiments.sweeps.cases import LATEX, CaseRow, latex_heads, write_latex
from experiments.sweeps.plan import Label
from experiments.sweeps.stats import estimate
from patrol.errors import BadInput


def row(policy: str, fault: str, values: Sequence[float], against: str | None) -> CaseRow:
    by_seed = dict(enumerate(values, start=1))
    metrics = {"mfow_mean_s": estimate(values), "collisions": estimate([3.0])}
    labels = (Label("patrol.policy", "policy", policy, True), Label("faults", "faults", fault, True))
    change = {} if against is None else {"mfow_mean_s": estimate([-5.0, -7.0, -6.0])}
    name = f"{policy} {fault}"
    return CaseRow(name, {}, len(values), 0, 0, metrics, {"mfow_mean_s": by_seed}, against, change, labels)


ROWS = [
    row("old", "none", (10.0, 12.0, 14.0), None),
    row("new_one", "none", (5.0, 5.5, 8.5), "old none"),
    row("old", "half", (20.0, 22.0, 24.0), None),
    row("new_one", "half", (19.0, 23.0, 24.5), "old half"),
]


def table(tmp_path: Path, rows: Sequence[CaseRow] = ROWS, columns: str = LATEX) -> tuple[list[str], str]:
    write_latex(rows, "mine", latex_heads(columns), tmp_path / "table.tex")
    lines = (tmp_path / "table.tex").read_text(encoding="utf-8").splitlines()
    (caption,) = (line for line in lines if line.startswith(r"\caption"))
    (body,) = (slice(lines.index(r"\toprule") + 1, lines.index(r"\bottomrule")),)
    return [line for line in lines[body] if line != r"\midrule"], caption


def test_a_table_has_the_axes_that_vary_mean_change_and_p(tmp_path: Path) -> None:
    lines, caption = table(tmp_path)
    assert lines[0] == r"policy & faults & mean MFoW (s) & change of MFoW (\%) & p \\"
    assert lines[1] == r"old & none & 12.0 $\pm$5.0 & - & - \\"
    assert lines[2].startswith(r"new\_one & none & 6.3 $\pm$4.7 & $-$6.0 $\pm$2.5 & 0.0")
    assert "against old;" in caption
    assert "corrected for 2 comparisons by Holm's method" in caption


def test_columns_can_be_chosen(tmp_path: Path) -> None:
    lines, _ = table(tmp_path, columns="collisions, runs,mfow_mean_s")
    assert lines[0] == r"policy & faults & collisions & runs & mean MFoW (s) \\"
    assert lines[1].startswith("old & none & 3.0 & 3 & 12.0")


def test_without_comparisons_there_is_neither_change_nor_p(tmp_path: Path) -> None:
    lines, caption = table(tmp_path, rows=ROWS[::2])
    assert lines[0] == r"faults & mean MFoW (s) \\"
    assert "p of" not in caption


@pytest.mark.parametrize(
    ("columns", "says"),
    [("mfow_mean", "mfow_mean: no such column; did you mean mfow_mean_s"), ("", "nothing: no such column")],
)
def test_other_columns_are_refused(columns: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        latex_heads(columns)
