"""A small table in each form that it is written in."""

import sys
from typing import Any

import pyarrow as pa
import pytest

from monitor.tables.table import Table
from patrol.errors import BadInput

RECORDS: list[dict[str, object]] = [
    {"case": "a", "mean": 61.5},
    {"case": "b,c", "tours": [3, {"x": None}]},
    {"mean": -2, "late": True},
]


def test_records_become_columns_in_the_order_of_their_first_use() -> None:
    table = Table.of(iter(RECORDS))
    assert table.heads == ["case", "mean", "tours", "late"]
    assert table.rows == [["a", 61.5, None, None], ["b,c", None, [3, {"x": None}], None], [None, -2, None, True]]


def test_csv_has_every_row_and_lists_as_json() -> None:
    lines = Table.of(RECORDS).csv().split("\n")
    assert lines == ["case,mean,tours,late", "a,61.5,,", '"b,c",,"[3, {""x"": null}]",', ",-2,,True", ""]
    assert Table(("a",), []).csv() == "a\n"


def test_markdown_has_a_rule_below_its_head() -> None:
    text = Table(("a", "b", "c"), [(1, 2.5, "x"), ("", -3, None)]).markdown()
    assert text.split("\n") == ["| a | b | c |", "|---|---|---|", "| 1 | 2.5 | x |", "|  | -3 | None |"]


def test_latex_is_a_whole_table() -> None:
    rows = [("a_b", 3, "-4.5 ±0.1"), ("100 %", -2, "x-1"), ("p<0.1", 0, "1-2")]
    text = Table(("case & more", "n", "±"), rows, numbers={1, 2}).latex("50 % of #1", "mine")
    assert text.split("\n") == [
        r"% \usepackage{booktabs}",
        r"\begin{table}",
        r"\centering\small",
        r"\caption{50 \% of \#1}",
        r"\label{tab:mine}",
        r"\begin{tabular}{@{}lrr@{}}",
        r"\toprule",
        r"case \& more & n & $\pm$ \\",
        r"\midrule",
        r"a\_b & 3 & $-$4.5 $\pm$0.1 \\",
        r"100 \% & $-$2 & x-1 \\",
        r"p$<$0.1 & 0 & 1-2 \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
        "",
    ]


@pytest.mark.parametrize(
    ("character", "escaped"),
    [
        *((character, rf"\{character}") for character in "&%$#_{}"),
        *(("\\", r"\textbackslash{}"), ("~", r"\textasciitilde{}"), ("^", r"\textasciicircum{}")),
        *(("±", r"$\pm$"), ("²", r"\textsuperscript{2}"), ("<", "$<$"), ("a-b", "a-b"), ("--1", "--1"), ("- 1", "- 1")),
    ],
)
def test_latex_prints_every_character(character: str, escaped: str) -> None:
    assert f"\n{escaped} \\\\\n\\midrule" in Table((character,), []).latex("", "")
    assert rf"\caption{{{escaped}}}" in Table(("a",), []).latex(character, "")


@pytest.mark.parametrize(
    ("values", "kind", "found"),
    [
        ([1, None, -(1 << 40)], pa.int64(), None),
        ([True, None, False], pa.bool_(), None),
        ([1, 2.5, None], pa.float64(), [1.0, 2.5, None]),
        ([0.5, None], pa.float64(), None),
        ([None, None], pa.float64(), None),
        ([], pa.float64(), None),
        (["a", None, ""], pa.string(), None),
        ([1, "a", None], pa.string(), ["1", "a", None]),
        ([True, 2], pa.string(), ["true", "2"]),
        ([[1, 2], None], pa.string(), ["[1, 2]", None]),
        ([{"a": 1.5}], pa.string(), ['{"a": 1.5}']),
    ],
)
def test_an_arrow_column_has_the_type_of_its_values(values: list[Any], kind: pa.DataType, found: list[Any]) -> None:
    table = Table(("other", "column"), [("x", value) for value in values]).arrow()
    assert table.column_names == ["other", "column"]
    assert table.schema.field("column").type == kind
    column = table["column"].to_pylist()
    assert column == (values if found is None else found)
    assert [type(value) for value in column] == [type(value) for value in (values if found is None else found)]
    assert table["other"].to_pylist() == ["x"] * len(values)


def test_without_pyarrow_only_arrow_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    table = Table(("a",), [(1,)])
    assert table.csv() == "a\n1\n"
    with pytest.raises(BadInput, match=r"pip install 'fogwatch\[tables\]'"):
        table.arrow()
