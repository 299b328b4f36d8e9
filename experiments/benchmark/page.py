"""The page of the benchmark: its figures and tables in one HTML file that loads nothing else.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
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
from experiments.intruders.standing import ATTACKS_S
from experiments.sweeps.estimates import Curve, Dot, draw_curves, draw_dots, look, scale
from experiments.sweeps.run_metrics import GAINED, game_metric
from monitor.figures.style import INK, MUTED, WIDTH, Drawing, figure, plain
from monitor.report import html
from monitor.tables.table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WATCHED = ShownMetric(GAINED, "gain of watching (points)", 1)
WORST = ShownMetric(INTRUDED, f"attacks of {ATTACK_S:g} s that succeed, best intruder (%)", 1)


def drawings(matrix: Matrix, results: BenchmarkResults) -> list[Drawing]:
    """Draw the figures."""
    shown = [result for result in results.cells if result.row.metrics]
    if not shown:
        return []
    team, condition = shown[0].cell.team, shown[0].cell.condition
    first = [r for r in shown if (r.cell.team, r.cell.condition) == (team, condition)]
    of_team = [r for r in shown if r.cell.team == team]
    over_teams = [r for r in shown if r.cell.condition == condition]
    where = describe(team, condition)
    figures = []
    for name, heading, shown_metric in (
        ("plane", "Freshness against intruders", WORST),
        ("plane-gain", "Freshness against an intruder that watches", WATCHED),
    ):
        if _is_measured(shown_metric.metric, first):
            caption = f"Each policy is a point; the lower left is better. Hollow: some ground was never seen. {where}."
            fill = partial(_draw_plane, matrix=matrix, upward=shown_metric)
            figures.append(Drawing(name, heading, caption, partial(_draw_facets, first, fill)))
    if any(_is_measured(game_metric("worst", attack_s), first) for attack_s in ATTACKS_S):
        figures.append(
            Drawing(
                "attacks",
                "Intruder success over the duration of the attack",
                f"Share of attacks that succeed, of the intruder that does best. {where}.",
                lambda: _draw_facets(first, lambda axes, cells: _draw_attacks(axes, cells, matrix), legend=True),
            )
        )
    measures = [measure for measure in (*MEASURES, WORST) if _is_measured(measure.metric, of_team)]
    figures += [_dots_drawing(matrix, measure, of_team, team) for measure in measures]
    if len({result.cell.team for result in over_teams}) > 1:
        measures = [measure for measure in (MEASURES[0], WORST) if _is_measured(measure.metric, over_teams)]
        figures += [_teams_drawing(matrix, measure, over_teams, condition) for measure in measures]
    return figures


def _is_measured(metric: str, results: Sequence[CellResult]) -> bool:
    """Return True if some cell has a metric: in short runs there are no long attacks, for example."""
    return any(metric in result.row.metrics for result in results)


def page(
    matrix: Matrix, results: BenchmarkResults, figures: Sequence[Drawing], *, command: str, preset: Preset | None = None
) -> str:
    """Return benchmark.html.

    `command` is the command line that made it. The published numbers of `preset` are shown as well, if there is one.
    """
    outcome = results.outcome
    sections = [
        ("published", "" if preset is None else f"Beside {preset.title}", _published_section(preset, results)),
        *(
            (f"cells-{number}", describe(team, condition), _cells_section(cells))
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


def _published_section(preset: Preset | None, results: BenchmarkResults) -> str:
    if preset is None:
        return ""
    notes = [html.text(line.replace("`", ""), "note") for line in preset.differs]
    return "\n".join([_html_table(beside_published(preset, results.cells)), *notes])


def _cells_section(cells: Sequence[CellResult]) -> str:
    shown = [measure for measure in MEASURES if _is_measured(measure.metric, cells)]
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
            _html_table(policy_table(cells)),
            html.details("all measures", html.table(titles, every, range(2, len(titles)))),
            html.details("commands that make the first run of each cell again", html.preformatted(commands)),
        ]
    )


def _html_table(table: Table) -> str:
    return html.table(table.heads, table.rows, table.numbers)


def _draw_facets(
    results: Sequence[CellResult],
    fill: Callable[[Axes, list[CellResult]], None],
    *,
    legend: bool = False,
    height: float = 3.4,
) -> Figure:
    """Draw a panel for each terrain, `height` inches high; `fill` draws the cells of one terrain."""
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


def _draw_plane(axes: Axes, results: list[CellResult], matrix: Matrix, upward: ShownMetric) -> None:
    for result in results:
        x, y = result.row.metrics.get(LATE), result.row.metrics.get(upward.metric)
        if x is None or y is None:
            continue
        tone, marker, _ = look(matrix.policies.index(result.cell.policy))
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
    _draw_tour(axes, results)
    scale(axes, [result.mean(LATE) for result in results])
    axes.set_xlabel(MEASURES[0].title)
    axes.set_ylabel(upward.title)
    if upward is WORST:
        axes.set_ylim(bottom=0.0)
    plain(axes)


def _draw_attacks(axes: Axes, results: list[CellResult], matrix: Matrix) -> None:
    for result in results:
        points = [(s, mean) for s in ATTACKS_S if (mean := result.mean(game_metric("worst", s))) is not None]
        if points:
            tone, _, line = look(matrix.policies.index(result.cell.policy))
            axes.plot(*zip(*points, strict=True), color=tone, linestyle=line, label=result.cell.policy.name)
    axes.set_xlabel("duration of an attack (s)")
    axes.set_ylabel("attacks that succeed (%)")
    axes.set_ylim(0.0, 103.0)
    plain(axes)


def _dots_drawing(matrix: Matrix, measure: ShownMetric, results: Sequence[CellResult], team: int) -> Drawing:
    policies = [policy.name for policy in matrix.policies]
    hollow = measure.metric in (LATE, OVER_TOUR)

    conditions = list(dict.fromkeys(result.cell.condition for result in results))

    def fill(axes: Axes, cells: list[CellResult]) -> None:
        dots = [
            Dot(cell.cell.policy.name, estimate, cell.cell.condition, hollow=hollow and not cell.seen_all)
            for condition in conditions
            for cell in cells
            if cell.cell.condition == condition and (estimate := cell.row.metrics.get(measure.metric)) is not None
        ]
        if measure.metric == LATE:
            _draw_tour(axes, cells)
        draw_dots(axes, policies, dots, conditions, measure.title)
        scale(axes, [cell.mean(measure.metric) for cell in cells])

    height = 0.9 + 0.19 * len(policies)
    legend = " Hollow: some ground was never seen." if hollow else ""
    legend += " Dotted: the best tour found." if measure.metric == LATE else ""
    return Drawing(
        f"dots-{measure.metric}",
        measure.title[0].upper() + measure.title[1:],
        f"Means over seeds with their 95 % intervals, {robots_text(team)}.{legend}",
        lambda: _draw_facets(results, fill, legend=len(conditions) > 1, height=height),
    )


def _teams_drawing(matrix: Matrix, measure: ShownMetric, results: Sequence[CellResult], condition: str) -> Drawing:
    def fill(axes: Axes, cells: list[CellResult]) -> None:
        curves = []
        for index, policy in enumerate(matrix.policies):
            policy_cells = [cell for cell in cells if cell.cell.policy == policy and measure.metric in cell.row.metrics]
            if policy_cells:
                points = [(float(cell.cell.team), cell.row.metrics[measure.metric]) for cell in policy_cells]
                curves.append(Curve(policy.name, points, index))
        draw_curves(axes, curves, "robots", measure.title)

    return Drawing(
        f"teams-{measure.metric}",
        f"{measure.title[0].upper()}{measure.title[1:]} over the size of the team",
        f"Means over seeds with their 95 % intervals, {'no fault' if condition == 'none' else condition}.",
        lambda: _draw_facets(results, fill, legend=True),
    )


def _draw_tour(axes: Axes, results: Sequence[CellResult]) -> None:
    """Draw the MFoW of the best tour found as a dotted line."""
    tour = next((mean for result in results if (mean := result.mean(TOUR)) is not None), None)
    if tour is not None:
        axes.axvline(tour, color=MUTED, linewidth=1.0, linestyle=":", zorder=1)
