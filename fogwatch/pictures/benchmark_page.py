"""The page of the benchmark: its figures and tables in one HTML file that loads nothing else.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from experiments.benchmark.matrix import Matrix, robots_text
from experiments.benchmark.presets import Preset, beside_published
from experiments.benchmark.results import (
    ATTACK_S,
    INTRUDED,
    LATE,
    MEASURES,
    OVER_TOUR,
    TOUR,
    BenchmarkResults,
    CellResult,
    ShownMetric,
    describe,
    policy_table,
    shared_settings,
)
from experiments.sweeps.game_log import game_metric
from monitor.report import html
from monitor.report.charts import WIDTH
from monitor.report.style import GRID, INK, MUTED, Drawing, colour, draw, figure, plain
from patrol.measures.intruders import ATTACKS_S
from patrol.palette import ROBOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINES = ("-", "--", ":")
"""Styles of the policies' lines: one more each time the colours are used up."""

MARKERS = "osD^vPX*"
"""Markers of the policies, one more each time the colours are used up; of conditions, one each."""

LOGARITHMIC = 8.0
"""A measure whose means differ by more than this factor is drawn on a logarithmic scale."""

WORST = ShownMetric(INTRUDED, f"attacks of {ATTACK_S:g} s that succeed, best intruder (%)", 1)


def drawings(matrix: Matrix, results: BenchmarkResults) -> list[Drawing]:
    """Draw the figures.

    Args:
        matrix: What was run.
        results: The results.

    Raises:
        BadInput: matplotlib is not installed.
    """
    shown = [result for result in results.cells if result.row.metrics]
    if not shown:
        return []
    team, condition = shown[0].cell.team, shown[0].cell.condition
    first = [r for r in shown if (r.cell.team, r.cell.condition) == (team, condition)]
    of_team = [r for r in shown if r.cell.team == team]
    over_teams = [r for r in shown if r.cell.condition == condition]
    where = describe(team, condition)
    figures = []
    if _measured(WORST.metric, first):
        caption = f"Each policy is a point; the lower left is better. Hollow: some ground was never seen. {where}."
        figures.append(
            draw(
                "plane",
                "Freshness against intruders",
                caption,
                lambda: _facets(first, lambda axes, cells: _plane(axes, cells, matrix)),
            )
        )
    if any(_measured(game_metric("worst", attack_s), first) for attack_s in ATTACKS_S):
        figures.append(
            draw(
                "attacks",
                "Intruder success over the duration of the attack",
                f"Share of attacks that succeed, of the intruder that does best. {where}.",
                lambda: _facets(first, lambda axes, cells: _attacks(axes, cells, matrix), legend=True),
            )
        )
    measures = [measure for measure in (*MEASURES, WORST) if _measured(measure.metric, of_team)]
    figures += [_dots_drawing(matrix, measure, of_team, team) for measure in measures]
    if len({result.cell.team for result in over_teams}) > 1:
        measures = [measure for measure in (MEASURES[0], WORST) if _measured(measure.metric, over_teams)]
        figures += [_teams_drawing(matrix, measure, over_teams, condition) for measure in measures]
    return figures


def _measured(metric: str, results: Sequence[CellResult]) -> bool:
    """Return True if some cell has a metric: in short runs there are no long attacks, for example."""
    return any(metric in result.row.metrics for result in results)


def page(
    matrix: Matrix,
    results: BenchmarkResults,
    figures: Sequence[Drawing],
    *,
    command: str,
    preset: Preset | None = None,
) -> str:
    """Return benchmark.html.

    Args:
        matrix: What was run.
        results: The results.
        figures: From `drawings`.
        command: The command line that made it.
        preset: Whose published numbers to show; None for none.
    """
    outcome = results.outcome
    sections = [
        ("published", "" if preset is None else f"Beside {preset.title}", _published(preset, results)),
        *(
            (f"cells-{number}", describe(team, condition), _cells(cells))
            for number, (team, condition, cells) in enumerate(results.groups, start=1)
        ),
        *((drawing.name, drawing.heading, html.figure(drawing)) for drawing in figures),
    ]
    body = [
        html.main_heading("Benchmark"),
        html.text(f"{shared_settings(matrix)} · {len(outcome.plan.runs)} runs, 95 % intervals over seeds", "sub"),
        html.preformatted(command),
        html.banner(
            f"{len(outcome.failed)} runs failed or were not valid; they are left out." * bool(outcome.failed), True
        ),
        html.navigation((f"#{name}", heading) for name, heading, inside in sections if inside),
        *(html.section(name, heading, inside) for name, heading, inside in sections),
    ]
    return html.page("fogwatch: benchmark", (part for part in body if part))


