"""The results of a sweep case by case: means over seeds with their intervals, as columns, CSV, JSON and LaTeX."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.sweeps.caserows import CaseRow, case_rows
from experiments.sweeps.paired import PAIRING, TEST, paired_lines, paired_tests
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.runtable import case_labels, csv_value, run_rows, table_lines
from experiments.sweeps.stats import with_interval
from experiments.sweeps.texttable import latex_table
from experiments.sweeps.worker import software
from patrol.errors import BadInput
from patrol.files.whole_file import write_whole

SHOWN = {
    "mfow_mean_s": "mean MFoW (s)",
    "mfow_max_s": "largest MFoW (s)",
    "fog_mean_s": "mean fog (s)",
    "dead_end_percent": "dead ends (%)",
    "collisions": "collisions",
}
"""Metrics that terminals, notebooks, papers and figures show, and their titles; the files have all metrics."""

CHANGE = "change of MFoW (%)"


def write_tables(outcome: SweepOutcome, folder: Path) -> tuple[Path, Path]:
    """Write the tables of a sweep, and return the paths of summary.csv and summary.json.

    The others are table.tex, runs.csv and comparisons.csv. runs.csv has a row for each run, comparisons.csv the paired
    tests.
    """
    rows = case_rows(outcome)
    as_csv, as_json = folder / "summary.csv", folder / "summary.json"
    write_text(as_csv, csv_text(case_lines(rows)))
    write_text(folder / "runs.csv", csv_text(table_lines(run_rows(outcome, case_labels(outcome)))))
    write_text(folder / "comparisons.csv", csv_text(paired_lines(paired_tests(rows))))
    content = {
        "name": outcome.plan.name,
        "software": software(),
        "seeds": list(outcome.plan.seeds),
        "cases": [_json_row(row) for row in rows],
        "failed": [{"case": run.case, "seed": run.seed, "error": run.error} for run in outcome.failed],
    }
    write_text(as_json, json_text(content))
    write_text(folder / "table.tex", _latex(rows, outcome.plan.name))
    return as_csv, as_json


def csv_text(lines: Iterator[Sequence[object]]) -> str:
    """Write values, line by line, as CSV text; None gives an empty field."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(lines)
    return out.getvalue()


def json_text(value: Any) -> str:
    """Return a value as indented JSON text; it must be without NaN."""
    return f"{json.dumps(value, indent=1, allow_nan=False)}\n"


def make_folder(folder: Path) -> None:
    """Make a folder, unless it exists."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder}: cannot be made ({error.strerror}); choose another --out") from None


def write_text(path: Path, text: str) -> None:
    """Write a file, and its folder if it is missing."""
    make_folder(path.parent)
    try:
        write_whole(path, text)
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); choose another --out") from None


def told_apart(cases: Mapping[str, Sequence[str]]) -> tuple[dict[str, str], str]:
    """Return shorter names of cases by the whole ones, and the words that they lack because all share them.

    `cases` has the words of each name by the whole name. No name is left empty; where two would become the same, all
    stay whole.
    """
    words = list(cases.values())
    common = [word for word in words[0] if all(word in others for others in words[1:])] if len(cases) > 1 else []
    if any(all(word in common for word in own) for own in words):
        common = []
    short = [" ".join(word for word in own if word not in common) for own in words]
    if len(set(short)) < len(cases):
        return {case: case for case in cases}, ""
    return dict(zip(cases, short, strict=True)), " ".join(common)


@dataclass(frozen=True, slots=True)
class ShownColumn:
    """A column of the table that terminals, notebooks and papers show."""

    title: str  # its heading
    cells: tuple[str, ...]  # texts, one for each case
    is_number: bool = True  # True if the cells are numbers


def shown_columns(rows: Sequence[CaseRow], names: Mapping[str, str]) -> list[ShownColumn]:
    """Return the columns that show a sweep's results.

    They are runs, the measures of `SHOWN`, and changes where there are any. `names` is what the table calls each case.
    """
    shown = {name: title for name, title in SHOWN.items() if any(name in row.metrics for row in rows)}
    runs = [
        ", ".join(
            [
                f"{row.runs}",
                *([f"{row.failed} failed"] if row.failed else []),
                *([f"{row.warned} with warnings"] if row.warned else []),
            ]
        )
        for row in rows
    ]
    columns = [ShownColumn("runs", tuple(runs))]
    for name, title in shown.items():
        columns.append(ShownColumn(title, tuple(with_interval(row.metrics.get(name)) for row in rows)))
    if any(row.against for row in rows):
        changes = tuple(with_interval(row.change.get("mfow_mean_s")) for row in rows)
        others = tuple("" if row.against is None else names.get(row.against, row.against) for row in rows)
        columns += [ShownColumn(CHANGE, changes), ShownColumn("compared with", others, is_number=False)]
    return columns


def _latex(rows: Sequence[CaseRow], sweep: str) -> str:
    """Return table.tex: a column for each axis that varies, then what terminals show."""
    names, _ = told_apart({row.case: row.words for row in rows})
    axes = list(dict.fromkeys((label.axis, label.title) for row in rows for label in row.labels))
    texts = {axis: [label.text for row in rows for label in row.labels if label.axis == axis] for axis, _ in axes}
    cases = [
        ShownColumn(title, tuple(texts[axis]), is_number=False) for axis, title in axes if len(set(texts[axis])) > 1
    ] or [ShownColumn("case", tuple(names[row.case] for row in rows), is_number=False)]
    columns = [*cases, *shown_columns(rows, names)]
    note = [f"{sweep}: means over the runs (seeds) and half the width of their 95 % interval"]
    if any(row.against for row in rows):
        note.append(f"change: mean over pairs of runs with the {PAIRING}; {TEST}s are in comparisons.csv")
    heads = [column.title for column in columns]
    cells = list(zip(*(column.cells for column in columns), strict=True))
    return latex_table(heads, cells, [k for k, column in enumerate(columns) if column.is_number], note)


def case_lines(rows: Sequence[CaseRow]) -> Iterator[Sequence[object]]:
    """Yield the lines of summary.csv."""
    fields = list(dict.fromkeys(field for row in rows for field in row.settings))
    names = list(dict.fromkeys(name for row in rows for name in row.metrics))
    changes = list(dict.fromkeys(name for row in rows for name in row.change))
    columns = [*names, *(f"{name}_change_percent" for name in changes)]
    numbered = [f"{name}{end}" for name in columns for end in ("", "_low", "_high")]
    yield ["case", *fields, "runs", "failed", "warned", *numbered, *(["against"] if changes else [])]
    for row in rows:
        settings = [csv_value(row.settings.get(field)) for field in fields]
        numbers: list[float | None] = []
        for estimated in (*map(row.metrics.get, names), *map(row.change.get, changes)):
            numbers += [None, None, None] if estimated is None else [estimated.mean, estimated.low, estimated.high]
        yield [row.case, *settings, row.runs, row.failed, row.warned, *numbers, *([row.against] if changes else [])]


def _json_row(row: CaseRow) -> dict[str, Any]:
    return {
        "case": row.case,
        "set": dict(row.settings),
        "runs": row.runs,
        "failed": row.failed,
        "warned": row.warned,
        "metrics": {
            name: {
                "mean": estimated.mean,
                "ci95": estimated.interval,
                "values": {str(seed): value for seed, value in row.values[name].items()},
            }
            for name, estimated in row.metrics.items()
        },
        "against": row.against,
        "change_percent": {
            name: {"mean": estimated.mean, "ci95": estimated.interval} for name, estimated in row.change.items()
        },
    }
