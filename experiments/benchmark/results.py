"""The results of the benchmark: a line per run, a line per cell, and tables of policies by terrains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from experiments.benchmark.matrix import BenchmarkCell, Matrix, robots_text
from experiments.sweeps.cases import CaseRow, case_rows, runs_table
from experiments.sweeps.plan import Run
from experiments.sweeps.results import RunResult
from experiments.sweeps.run_metrics import GAINED, game_metric, moving_metric
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import with_interval
from monitor.tables.table import Table

LATE, TOUR, SEEN = "mfow_late_mean_s", "best_tour_s", "seen_share"
OVER_TOUR = "mfow_late_over_tour"
"""Name of the metric that is the late MFoW as a ratio to that on the best tour found."""

ATTACK_S = 75.0
"""Duration of the attacks whose successes tables show, s; the files have the others too."""

INTRUDED = game_metric("worst", ATTACK_S)

BEST_TOUR = "best tour found"
"""The first row of `policy_table`."""


@dataclass(frozen=True, slots=True)
class ShownMetric:
    """A number of each cell that pages show."""

    metric: str  # its name in the results
    title: str  # its name on pages, with its unit
    digits: int = 0  # decimals that are printed

    def text(self, row: CaseRow | None) -> str:
        """Return its mean in a row with half the width of its 95 % interval, as in "12.3 ± 0.4", or "-"."""
        return with_interval(None if row is None else row.metrics.get(self.metric), self.digits, " ± ")


MEASURES = (
    ShownMetric(LATE, "MFoW, second half (s)"),
    ShownMetric(OVER_TOUR, "MFoW / best tour", 2),
    ShownMetric("mfow_max_s", "largest MFoW (s)"),
    ShownMetric("fog_mean_s", "mean fog (s)"),
    ShownMetric("nodes_worst_s", "worst idleness of a vertex (s)"),
    ShownMetric("nodes_idleness_mean_s", "mean idleness of vertices (s)"),
    ShownMetric("collisions", "collisions"),
    ShownMetric("nodes_interference", "interference"),
    *(
        ShownMetric(game_metric(intruder, ATTACK_S), f"{intruder} intruder, {ATTACK_S:g} s (%)", 1)
        for intruder in ("random", "waiting", "statistical")
    ),
    *(
        ShownMetric(moving_metric(predictor), f"moving intruder, {predictor} (%)", 1)
        for predictor in ("blind", "similar", "each", "future")
    ),
    ShownMetric(GAINED, "gain of watching (points)", 1),
)
"""The measures, in the order of the tables; those that no cell has are left out there."""


@dataclass(frozen=True, slots=True)
class CellResult:
    """The results of a cell."""

    cell: BenchmarkCell
    row: CaseRow  # its means with their intervals
    command: str  # command line that makes its first run again

    @property
    def seen_all(self) -> bool:
        """True if all ground was seen in each run."""
        return self.mean(SEEN) == 1.0

    def text(self, measure: ShownMetric) -> str:
        """Return a measure with half the width of its 95 % interval, "-" without one.

        A late MFoW of runs in which some ground was never seen is the time since the start, so that it says how much
        was seen instead.
        """
        seen_share = self.mean(SEEN)
        if measure.metric in (LATE, OVER_TOUR) and seen_share is not None and not self.seen_all:
            return f"({100.0 * seen_share:.2f} % seen)"
        return measure.text(self.row)

    def mean(self, metric: str) -> float | None:
        """Return the mean of a metric, or None."""
        estimate = self.row.metrics.get(metric)
        return None if estimate is None else estimate.mean


@dataclass(frozen=True, slots=True)
class BenchmarkResults:
    """All results."""

    outcome: SweepOutcome  # of the sweep, with `OVER_TOUR` as one more metric
    cells: tuple[CellResult, ...]  # in the matrix's order

    @property
    def groups(self) -> list[tuple[int, str, list[CellResult]]]:
        """The cells of each team and condition, with those."""
        grouped = groupby(self.cells, lambda result: (result.cell.team, result.cell.condition))
        return [(team, condition, list(results)) for (team, condition), results in grouped]


def results_of(matrix: Matrix, outcome: SweepOutcome) -> BenchmarkResults:
    """Return the results of the matrix's runs."""
    outcome = replace(outcome, results={key: _with_ratio(result) for key, result in outcome.results.items()})
    pairs = zip(matrix.cells, case_rows(outcome), strict=True)
    return BenchmarkResults(outcome, tuple(CellResult(cell, row, cell.command(matrix.seeds[0])) for cell, row in pairs))