def _published(preset: Preset | None, results: BenchmarkResults) -> str:
    if preset is None:
        return ""
    heads, rows = beside_published(preset, results.cells)
    notes = [html.text(line.replace("`", ""), "note") for line in preset.differs]
    return "\n".join([html.table(heads, rows, range(3, len(heads))), *notes])


def _cells(cells: Sequence[CellResult]) -> str:
    heads, rows = policy_table(cells)
    short = html.table(heads, rows, range(1, len(heads)))
    shown = [measure for measure in MEASURES if _measured(measure.metric, cells)]
    titles = ["policy", "terrain", "runs", "with warnings", *(measure.title for measure in shown)]
    every = [
        [
            cell.cell.policy.name,
            cell.cell.terrain.name,
            f"{cell.row.runs}" + f", {cell.row.failed} failed" * bool(cell.row.failed),
            str(cell.row.warned),
            *(cell.text(measure) for measure in shown),
        ]
        for cell in cells
    ]
    commands = "\n".join(f"# {cell.cell.name}\n{cell.command}" for cell in cells)
    return "\n".join(
        [
            short,
            html.details("all measures", html.table(titles, every, range(2, len(titles)))),
            html.details("commands that make the first run of each cell again", html.preformatted(commands)),
        ]
    )


def _facets(
    results: Sequence[CellResult],
    fill: Callable[[Axes, list[CellResult]], None],
    *,
    legend: bool = False,
    height: float = 3.4,
) -> Figure:
    """Draw a panel for each terrain.

    Args:
        results: The cells to draw.
        fill: Draws the cells of one terrain.
        legend: Whether to add a legend above.
        height: Of a panel, inches.
    """
    names = list(dict.fromkeys(result.cell.terrain.name for result in results))
    across = min(2, len(names))
    down = math.ceil(len(names) / across)
    chart = figure(WIDTH, height * down + 0.8 * legend)
    panels = chart.subplots(down, across, squeeze=False).flat
    for axes, name in zip(panels, names, strict=False):
        axes.set_title(name)
        fill(axes, [result for result in results if result.cell.terrain.name == name])
    for axes in list(panels)[len(names) :]:
        axes.set_visible(False)
    if legend:
        handles, labels = chart.axes[0].get_legend_handles_labels()
        chart.legend(handles, labels, loc="outside upper left", ncols=6)
    return chart


def _plane(axes: Axes, results: list[CellResult], matrix: Matrix) -> None:
    for result in results:
        x, y = result.row.metrics.get(LATE), result.row.metrics.get(INTRUDED)
        if x is None or y is None:
            continue
        tone, marker, _ = _look(matrix, result)
        face = tone if result.seen_all else "none"
        axes.errorbar(
            x.mean,
            y.mean,
            y.half,
            x.half,
            color=tone,
            marker=marker,
            markersize=5,
            markerfacecolor=face,
            elinewidth=0.6,
        )
        axes.annotate(
            result.cell.policy.name, (x.mean, y.mean), (4, 3), textcoords="offset points", fontsize=7, color=INK
        )
    _tour(axes, results)
    _scale(axes, [result.mean(LATE) for result in results])
    axes.set_xlabel(MEASURES[0].title)
    axes.set_ylabel(f"attacks of {ATTACK_S:g} s\nthat succeed (%)")
    axes.set_ylim(bottom=0.0)
    plain(axes)


def _attacks(axes: Axes, results: list[CellResult], matrix: Matrix) -> None:
    for result in results:
        points = [(s, mean) for s in ATTACKS_S if (mean := result.mean(game_metric("worst", s))) is not None]
        if points:
            tone, _, line = _look(matrix, result)
            axes.plot(*zip(*points, strict=True), color=tone, linestyle=line, label=result.cell.policy.name)
    axes.set_xlabel("duration of an attack (s)")
    axes.set_ylabel("attacks that succeed (%)")
    axes.set_ylim(0.0, 103.0)
    plain(axes)


