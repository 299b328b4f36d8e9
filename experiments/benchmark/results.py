"""The results of the benchmark: what its page shows of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby

from experiments.benchmark.matrix import Matrix, places_of, run_command
from experiments.benchmark.presets import Preset
from experiments.sweeps.cases import CaseRow, cases_table, runs_table
from experiments.sweeps.figures import seen_all
from experiments.sweeps.plan import Run
from experiments.sweeps.results import RunResult
from experiments.sweeps.run_metrics import GAINED, game_metric, moving_metric
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import with_interval
from fogwatch.terminal.live_table import robots_text
from monitor.tables.table import Table
from patrol.scenario import Scenario

LATE, TOUR, TOUR_M, SEEN = "mfow_late_mean_s", "best_tour_s", "best_tour_m", "seen_share"
PLANNED = "planned_percent"
OVER_TOUR = "mfow_late_over_tour"
"""Name of the metric that is the late MFoW as a ratio to that on the best tour found."""

OVER_CAPACITY = "mfow_late_over_capacity"
"""Name of the metric that is the late MFoW as a ratio to the capacity, the tour's length divided by the sum of
speeds."""

ATTACK_S = 75.0
"""Duration of the attacks whose successes tables show, s; the files have the others too."""

INTRUDED = game_metric("worst", ATTACK_S)

BEST_TOUR = "best tour found"
"""The first row of `policy_table`."""

MEASURES: Mapping[str, str] = {
    LATE: "MFoW, second half (s)",
    OVER_TOUR: "MFoW / best tour",
    "mfow_max_s": "largest MFoW (s)",
    "fog_mean_s": "mean fog (s)",
    "nodes_worst_s": "worst idleness of a vertex (s)",
    "nodes_idleness_mean_s": "mean idleness of vertices (s)",
    "collisions": "collisions",
    "nodes_interference": "interference",
    INTRUDED: f"attacks of {ATTACK_S:g} s that succeed, best intruder (%)",
    **{moving_metric(name): f"moving intruder, {name} (%)" for name in ("blind", "watching", "future")},
    GAINED: "gain of watching (points)",
}
"""The measures that figures show, and their titles; the files have all. A preset without published numbers adds its
own."""


def with_ratios(outcome: SweepOutcome) -> SweepOutcome:
    """Return an outcome with `OVER_TOUR` and `OVER_CAPACITY` as two more metrics."""
    scenarios = {run.key: run.scenario for run in outcome.plan.runs}
    results = {key: _with_ratios(result, scenarios.get(key)) for key, result in outcome.results.items()}
    return replace(outcome, results=results)


def _with_ratios(result: RunResult, scenario: Scenario | None) -> RunResult:
    """Return a result with its ratios; `scenario` is None for a run of another plan, whose capacity is unknown."""
    late, tour, length_m = (result.metrics.get(name) for name in (LATE, TOUR, TOUR_M))
    speed = 0.0 if scenario is None else sum(spec.speed for spec in scenario.roster if not spec.spare)
    capacity = length_m / speed if length_m is not None and speed else None
    ratios = {
        name: late / bound if late is not None and bound else None
        for name, bound in ((OVER_TOUR, tour), (OVER_CAPACITY, capacity))
    }
    return replace(result, metrics={**result.metrics, **ratios})


def cell_rows(rows: Sequence[CaseRow], seed: int) -> Table:
    """Return the table of cells.csv: as summary.csv, with the places of a case and its command as its settings."""
    return cases_table([replace(row, settings={**places_of(row), "command": run_command(row, seed)}) for row in rows])


def run_rows(outcome: SweepOutcome) -> Table:
    """Return the table of runs.csv: for each run the places of its case, its command and its numbers."""
    cases = {case.name: case for case in outcome.plan.cases}

    def labels(run: Run) -> Mapping[str, object]:
        return {**places_of(cases[run.case]), "command": run_command(cases[run.case], run.seed)}

    return runs_table(outcome, labels)


def groups_of(rows: Sequence[CaseRow]) -> list[tuple[str, list[CaseRow]]]:
    """Return the rows of each team and condition, with these in words."""

    def words(row: CaseRow) -> str:
        places = places_of(row)
        condition = "no fault" if places["condition"] == "none" else places["condition"]
        return f"{robots_text(int(places['team']))}, {condition}"

    return [(name, list(group)) for name, group in groupby(rows, words)]


def page_parts(matrix: Matrix, rows: Sequence[CaseRow], preset: Preset | None) -> Iterator[str]:
    """Yield what all runs share, and the tables, with the published numbers of a preset."""
    settings = {"duration": matrix.duration_s, **matrix.settings}
    shared = ", ".join(f"{name} = {value}" for name, value in settings.items())
    yield f"""{shared}; seeds {", ".join(map(str, matrix.seeds))}.
