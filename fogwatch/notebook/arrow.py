"""Arrow tables of rows whose values come from settings and results, so that their types are known only when read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from monitor.tables.arrow import check_pyarrow
from patrol.errors import quoted

if TYPE_CHECKING:
    import pyarrow as pa


def table_of(rows: Sequence[Mapping[str, object]]) -> pa.Table:
    """Make a table of rows; a column whose values are of several types holds texts.

    For example, {"robots.count": 3, "mfow_mean_s": 61.5} gives an integer and a number, and lists become texts. Values
    that a row lacks are null.
    """
    check_pyarrow()
    import pyarrow as pa

    names = list(dict.fromkeys(name for row in rows for name in row))
    return pa.table({name: _column([row.get(name) for row in rows]) for name in names})


def _column(values: Sequence[object]) -> pa.Array:
    import pyarrow as pa

    kinds = {type(value) for value in values if value is not None}
    if kinds == {bool}:
        return pa.array(values, pa.bool_())
    if kinds == {int}:
        return pa.array(values, pa.int64())
    if kinds <= {int, float}:  # also of nulls alone
        return pa.array([None if value is None else float(value) for value in values], pa.float64())  # type: ignore[arg-type]
    return pa.array([value if value is None or isinstance(value, str) else quoted(value) for value in values])
