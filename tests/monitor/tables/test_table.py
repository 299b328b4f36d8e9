"""Tables of text for pages and papers."""

from __future__ import annotations

from monitor.tables.table import Table


def test_a_latex_table_aligns_numbers_and_escapes_what_latex_would_read() -> None:
    text = Table(["case_1", "change (%)"], [["a & b-2", "-3.5 ±0.1"]], [1]).latex(["50 seeds"])
    assert text.splitlines() == [
        "% 50 seeds",
        r"% \usepackage{booktabs}",
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"case\_1 & change (\%) \\",
        r"\midrule",
        r"a \& b-2 & $-$3.5 $\pm$0.1 \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]