def _with_ratio(result: RunResult) -> RunResult:
    late, tour = result.metrics.get(LATE), result.metrics.get(TOUR)
    ratio = late / tour if late is not None and tour else None
    return replace(result, metrics={**result.metrics, OVER_TOUR: ratio})


def cell_rows(results: BenchmarkResults) -> list[CaseRow]:
    """Return the rows of cells.csv: those of a sweep, with the cell's coordinates and its command as its settings."""
    return [replace(result.row, settings={**result.cell.labels, "command": result.command}) for result in results.cells]


def run_rows(results: BenchmarkResults) -> Table:
    """Return the table of runs.csv: for each run the coordinates of its cell, its command and its numbers."""
    cells = {result.cell.name: result.cell for result in results.cells}

    def labels(run: Run) -> Mapping[str, object]:
        cell = cells[run.case]
        return {**cell.labels, "command": cell.command(run.seed)}

    return runs_table(results.outcome, labels)


def policy_table(results: Sequence[CellResult]) -> Table:
    """Return the table of the policies of a team under a condition.

    Its columns are late MFoW by terrain, fog, collisions and intruders. The first row is the best tour found, where
    there is one. `results` are the cells of that team and condition.
    """
    terrains = list(dict.fromkeys(result.cell.terrain.name for result in results))
    policies = list(dict.fromkeys(result.cell.policy.name for result in results))
    by_place = {(result.cell.policy.name, result.cell.terrain.name): result for result in results}
    beside = [
        ("mean fog (s)", "fog_mean_s"),
        ("collisions", "collisions"),
        (f"attacks of {ATTACK_S:g} s (%)", INTRUDED),
    ]
    if any(GAINED in result.row.metrics for result in results):  # none in runs that are too short
        beside.append(("gain of watching (points)", GAINED))
    order = ", same order" if len(terrains) > 1 else ""
    heads = ["policy", *terrains, *(f"{title}{order}" for title, _ in beside)]
    tours = [_first_value(by_place[policy, terrain].mean(TOUR) for policy in policies) for terrain in terrains]
    rows = [[BEST_TOUR, *map(_whole_text, tours), *("" for _ in beside)]] if any(tours) else []
    for policy in policies:
        cells = [by_place[policy, terrain] for terrain in terrains]
        late = [cell.text(MEASURES[0]) for cell in cells]
        rows.append(
            [policy, *late, *(" / ".join(_whole_text(cell.mean(metric)) for cell in cells) for _, metric in beside)]
        )
    return Table(heads, rows, range(1, len(heads)))


def _first_value(values: Iterator[float | None]) -> float | None:
    return next((value for value in values if value is not None), None)


def _whole_text(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f}"


def describe(team: int, condition: str) -> str:
    """Return the settings that the runs of a team under a condition share, in words."""
    return f"{robots_text(team)}, {'no fault' if condition == 'none' else condition}"


def shared_settings(matrix: Matrix) -> str:
    """Return the settings that all runs share, in words."""
    settings: Mapping[str, object] = {"duration": matrix.duration_s, **matrix.settings}
    seeds = ", ".join(map(str, matrix.seeds))
    return f"{', '.join(f'{name} = {value}' for name, value in settings.items())}; seeds {seeds}"