def _dots_drawing(matrix: Matrix, measure: ShownMetric, results: Sequence[CellResult], team: int) -> Drawing:
    policies = [policy.name for policy in matrix.policies]

    hollow = measure.metric in (LATE, OVER_TOUR)

    def fill(axes: Axes, cells: list[CellResult]) -> None:
        conditions = list(dict.fromkeys(cell.cell.condition for cell in results))
        for place, condition in enumerate(conditions):
            shift = 0.6 * ((place + 0.5) / len(conditions) - 0.5)
            label = condition
            for cell in cells:
                found = cell.row.metrics.get(measure.metric)
                if found is None or cell.cell.condition != condition:
                    continue
                y = policies.index(cell.cell.policy.name) + shift
                axes.errorbar(
                    found.mean,
                    y,
                    xerr=found.half,
                    color=colour(place),
                    marker=MARKERS[place % len(MARKERS)],
                    markerfacecolor="none" if hollow and not cell.seen_all else colour(place),
                    markersize=4,
                    linestyle="none",
                    label=label,
                    elinewidth=1.0,
                )
                label = "_"
        if measure.metric == LATE:
            _tour(axes, cells)
        _scale(axes, [cell.mean(measure.metric) for cell in cells])
        axes.set_yticks(range(len(policies)), policies)
        axes.set_ylim(len(policies) - 0.4, -0.6)
        axes.set_xlabel(measure.title)
        plain(axes, grid="x")
        for y in range(len(policies)):
            axes.axhline(y, color=GRID, linewidth=0.4, zorder=0)

    several = len({result.cell.condition for result in results}) > 1
    height = 0.9 + 0.19 * len(policies)
    more = " Hollow: some ground was never seen." if hollow else ""
    more += " Dotted: the best tour found." if measure.metric == LATE else ""
    return draw(
        f"dots-{measure.metric}",
        measure.title[0].upper() + measure.title[1:],
        f"Means over seeds with their 95 % intervals, {robots_text(team)}.{more}",
        lambda: _facets(results, fill, legend=several, height=height),
    )


def _teams_drawing(matrix: Matrix, measure: ShownMetric, results: Sequence[CellResult], condition: str) -> Drawing:
    def fill(axes: Axes, cells: list[CellResult]) -> None:
        for policy in matrix.policies:
            own = [cell for cell in cells if cell.cell.policy == policy and measure.metric in cell.row.metrics]
            if own:
                tone, _, line = _look(matrix, own[0])
                x = [cell.cell.team for cell in own]
                found = [cell.row.metrics[measure.metric] for cell in own]
                means, halves = [one.mean for one in found], [one.half or 0.0 for one in found]
                axes.errorbar(
                    x,
                    means,
                    halves,
                    color=tone,
                    linestyle=line,
                    marker="o",
                    markersize=3,
                    elinewidth=0.6,
                    label=policy.name,
                )
        axes.set_xticks(sorted({cell.cell.team for cell in cells}))
        axes.set_xlabel("robots")
        axes.set_ylabel(measure.title)
        axes.set_ylim(bottom=0.0)
        plain(axes)

    return draw(
        f"teams-{measure.metric}",
        f"{measure.title[0].upper()}{measure.title[1:]} over the size of the team",
        f"Means over seeds with their 95 % intervals, {'no fault' if condition == 'none' else condition}.",
        lambda: _facets(results, fill, legend=True),
    )


def _look(matrix: Matrix, result: CellResult) -> tuple[str, str, str]:
    """Return colour, marker and line style of a policy."""
    place = matrix.policies.index(result.cell.policy)
    again = place // len(ROBOTS)
    return colour(place), MARKERS[again % len(MARKERS)], LINES[again % len(LINES)]


def _tour(axes: Axes, results: Sequence[CellResult]) -> None:
    """Draw the MFoW of the best tour found as a dotted line."""
    tour = next(_there(result.mean(TOUR) for result in results), None)
    if tour is not None:
        axes.axvline(tour, color=MUTED, linewidth=1.0, linestyle=":", zorder=1)


def _scale(axes: Axes, means: Sequence[float | None]) -> None:
    """Use a logarithmic scale for the x axis where the means differ much, with plain numbers as labels."""
    values = list(_there(means))
    if not values or min(values) <= 0.0 or max(values) < LOGARITHMIC * min(values):
        axes.set_xlim(left=0.0)
        return
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _there(values: Iterator[float | None] | Sequence[float | None]) -> Iterator[float]:
    return (value for value in values if value is not None)
