"""The figures that only the benchmark has: freshness against intruders, a panel for each terrain.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
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
    from matplotlib.axes import Axes
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
    terrains = list(dict.fromkeys(places_of(row)["terrain"] for row in rows))
    across = min(2, len(terrains))
    down = math.ceil(len(terrains) / across)
    chart = figure(WIDTH, PANEL_HEIGHT * down)
    panels = list(chart.subplots(down, across, squeeze=False).flat)
    for axes, terrain in zip(panels, terrains, strict=False):
        axes.set_title(terrain)
        _draw_plane(axes, [row for row in rows if places_of(row)["terrain"] == terrain], upward)
    for axes in panels[len(terrains) :]:
        axes.set_visible(False)
    return chart


def _draw_plane(axes: Axes, rows: Sequence[CaseRow], upward: str) -> None:
    for place, row in enumerate(rows):
        x, y = row.metrics.get(LATE), row.metrics.get(upward)
        if x is None or y is None:
            continue
        tone, marker, _ = look(place)
        shape: dict[str, Any] = {
            "marker": marker,
            "markersize": 5,
            "markerfacecolor": tone if seen_all(row) else "none",
        }
        axes.errorbar(x.mean, y.mean, y.half, x.half, color=tone, elinewidth=0.6, **shape)
        place_text: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": INK}
        axes.annotate(places_of(row)["policy"], (x.mean, y.mean), (4, 3), **place_text)
    tours = [row.metrics[TOUR].mean for row in rows if TOUR in row.metrics]
    if tours:
        axes.axvline(tours[0], color=MUTED, linewidth=1.0, linestyle=":", zorder=1)
    scale(axes, [row.metrics[LATE].mean for row in rows if LATE in row.metrics])
    axes.set_xlabel(MEASURES[LATE])
    axes.set_ylabel(MEASURES[upward])
    if upward == INTRUDED:
        axes.set_ylim(bottom=0.0)
    plain(axes)
