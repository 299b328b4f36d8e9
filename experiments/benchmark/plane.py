"""The figures that only the benchmark has: freshness against intruders, a panel for each terrain.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from experiments.benchmark.matrix import places_of
from experiments.benchmark.results import INTRUDED, LATE, MEASURES, TOUR, groups_of
from experiments.sweeps.cases import CaseRow
from experiments.sweeps.estimates import look, scale
from experiments.sweeps.figures import seen_all
from experiments.sweeps.run_metrics import GAINED
from monitor.figures.style import INK, MUTED, WIDTH, Drawing, figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL_HEIGHT = 3.4
"""Height of a panel, inches."""


def plane_drawings(rows: Sequence[CaseRow]) -> Iterator[Drawing]:
    """Yield the figures of the first team and condition that have the measures."""
    where, first = groups_of(rows)[0]
    caption = (
        "Each policy is a point; the lower left is better. Hollow: some ground was never seen. Dotted: the best tour "
        f"found. {where}."
    )
    for name, heading, metric in (
        ("plane", "Freshness against intruders", INTRUDED),
        ("plane-gain", "Freshness against an intruder that watches", GAINED),
    ):
        if any(metric in row.metrics for row in first):
            yield Drawing(name, heading, caption, partial(_draw_planes, first, metric))


def _draw_planes(rows: Sequence[CaseRow], upward: str) -> Figure:
    by_terrain: dict[str, list[CaseRow]] = {}
    for row in rows:
        by_terrain.setdefault(places_of(row)["terrain"], []).append(row)
    chart = figure(WIDTH, PANEL_HEIGHT * len(by_terrain))
    panels = chart.subplots(len(by_terrain), squeeze=False).flat
    for axes, (terrain, group) in zip(panels, by_terrain.items(), strict=True):
        for place, row in enumerate(group):
            x, y = row.metrics.get(LATE), row.metrics.get(upward)
            if x is None or y is None:
                continue
            tone, marker, _ = look(place)
            shape: dict[str, Any] = {"marker": marker, "markerfacecolor": tone if seen_all(row) else "none"}
            axes.errorbar(x.mean, y.mean, y.half, x.half, color=tone, elinewidth=0.6, markersize=5, **shape)
            where: dict[str, Any] = {"xy": (x.mean, y.mean), "xytext": (4, 3), "textcoords": "offset points"}
            axes.annotate(places_of(row)["policy"], **where, fontsize=7, color=INK)
        if tours := [row.metrics[TOUR].mean for row in group if TOUR in row.metrics]:
            axes.axvline(tours[0], color=MUTED, linewidth=1.0, linestyle=":", zorder=1)
        scale(axes, [row.metrics[LATE].mean for row in group if LATE in row.metrics])
        axes.set(title=terrain, xlabel=MEASURES[LATE], ylabel=MEASURES[upward])
        if upward == INTRUDED:
            axes.set_ylim(bottom=0.0)
        plain(axes)
    return chart
