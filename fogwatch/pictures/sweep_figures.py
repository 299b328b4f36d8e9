"""The figures of a sweep: each measure case by case, its change against another case, and its curve over a setting.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from experiments.sweeps.caserows import CaseRow
from experiments.sweeps.casetable import SHOWN, told_apart
from experiments.sweeps.paired import PAIRING, TEST, PairedTest, paired_tests
from fogwatch.pictures.estimates import Curve, Dot, draw_curves, draw_dots, scale
from monitor.report.charts import WIDTH
from monitor.report.style import MUTED, Drawing, draw, figure
from patrol.errors import quoted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_ROWS = 80
"""A figure with a row for each case has at most so many; larger sweeps have curves and tables alone."""

LEAST_POINTS = 3
"""A setting with at least so many numbers as values gets curves."""

NAME_WIDTH = 46
"""Characters of a case's name in one line of a figure."""

Fill = Callable[["Axes"], None]


def drawings(rows: Sequence[CaseRow], sweep: str) -> list[Drawing]:
    """Draw the figures of a sweep.

    Args:
        rows: The results case by case.
        sweep: Its name.

    Returns:
        For each measure that some case has: dots by case, changes where cases are compared, curves where a setting is a
        number.

    Raises:
        BadInput: matplotlib is not installed.
    """
    names, shared = told_apart([row.case for row in rows])
    lines = {case: textwrap.fill(name, NAME_WIDTH) for case, name in names.items()}
    about = f"{sweep}{f', {shared}' if shared else ''}"
    tests = paired_tests(rows)
    over = _number_setting(rows)
    figures = []
    for metric, title in SHOWN.items():
        measured = [row for row in rows if metric in row.metrics]
        compared = [test for test in tests if test.metric == metric and test.change is not None]
        if measured and len(measured) <= MOST_ROWS:
            figures.append(_dots(measured, lines, metric, title, about))
        if compared and len(compared) <= MOST_ROWS:
            figures.append(_changes(compared, lines, metric, title, about))
        if measured and over is not None:
            figures.append(_curves(measured, over, metric, title, sweep))
    return figures


def _dots(rows: Sequence[CaseRow], lines: dict[str, str], metric: str, title: str, about: str) -> Drawing:
    dots = [
        Dot(lines[row.case], row.metrics[metric], values=list(row.values[metric].values()), note=f"n = {row.runs}")
        for row in rows
    ]

    def fill(axes: Axes) -> None:
        draw_dots(axes, [dot.row for dot in dots], dots, [""], title)
        scale(axes, [dot.found.mean for dot in dots])

    caption = f"Means over n seeds with their 95 % intervals; grey: the single runs. {about}."
    return _drawing(f"cases-{metric}", title, caption, fill, _height(dots))


def _changes(tests: Sequence[PairedTest], lines: dict[str, str], metric: str, title: str, about: str) -> Drawing:
    dots = [Dot(lines[test.case], test.change, note=_test_text(test)) for test in tests if test.change is not None]

    def fill(axes: Axes) -> None:
        axes.axvline(0.0, color=MUTED, linewidth=1.0, zorder=1)
        draw_dots(axes, [dot.row for dot in dots], dots, [""], f"change of {title.rpartition(' (')[0] or title} (%)")

    others = list(dict.fromkeys(lines[test.against].replace("\n", " ") for test in tests))
    against = others[0] if len(others) == 1 else "the case that differs only in the compared setting"
    caption = (
        f"Change against {against}: mean over n pairs of runs with the {PAIRING}, 95 % intervals; p of a {TEST}, not "
        f"adjusted for {len(tests)} tests. {about}."
    )
    return _drawing(f"change-{metric}", f"Change of {title}", caption, fill, _height(dots))


def _test_text(test: PairedTest) -> str:
    if test.p is None:
        return f"n = {test.pairs}"
    return f"n = {test.pairs}, p {'< 0.001' if test.p < 0.001 else f'= {test.p:.3f}'}"


def _curves(rows: Sequence[CaseRow], over: str, metric: str, title: str, sweep: str) -> Drawing:
    groups: dict[str, list[CaseRow]] = {}
    for row in rows:
        others = {field: value for field, value in row.settings.items() if field != over}
        groups.setdefault(_curve_name(row, over) or quoted(others), []).append(row)
    labels, shared = told_apart(list(groups))
    curves = [
        Curve(
            textwrap.fill(labels[group], NAME_WIDTH),
            sorted(((_number(row.settings[over]), row.metrics[metric]) for row in own), key=lambda point: point[0]),
            place,
        )
        for place, (group, own) in enumerate(groups.items())
    ]

    def fill(axes: Axes) -> None:
        draw_curves(axes, curves, over, title)
        if len(curves) > 1:
            axes.figure.legend(loc="outside upper left", ncols=2)

    caption = f"Means over seeds with their 95 % intervals. {sweep}{f', {shared}' if shared and curves[1:] else ''}."
    lines = sum(curve.label.count("\n") + 1 for curve in curves)
    return _drawing(f"curves-{metric}", f"{title} over {over}", caption, fill, 3.4 + 0.1 * lines)


def _curve_name(row: CaseRow, over: str) -> str:
    """Return a case's name without the word that gives the setting under the curve."""
    ends = (over, over.rpartition(".")[2])
    given = quoted(row.settings[over])
    return " ".join(word for word in row.case.split() if word not in {f"{end}={given}" for end in ends})


def _number_setting(rows: Sequence[CaseRow]) -> str | None:
    """Return the setting that is a number in all cases and has the most values; None where all have too few."""
    fields = list(dict.fromkeys(field for row in rows for field in row.settings))
    values = {field: {_number(row.settings.get(field)) for row in rows} for field in fields}
    numbers = {field: len(own) for field, own in values.items() if not any(map(math.isnan, own))}
    best = max(numbers, key=lambda field: numbers[field], default=None)
    return best if best is not None and numbers[best] >= LEAST_POINTS else None


def _number(value: object) -> float:
    """Return a setting as a number, NaN where it is none."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan


def _height(dots: Sequence[Dot]) -> float:
    """Return the height of a figure with a row for each dot, inches."""
    return 0.9 + sum(0.13 + 0.13 * (dot.row.count("\n") + 1) for dot in dots)


def _drawing(name: str, heading: str, caption: str, fill: Fill, height: float) -> Drawing:
    def make() -> Figure:
        chart = figure(WIDTH, height + 0.4)
        fill(chart.subplots())
        chart.supxlabel(textwrap.fill(caption, 170), x=0.0, ha="left", fontsize=7, color=MUTED)
        return chart

    return draw(name, heading[0].upper() + heading[1:], caption, make)
