"""A run's tables as Arrow tables, with units in names and metadata, and as files: Parquet or CSV, all or none."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from monitor.tables.columns import TABLES, TableColumns
from monitor.tables.rows import Row, rows_by_tick
from monitor.tables.table import check_pyarrow
from patrol.errors import BadInput, did_you_mean
from patrol.files.whole_file import replacing

if TYPE_CHECKING:
    import pyarrow as pa

    from monitor.replay.run import Run


BATCH_ROWS = 1 << 16
"""Rows that are collected as Python values before they become an Arrow batch, or one tick's rows more."""


def schema_of(table: TableColumns, run: Run) -> pa.Schema:
    """Return the schema of a table; its metadata say which run it is of."""
    import pyarrow as pa

    kinds = {"integer": pa.int64(), "number": pa.float64(), "text": pa.string(), "flag": pa.bool_()}
    fields = [
        pa.field(column.name, kinds[column.kind], metadata={"unit": column.unit, "meaning": column.meaning})
        for column in table.columns
    ]
    header = run.journal.header
    facts = {
        "table": table.name,
        "row": table.row,
        "run": run.title,
        "scenario_hash": header.scenario_hash,
        "trace_hash": run.trace,
        "software": header.software,
        "step_s": repr(run.step),
        "ended": run.ended or "",
    }
    return pa.schema(fields, metadata=facts)


def batches(
    run: Run, names: Sequence[str], share: Callable[[float], None] = lambda _: None
) -> Iterator[tuple[str, pa.RecordBatch]]:
    """Yield tables piece by piece with their names; the memory needed does not grow with the run.

    A table without rows gives one empty batch. `share` is called with the share of the work that is done, 0 to 1.
    """
    check_pyarrow()
    import pyarrow as pa

    unknown = next((name for name in names if name not in TABLES), None)
    if unknown is not None:
        raise BadInput(f"table {unknown}: a run has no such table; {did_you_mean(unknown, list(TABLES))}")
    schemas = {name: schema_of(TABLES[name], run) for name in names}
    waiting: dict[str, list[Row]] = {name: [] for name in names}
    begun: set[str] = set()

    def batch_of(name: str) -> pa.RecordBatch:
        schema, rows = schemas[name], waiting[name]
        columns: Sequence[Sequence[Any]] = list(zip(*rows, strict=True)) if rows else [()] * len(schema)
        arrays = [pa.array(column, field.type) for column, field in zip(columns, schema, strict=True)]
        waiting[name] = []
        begun.add(name)
        return pa.record_batch(arrays, schema=schema)

    for name, rows in rows_by_tick(run, names, share):
        waiting[name] += rows
        if len(waiting[name]) >= BATCH_ROWS:
            yield name, batch_of(name)
    for name in names:
        if waiting[name] or name not in begun:
            yield name, batch_of(name)


def arrow_table(run: Run, name: str) -> pa.Table:
    """Make one table of a run.

    For example, ``arrow_table(run, "ticks").to_pandas()`` has a row for each tick.
    """
    pieces = [batch for _, batch in batches(run, [name])]
    import pyarrow as pa

    return pa.Table.from_batches(pieces)


Format = Literal["parquet", "csv"]
FORMATS: tuple[Format, ...] = get_args(Format)


def write_tables(
    run: Run,
    folder: Path,
    kind: Format,
    names: Sequence[str] = tuple(TABLES),
    share: Callable[[float], None] = lambda _: None,
) -> list[Path]:
    """Write tables of a run, each into a file NAME.parquet or NAME.csv.

    For example, ``write_tables(run, Path("out"), "csv", ["ticks"])`` writes out/ticks.csv.

    Files of these names are replaced; after an error, none is. `share` is called with the share of the work that is
    done, 0 to 1.
    """
    check_pyarrow()
    files = {name: folder / f"{name}.{kind}" for name in names}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            parts = {name: stack.enter_context(replacing(file)) for name, file in files.items()}
            with ExitStack() as open_files:
                writers = {
                    name: open_files.enter_context(_open_writer(part, kind, schema_of(TABLES[name], run)))
                    for name, part in parts.items()
                }
                for name, batch in batches(run, names, share):
                    writers[name].write_batch(batch)
    except OSError as error:
        why = error.strerror or str(error)
        raise BadInput(f"{folder}: tables cannot be written ({why}); choose another folder") from None
    return list(files.values())


def _open_writer(part: Path, kind: Format, schema: pa.Schema) -> Any:
    """Open a file for record batches, as a context manager that closes it."""
    if kind == "parquet":
        from pyarrow.parquet import ParquetWriter

        return ParquetWriter(part, schema, compression="zstd")
    from pyarrow.csv import CSVWriter

    return CSVWriter(part, schema)