Mean MFoW of the second half in s, with half the width of the 95 % interval over seeds. (... % seen): some
ground was never seen, so the MFoW is the time since the start. Attacks: the share that succeeds of the
intruder that does best. Gain of watching: how many more attempts of a moving intruder, in a hundred,
succeed because it watches."""
    for name, group in groups_of(rows):
        yield f"## {name}"
        yield policy_table(group).markdown()
    if preset is not None and not preset.published:
        for terrain in matrix.terrains:
            own = preset.ground_settings(terrain).items()
            texts = [f"{name} = {value}" for name, value in own if name not in matrix.settings]  # which hold over them
            yield f"## {preset.title}: {terrain.name}"
            yield "; ".join(
                [*texts, "capacity: the length of the best tour found, divided by the sum of all robots' speeds"]
            )
            yield ground_table([row for row in rows if places_of(row)["terrain"] == terrain.name], preset).markdown()
    elif preset is not None:
        yield f"## Beside {preset.title}"
        yield preset.beside_ours(rows).markdown()
        yield "\n".join(f"- {line}" for line in preset.differs)


def policy_table(rows: Sequence[CaseRow]) -> Table:
    """Return the table of the policies of a team under a condition.

    Its columns are late MFoW by terrain, fog, collisions, intruders and time under a plan. The first row is the best
    tour found, where there is one. `rows` are the cases of that team and condition.
    """
    by_place = {(places_of(row)["policy"], places_of(row)["terrain"]): row for row in rows}
    policies, terrains = (list(dict.fromkeys(names)) for names in zip(*by_place, strict=True))
    beside = {"mean fog (s)": "fog_mean_s", "collisions": "collisions", f"attacks of {ATTACK_S:g} s (%)": INTRUDED}
    # Only some policies have a plan for the whole fleet, and runs that are too short have no gain.
    later = {"planned (%)": PLANNED, "gain of watching (points)": GAINED}
    beside |= {title: metric for title, metric in later.items() if any(metric in row.metrics for row in rows)}
    order = ", same order" if len(terrains) > 1 else ""
    heads = ["policy", *terrains, *(f"{title}{order}" for title in beside)]
    tours = {places_of(row)["terrain"]: _whole(row, TOUR) for row in rows if TOUR in row.metrics}
    lines = (
        [[f"*{BEST_TOUR}*", *(tours.get(terrain, "-") for terrain in terrains), *("" for _ in beside)]] if tours else []
    )
    for policy in policies:
        cases = [by_place[policy, terrain] for terrain in terrains]
        numbers = (" / ".join(_whole(case, metric) for case in cases) for metric in beside.values())
        lines.append([f"`{policy}`", *map(late_text, cases), *numbers])
    return Table(heads, lines, range(1, len(heads)))


def ground_table(rows: Sequence[CaseRow], preset: Preset) -> Table:
    """Return the table of a preset's measures on one terrain, a row for each condition and policy.

    Measures that no run has are left out.
    """
    measures = [name for name in preset.measures if any(name in row.metrics for row in rows)]
    heads = ["condition", "policy", *(preset.measures[name] for name in measures)]
    cells = []
    for row in rows:
        places, over = places_of(row), late_text(row, OVER_CAPACITY, 2)
        texts = {name: with_interval(row.metrics.get(name), sign=" ± ") for name in measures} | {OVER_CAPACITY: over}
        cells.append([places["condition"], f"`{places['policy']}`", *(texts[name] for name in measures)])
    return Table(heads, cells, range(2, len(heads)))


def late_text(row: CaseRow, metric: str = LATE, digits: int = 0) -> str:
    """Return the late MFoW with half the width of its interval, or how much was seen where not all was."""
    if seen_all(row):
        return with_interval(row.metrics.get(metric), digits, " ± ")
    return f"({100.0 * row.metrics[SEEN].mean:.2f} % seen)"


def _whole(row: CaseRow, metric: str) -> str:
    return f"{row.metrics[metric].mean:.0f}" if metric in row.metrics else "-"
