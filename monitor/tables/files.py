"""Files of a run's tables: Parquet or CSV, a file a table, all of them whole or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from monitor.tables.arrow import batches, schema_of
from monitor.tables.columns import TABLES
from monitor.tables.table import check_pyarrow
from patrol.errors import BadInput
from patrol.files.whole_file import replacing

if TYPE_CHECKING:
    import pyarrow as pa

    from monitor.replay.run import Run

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
