"""A table in each form that it is written in: CSV, Markdown, LaTeX and Arrow."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from patrol.errors import BadInput, quoted

if TYPE_CHECKING:
    import pyarrow as pa

_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "±": r"$\pm$",
    "²": r"\textsuperscript{2}",
    "<": "$<$",
    ">": "$>$",
    **{character: rf"\{character}" for character in "&%$#_{}"},
}
"""What stands for a character that LaTeX does not print as it is."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values; None is no value.

    For example, the CSV of ``Table(("case", "mfow_mean_s"), [("a", 61.5), ("b", None)])`` ends with ``a,61.5`` and
    ``b,``.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    numbers: Collection[int] = ()  # indices of the columns that are aligned at the right

    @classmethod
    def of(cls, records: Iterable[Mapping[str, object]]) -> Self:
        """Return records, values by column, as a table; a value that a record lacks is None.

        For example, {"a": 1} and {"b": 2} give the heads a and b, and the rows [1, None] and [None, 2].
        """
        records = list(records)
        heads = list(dict.fromkeys(name for record in records for name in record))
        return cls(heads, [[record.get(name) for name in heads] for record in records])

    def csv(self) -> str:
        """Return CSV text; lists and mappings are written as JSON."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.heads)
        writer.writerows([_plain_value(value) for value in row] for row in self.rows)
        return out.getvalue()

    def markdown(self) -> str:
        """Return a table of texts in Markdown.

        For example, the head of the columns a and b is ``| a | b |``.
        """
        rows = [self.heads, *self.rows]
        head, *body = (f"| {' | '.join(map(str, row))} |" for row in rows)
        return "\n".join([head, "|---" * len(self.heads) + "|", *body])

    def latex(self, caption: str, label: str) -> str:
        """Return a table of texts as a table of LaTeX with a caption, and a label for references to it.

        It needs the package booktabs.
        """
        places = "".join("r" if column in self.numbers else "l" for column in range(len(self.heads)))
        head, *body = (rf"{' & '.join(map(_latex_text, row))} \\" for row in [self.heads, *self.rows])
        lines = [r"% \usepackage{booktabs}", r"\begin{table}", r"\centering\small"]
        lines += [
            rf"\caption{{{_latex_text(caption)}}}",
            rf"\label{{tab:{label}}}",
            rf"\begin{{tabular}}{{@{{}}{places}@{{}}}}",
        ]
        lines += [r"\toprule", head, r"\midrule", *body, r"\bottomrule", r"\end{tabular}", r"\end{table}"]
        return "\n".join([*lines, ""])

    def arrow(self) -> pa.Table:
        """Return an Arrow table, whose types follow from the values; a column of several types holds texts.

        For example, {"robots.count": 3, "mfow_mean_s": 61.5} gives an integer and a number, and lists become texts.
        """
        check_pyarrow()
        import pyarrow as pa

        return pa.table(
            {name: _arrow_array([row[column] for row in self.rows]) for column, name in enumerate(self.heads)}
        )


def check_pyarrow() -> None:
    """Raise BadInput unless pyarrow can be imported."""
    try:
        import pyarrow  # noqa: F401 - whether it can be imported
    except ImportError:
        raise BadInput(
            "tables need pyarrow; install it with: pip install 'fogwatch[tables]' (in a checkout: make develop)"
        ) from None


def _plain_value(value: object) -> object:
    return value if value is None or isinstance(value, str | int | float) else quoted(value)


def _latex_text(text: object) -> str:
    """Escape a cell; the hyphen of a negative number becomes a minus sign."""
    escaped = "".join(_LATEX.get(character, character) for character in str(text))
    return re.sub(r"(?<![\w-])-(?=\d)", "$-$", escaped)


def _arrow_array(values: Sequence[object]) -> pa.Array:
    import pyarrow as pa

    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pa.array(values, pa.bool_())
    if kinds == {int}:
        return pa.array(values, pa.int64())
    if kinds <= {int, float}:  # also of nulls alone
        return pa.array([None if value is None else float(value) for value in values], pa.float64())  # type: ignore[arg-type]
    return pa.array([value if value is None or isinstance(value, str) else quoted(value) for value in values])
