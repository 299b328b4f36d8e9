"""Means with their intervals in a figure: as dots in rows, or as curves over a number.

The figures of sweeps and of the benchmark are drawn with these. matplotlib is an optional dependency, so it is imported
only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiments.sweeps.stats import Estimate
from monitor.figures.style import GRID, MUTED, SPREAD, colour, logarithmic, plain
from patrol.palette import ROBOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = ("-", "--", ":")
"""Styles of lines: one more each time the colours are used up."""

MARKERS = "osD^vPX*"
"""Markers, one for each series; where a marker stands beside colours, one more each time these are used up."""

SERIES_SPAN = 0.6
"""Share of a row's height over which the dots of several series lie."""

MOST_TICKS = 12
"""Numbers beneath a curve's points at most; with more of them the axis has round numbers."""


@dataclass(frozen=True, slots=True)
class Dot:
    """A mean in a row of a figure."""

    row: str
    found: Estimate  # with its interval
    series: str = ""  # decides the colour and the marker
    values: Sequence[float] = ()  # single ones, drawn as small marks
    hollow: bool = False  # the marker is drawn empty
    note: str = ""  # at the right end of the row
    printed: float | None = None  # another value of the same, drawn as a black mark


@dataclass(frozen=True, slots=True)
class Curve:
    """Means over a number."""

    label: str  # in the legend
    points: Sequence[tuple[float, Estimate]]  # the number and the mean of each
    place: int  # decides colour and line (`look`)


def look(place: int) -> tuple[str, str, str]:
    """Return colour, marker and line style of a curve or point by its place."""
    again = place // len(ROBOTS)
    return colour(place), MARKERS[again % len(MARKERS)], LINES[again % len(LINES)]


def draw_dots(axes: Axes, rows: Sequence[str], dots: Iterable[Dot], series: Sequence[str], title: str) -> None:
    """Draw means as dots with their intervals, a row each, the first row at the top.

    `series` is in the order of colours. `title` names the measure, with its unit.
    """
    labelled: set[str] = set()
    for dot in dots:
        number = series.index(dot.series)
        y = rows.index(dot.row) + SERIES_SPAN * ((number + 0.5) / len(series) - 0.5)
        tone = colour(number)
        axes.plot(dot.values, [y] * len(dot.values), "|", color=MUTED, markersize=5, markeredgewidth=0.8, zorder=1)
        axes.errorbar(
            dot.found.mean,
            y,
            xerr=dot.found.half,
            color=tone,
            marker=MARKERS[number % len(MARKERS)],
            markerfacecolor="none" if dot.hollow else tone,
            markersize=4,
            linestyle="none",
            label="_" if dot.series in labelled else dot.series,
            elinewidth=1.0,
        )
        labelled.add(dot.series)
        if dot.printed is not None:
            axes.plot(dot.printed, y, "|", color="black", markersize=9, markeredgewidth=1.8, zorder=5)
        if dot.note:
            axes.annotate(
                dot.note,
                (1.0, y),
                (4, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                va="center",
                fontsize=7,
                color=MUTED,
                annotation_clip=False,
            )
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel(title)
    plain(axes, grid="x")
    for y in range(len(rows)):
        axes.axhline(y, color=GRID, linewidth=0.4, zorder=0)


def draw_curves(axes: Axes, curves: Sequence[Curve], over: str, title: str) -> None:
    """Draw means as curves over a number, with their intervals.

    `over` names the number, and `title` the measure with its unit.
    """
    for curve in curves:
        tone, _, line = look(curve.place)
        axes.errorbar(
            [x for x, _ in curve.points],
            [value.mean for _, value in curve.points],
            [value.half or 0.0 for _, value in curve.points],
            color=tone,
            linestyle=line,
            marker="o",
            markersize=3,
            elinewidth=0.6,
            label=curve.label,
        )
    numbers = sorted({x for curve in curves for x, _ in curve.points})
    if len(numbers) <= MOST_TICKS:
        axes.set_xticks(numbers, [f"{number:g}" for number in numbers])
    axes.set_xlabel(over)
    axes.set_ylabel(title)
    axes.set_ylim(bottom=0.0)
    plain(axes)


def scale(axes: Axes, means: Iterable[float | None]) -> None:
    """Begin the x axis at 0; use a logarithmic scale with plain numbers where the means differ much."""
    values = [value for value in means if value is not None]
    if not values or min(values) <= 0.0 or max(values) < SPREAD * min(values):
        axes.set_xlim(left=0.0)
    else:
        logarithmic(axes, "x")
