"""The results of a sweep case by case, paired tests of cases, and the files that hold them.

Paired tests tell whether a setting changes a metric, judged seed by seed. Two cases that differ in one setting run with
the same seeds: the same starts, faults and draws. The difference of a metric is taken within each seed, so what the
seeds have in common cancels out. For example, an MFoW of 81, 95 and 88 s against one of 90, 99 and 97 s gives the
differences -9, -4 and -9 s.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.sweeps.plan import Case, Label, Run
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate, estimate, with_interval
from monitor.tables.table import Table
from patrol.errors import BadInput, did_you_mean
from patrol.files.whole_file import write_whole, writing

SHOWN = {
    "mfow_mean_s": "mean MFoW (s)",
    "mfow_max_s": "largest MFoW (s)",
    "fog_mean_s": "mean fog (s)",
    "dead_end_percent": "dead ends (%)",
    "collisions": "collisions",
}
"""Metrics that terminals, notebooks, papers and figures show, and their titles; the files have all metrics."""


def bare(title: str) -> str:
    """Return the title of a metric without its unit."""
    return title.rpartition(" (")[0] or title


CHANGE = "change of MFoW (%)"
P = "p"

NO_P = "-"
"""Text in place of a p-value where there is none."""

LATEX = "mfow_mean_s,change,p"
"""Columns of table.tex unless others are asked for."""


@dataclass(frozen=True, slots=True)
class CaseRow:
    """The results of one case."""

    case: str
    settings: Mapping[str, object]  # of the base scenario, by dotted field
    runs: int  # number of its valid runs
    failed: int
    warned: int  # number of its runs whose verdict has warnings
    metrics: Mapping[str, Estimate]  # mean of each over the seeds
    values: Mapping[str, Mapping[int, float]]  # of each metric, by seed
    against: str | None  # case that it is compared with; None for none
    # by how many percent each metric's mean is above that case's, with the interval of the differences seed by seed
    change: Mapping[str, Estimate]
    labels: tuple[Label, ...] = ()  # its values by axis, in the order of its name

    @property
    def words(self) -> list[str]:
        """The words of the case's name: one for each axis, or those of the name where there are no axes."""
        return [label.word for label in self.labels] or self.case.split()


def case_rows(outcome: SweepOutcome) -> list[CaseRow]:
    """Return the results of a sweep, one row per case in the plan's order.

    Metrics that no run has are left out.
    """
    names = list(dict.fromkeys(name for result in outcome.results.values() if result.ok for name in result.metrics))
    return [_case_row(outcome, case, names) for case in outcome.plan.cases]


def _case_row(outcome: SweepOutcome, case: Case, names: Sequence[str]) -> CaseRow:
    partner = outcome.plan.partner(case)
    runs = [outcome.results[run.key] for run in outcome.plan.runs_of(case.name) if run.key in outcome.results]
    good = sum(result.ok for result in runs)
    values = {name: by_seed for name in names if (by_seed := outcome.values(case.name, name))}
    metrics = {name: estimate(list(by_seed.values())) for name, by_seed in values.items()}
    change = {
        name: difference
        for name, by_seed in values.items()
        if partner is not None
        and (difference := _change_in_percent(by_seed, outcome.values(partner.name, name))) is not None
    }
    warned = sum(value > 0.0 for value in values.get("warnings", {}).values())
    against = None if partner is None else partner.name
    counts = (good, len(runs) - good, warned)
    return CaseRow(case.name, case.settings, *counts, metrics, values, against, change, case.labels)


def _change_in_percent(own: Mapping[int, float], others: Mapping[int, float]) -> Estimate | None:
    """Return by how many percent the mean over the seeds that both have is above the other's."""
    seeds = [seed for seed in own if seed in others]
    base = sum(others[seed] for seed in seeds) / max(len(seeds), 1)
    return estimate([100.0 * (own[seed] - others[seed]) / base for seed in seeds]) if base > 0.0 else None


def write_tables(outcome: SweepOutcome, folder: Path, table: str = LATEX) -> None:
    """Write the tables of a sweep.

    They are summary.csv, a row for each case, runs.csv, a row for each run, comparisons.csv, the paired tests, and
    table.tex, with the columns that `table` names (`latex_heads`).
    """
    rows = case_rows(outcome)
    write_text(folder / "summary.csv", cases_table(rows).csv())
    write_text(folder / "runs.csv", runs_table(outcome).csv())
    write_text(folder / "comparisons.csv", comparisons_table(paired_tests(rows)).csv())
    write_latex(rows, outcome.plan.name, latex_heads(table), folder / "table.tex")


def write_text(path: Path, text: str) -> None:
    """Write a file, and its folder if it is missing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{path.parent}: cannot be made ({error.strerror}); choose another --out") from None
    with writing(path, "choose another --out"):
        write_whole(path, text)


def runs_table(outcome: SweepOutcome, labels: Callable[[Run], Mapping[str, object]] | None = None) -> Table:
    """Return the table of the runs that have a result: settings, numbers, and how long each took.

    `labels` gives the first columns; unless given, these are the case and each setting that some case makes.
    """
    fields = dict.fromkeys(field for case in outcome.plan.cases for field in case.settings)
    names = dict.fromkeys(name for result in outcome.results.values() for name in result.metrics)

    def own(run: Run) -> Mapping[str, object]:
        return {"case": run.case, **{field: run.settings.get(field) for field in fields}}

    return Table.of(
        {
            **(labels or own)(run),
            "seed": run.seed,
            "outcome": result.outcome,
            "error": result.error,
            **{name: result.metrics.get(name) for name in names},
            "trace_hash": result.trace_hash,
            "wall_s": result.wall_s,
            "processor_s": result.processor_s,
            "software": result.software,
        }
        for run in outcome.plan.runs
        if (result := outcome.results.get(run.key)) is not None
    )


def cases_table(rows: Sequence[CaseRow]) -> Table:
    """Return the table of summary.csv: each number with the ends of its interval."""
    fields = dict.fromkeys(field for row in rows for field in row.settings)
    names = dict.fromkeys(name for row in rows for name in row.metrics)
    changes = dict.fromkeys(name for row in rows for name in row.change)
    return Table.of(
        {
            "case": row.case,
            **{field: row.settings.get(field) for field in fields},
            "runs": row.runs,
            "failed": row.failed,
            "warned": row.warned,
            **{head: value for name in names for head, value in _interval_ends(name, row.metrics.get(name))},
            **{
                head: v
                for name in changes
                for head, v in _interval_ends(f"{name}_change_percent", row.change.get(name))
            },
            **({"against": row.against} if changes else {}),
        }
        for row in rows
    )


def _interval_ends(name: str, found: Estimate | None) -> Iterator[tuple[str, float | None]]:
    """Yield a mean and the ends of its interval, each with the name of its column."""
    for end, value in (("", "mean"), ("_low", "low"), ("_high", "high")):
        yield f"{name}{end}", None if found is None else getattr(found, value)


def told_apart(cases: Mapping[str, Sequence[str]]) -> tuple[dict[str, str], str]:
    """Return shorter names of cases by the whole ones, and the words that they lack because all share them.

    `cases` has the words of each name by the whole name. No name is left empty; where two would become the same, all
    stay whole.
    """
    words = list(cases.values())
    common = (
        [word for word in words[0] if all(word in later_words for later_words in words[1:])] if len(cases) > 1 else []
    )
    if any(all(word in common for word in case_words) for case_words in words):
        common = []
    short = [" ".join(word for word in case_words if word not in common) for case_words in words]
    if len(set(short)) < len(cases):
        return {case: case for case in cases}, ""
    return dict(zip(cases, short, strict=True)), " ".join(common)


def shown_table(rows: Sequence[CaseRow], names: Mapping[str, str]) -> Table:
    """Return the table that terminals and notebooks show: runs, the measures of `SHOWN`, and changes if there are any.

    `names` has the table's name of each case.
    """
    shown = [name for name in SHOWN if any(name in row.metrics for row in rows)]
    counts = [name for name in ("failed", "warned") if any(getattr(row, name) for row in rows)]
    compared = any(row.against for row in rows)
    p = {test.case: test.p_holm for test in paired_tests(rows) if test.metric == "mfow_mean_s"}
    heads = ["case", "runs", *counts, *(SHOWN[name] for name in shown), *([CHANGE, P] if compared else [])]
    cells = []
    for row in rows:
        numbers = [str(getattr(row, name)) for name in ("runs", *counts)]
        means = [with_interval(row.metrics.get(name)) for name in shown]
        change = [with_interval(row.change.get("mfow_mean_s")), p_text(p.get(row.case))] if compared else []
        cells.append([names.get(row.case, row.case), *numbers, *means, *change])
    return Table(heads, cells, range(1, len(heads)))


def latex_heads(columns: str) -> list[str]:
    """Return the heads in `shown_table` of the columns of table.tex, which are asked for by name."""
    heads = {**SHOWN, "change": CHANGE, P: P, "runs": "runs"}
    names = [name.strip() for name in columns.split(",")]
    for name in names:
        if name not in heads:
            raise BadInput(
                f"--table {columns}: {name or 'nothing'}: no such column; {did_you_mean(name, tuple(heads))}"
            )
    return [heads[name] for name in names]


def write_latex(rows: Sequence[CaseRow], sweep: str, heads: Collection[str], file: Path) -> None:
    """Write table.tex: a column for each axis that varies, then those columns of `shown_table` that are asked for."""
    shown = shown_table(rows, told_apart({row.case: row.words for row in rows})[0])
    axes = dict.fromkeys((label.axis, label.title) for row in rows for label in row.labels)
    texts = {title: [label.text for row in rows for label in row.labels if label.axis == axis] for axis, title in axes}
    varied = {title: column for title, column in texts.items() if len(set(column)) > 1} or {
        "case": [row[0] for row in shown.rows]
    }
    columns = [shown.heads.index(head) for head in heads if head in shown.heads]
    cells = [
        [*cases, *(row[column] for column in columns)] for *cases, row in zip(*varied.values(), shown.rows, strict=True)
    ]
    caption = f"{sweep}: means over the runs (seeds) of a case, with half the width of their 95 % interval."
    if CHANGE in shown.heads:
        place = shown.heads.index(P)
        count = sum(row[place] != NO_P for row in shown.rows)
        caption += (
            f" Change of mean MFoW against {partner_text(rows)}; p of a {TEST} over runs with the {PAIRING}, "
            f"corrected for {count} comparisons by Holm's method."
        )
    numbers = range(len(varied), len(varied) + len(columns))
    table = Table([*varied, *(shown.heads[column] for column in columns)], cells, numbers)
    write_text(file, table.latex(caption, sweep))


def comparison_lines(rows: Sequence[CaseRow]) -> list[str]:
    """Say what the changes are against and how they are judged, in a line; none where nothing is compared."""
    if all(row.against is None for row in rows):
        return []
    return [f"changes are against {partner_text(rows)}, judged by a {TEST}, paired by the {PAIRING}"]


def partner_text(rows: Sequence[CaseRow]) -> str:
    """Return what cases are compared with, such as "stochastic" or "dilatation=0", in the words that tell it apart."""
    by_name = {row.case: row for row in rows}
    partners = [(row, by_name[row.against]) for row in rows if row.against is not None]
    words = (" ".join(word for word in other.words if word not in row.words) or other.case for row, other in partners)
    texts = list(dict.fromkeys(words))
    return texts[0] if len(texts) == 1 else "the case that differs only in what is compared"


TEST = "two-sided paired t-test"
"""The test whose p-values tables and figures show; it agrees with the intervals of the differences."""

PAIRING = "same seed"


@dataclass(frozen=True, slots=True)
class PairedTest:
    """A metric of a case, compared with the same metric of another."""

    case: str
    against: str
    metric: str
    difference: Estimate  # mean over the seeds that both have, in the metric's unit, with its 95 % interval
    change: Estimate | None  # the same in percent of the other's mean; None where that is not above 0
    # the p of the difference, corrected by Holm's method for all tests of this metric
    p_holm: float | None = None

    @property
    def p(self) -> float | None:
        """The probability of so large a difference if the setting had no effect; None where `Estimate.p` is."""
        return self.difference.p

    @property
    def pairs(self) -> int:
        """Number of seeds that both cases have a value for."""
        return self.difference.count


def paired_tests(rows: Sequence[CaseRow]) -> list[PairedTest]:
    """Return the tests of all cases that are compared with another.

    Each has its own p, and one that is corrected for all tests of the same metric.
    """
    by_name = {row.case: row for row in rows}
    tests = []
    for row in rows:
        if row.against is None:
            continue
        for metric, by_seed in row.values.items():
            partner = by_name[row.against].values.get(metric, {})
            differences = [by_seed[seed] - partner[seed] for seed in by_seed if seed in partner]
            if differences:
                tests.append(PairedTest(row.case, row.against, metric, estimate(differences), row.change.get(metric)))
    return [test for metric in dict.fromkeys(test.metric for test in tests) for test in _corrected(tests, metric)]


def _corrected(tests: Sequence[PairedTest], metric: str) -> list[PairedTest]:
    """Return the tests of a metric with p-values that are corrected for their number (Holm 1979).

    The k-th smallest of n is multiplied by n - k + 1, and none is below a smaller one. For example, 0.01, 0.04 and 0.03
    become 0.03, 0.06 and 0.06.
    """
    own = [test for test in tests if test.metric == metric]
    corrected: dict[str, float] = {}
    ordered = sorted((test.p, test.case) for test in own if test.p is not None)
    floor = 0.0
    for place, (p, case) in enumerate(ordered):
        corrected[case] = floor = min(max(floor, p * (len(ordered) - place)), 1.0)
    return [replace(test, p_holm=corrected.get(test.case)) for test in own]


def p_text(p: float | None) -> str:
    """Return a p-value as tables and figures show it, such as 0.031 or <0.001."""
    return NO_P if p is None else "<0.001" if p < 0.001 else f"{p:.3f}"


def comparisons_table(tests: Sequence[PairedTest]) -> Table:
    """Return the table of comparisons.csv: a row for each test."""
    heads = ["case", "against", "metric", "test", "pairing", "pairs", "difference", "low", "high", "change_percent"]
    rows = []
    for test in tests:
        difference, change = test.difference, None if test.change is None else test.change.mean
        ends = (difference.mean, difference.low, difference.high)
        rows.append(
            (test.case, test.against, test.metric, TEST, PAIRING, test.pairs, *ends, change, test.p, test.p_holm)
        )
    return Table([*heads, "p", "p_holm"], rows)
