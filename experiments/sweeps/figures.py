"""The figures of a sweep: each measure case by case, its change against another case, and its curve over a setting.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from experiments.sweeps.cases import (
    PAIRING,
    SHOWN,
    TEST,
    CaseRow,
    PairedTest,
    bare,
    p_text,
    paired_tests,
    partner_text,
    told_apart,
)
from experiments.sweeps.estimates import Curve, Dot, draw_curves, draw_dots, scale
from experiments.sweeps.plan import CASE
from monitor.figures.style import MUTED, WIDTH, Drawing, figure
from patrol.errors import quoted
from patrol.palette import ROBOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_ROWS = 80
"""A figure with a row for each case has at most so many; larger sweeps have curves and tables alone."""

LEAST_POINTS = 3
"""A setting with at least so many numbers as values gets curves."""

NAME_WIDTH = 46
"""Characters of a case's name in one line of a figure."""

POLICY = "patrol.policy"

Fill = Callable[["Axes"], None]


def drawings(
    rows: Sequence[CaseRow],
    sweep: str,
    width: float = WIDTH,
    *,
    shown: Mapping[str, str] = SHOWN,
    printed: Mapping[tuple[str, str], float] = MappingProxyType({}),
) -> list[Drawing]:
    """Draw the figures of a sweep.

    `shown` has the titles of the measures that are drawn, and `printed` published values by case and measure, which are
    drawn as marks. For each measure that some case has, there are dots by case, changes where cases are compared, and
    curves where a setting is a number. Where policies (or named cases) stand beside another axis, dots are grouped: a
    row for each value of the other axes, a colour for each policy.

    `width` is in inches. Figures that are narrower than a page are exactly so wide and show no caption, because a paper
    brings its own.
    """
    figures = _Figures(rows, sweep, width, printed)
    tests = paired_tests(rows)
    setting = _number_setting(rows)
    charts = []
    for metric, title in shown.items():
        measured = [row for row in rows if metric in row.metrics]
        compared = [test for test in tests if test.metric == metric and test.change is not None]
        if measured and len(measured) <= MOST_ROWS:
            charts.append(figures.dots(measured, metric, title))
        if compared and len(compared) <= MOST_ROWS:
            charts.append(figures.changes(compared, metric, title))
        if measured and setting is not None:
            charts.append(figures.curves(measured, setting, metric, title))
    return charts


class _Figures:
    """Draws the figures of one sweep, all of one width, with the same names and colours."""

    def __init__(
        self, rows: Sequence[CaseRow], sweep: str, width: float, printed: Mapping[tuple[str, str], float]
    ) -> None:
        self._printed = printed
        axis = _series_axis(rows)
        self._series = {row.case: _text_on(row, axis) for row in rows}
        self._order = list(dict.fromkeys(self._series.values()))
        words = {row.case: [label.word for label in row.labels if label.axis != axis] or row.words for row in rows}
        grouped = {" ".join(case_words): case_words for case_words in words.values()}
        names, shared = told_apart(grouped)
        self._name_width = round(NAME_WIDTH * width / WIDTH)
        self._lines = {case: self._wrap_name(names[" ".join(case_words)]) for case, case_words in words.items()}
        self._about = f"{sweep}{f', {shared}' if shared else ''}"
        self._against = partner_text(rows)
        self._sweep = sweep
        self._width = width

    def dots(self, rows: Sequence[CaseRow], metric: str, title: str) -> Drawing:
        counts = {row.runs for row in rows}
        dots = [
            Dot(
                self._lines[row.case],
                row.metrics[metric],
                self._series[row.case],
                list(row.values[metric].values()),
                hollow=metric.startswith("mfow") and not seen_all(row),
                note=f"n = {row.runs}" if counts != {row.runs} else "",
                printed=self._printed.get((row.case, metric)),
            )
            for row in rows
        ]

        def fill(axes: Axes) -> None:
            self._draw_dots(axes, dots, f"{title}{_same_n(counts)}")
            scale(axes, [dot.found.mean for dot in dots])

        hollow = " Hollow: some ground was never seen." * any(dot.hollow for dot in dots)
        marks = " Black marks: printed values." * any(dot.printed is not None for dot in dots)
        caption = f"Means over n seeds with their 95 % intervals; grey: the single runs.{hollow}{marks} {self._about}."
        return self._make_drawing(f"cases-{metric}", title, caption, fill, self._figure_height(dots))

    def changes(self, tests: Sequence[PairedTest], metric: str, title: str) -> Drawing:
        counts = {test.pairs for test in tests}
        dots = [
            Dot(self._lines[test.case], test.change, self._series[test.case], note=_test_text(test, counts))
            for test in tests
            if test.change is not None
        ]

        def fill(axes: Axes) -> None:
            axes.axvline(0.0, color=MUTED, linewidth=1.0, zorder=1)
            axis = f"change of {bare(title)} against {against} (%){_same_n(counts)}"
            self._draw_dots(axes, dots, textwrap.fill(axis, round(2 * NAME_WIDTH * self._width / WIDTH)))

        against = self._against
        caption = (
            f"Change against {against}: mean over n pairs of runs with the {PAIRING}, 95 % intervals; p of a {TEST}, "
            f"corrected for {len(tests)} tests by Holm's method. {self._about}."
        )
        return self._make_drawing(f"change-{metric}", f"Change of {title}", caption, fill, self._figure_height(dots))

    def curves(self, rows: Sequence[CaseRow], over: str, metric: str, title: str) -> Drawing:
        groups: dict[str, list[CaseRow]] = {}
        words: dict[str, list[str]] = {}
        for row in rows:
            settings = {field: value for field, value in row.settings.items() if field != over}
            group_words = _curve_words(row, over)
            name = " ".join(group_words) or quoted(settings)
            groups.setdefault(name, []).append(row)
            words[name] = group_words or [name]
        labels, shared = told_apart(words)
        curves = [
            Curve(
                self._wrap_name(labels[group]),
                sorted(
                    ((_as_number(row.settings[over]), row.metrics[metric]) for row in group_words),
                    key=lambda point: point[0],
                ),
                index,
            )
            for index, (group, group_words) in enumerate(groups.items())
        ]

        def fill(axes: Axes) -> None:
            draw_curves(axes, curves, over, title)
            self._draw_legend(axes, len(curves))

        about = f", {shared}" if shared and curves[1:] else ""
        caption = f"Means over seeds with their 95 % intervals. {self._sweep}{about}."
        lines = sum(curve.label.count("\n") + 1 for curve in curves)
        height = (3.4 if self._is_whole else 2.4) + 0.1 * lines
        return self._make_drawing(f"curves-{metric}", f"{title} over {over}", caption, fill, height)

    @property
    def _is_whole(self) -> bool:
        """True if the figures are as wide as a page."""
        return self._width >= WIDTH

    def _wrap_name(self, name: str) -> str:
        return textwrap.fill(name, self._name_width)

    def _draw_dots(self, axes: Axes, dots: Sequence[Dot], title: str) -> None:
        draw_dots(axes, list(dict.fromkeys(dot.row for dot in dots)), dots, self._order, title)
        self._draw_legend(axes, len(self._order))

    def _draw_legend(self, axes: Axes, count: int) -> None:
        if count > 1:
            axes.figure.legend(loc="outside upper left", ncols=min(count, 4 if self._is_whole else 2))

    def _figure_height(self, dots: Sequence[Dot]) -> float:
        """Return the height of a figure with a row for the dots of each name, inches."""
        series = len(self._order)
        rows = {dot.row for dot in dots}
        return 0.9 + 0.2 * (series > 1) + sum(0.13 + 0.13 * max(series, row.count("\n") + 1) for row in rows)

    def _make_drawing(self, name: str, heading: str, caption: str, fill: Fill, height: float) -> Drawing:
        def make() -> Figure:
            chart = figure(self._width, height + 0.4 * self._is_whole)
            fill(chart.subplots())
            if self._is_whole:
                chart.supxlabel(textwrap.fill(caption, 170), x=0.0, ha="left", fontsize=7, color=MUTED)
            return chart

        return Drawing(name, heading[0].upper() + heading[1:], caption, make, is_exact=not self._is_whole)


def seen_all(row: CaseRow) -> bool:
    """Return False if some ground was never seen in some run."""
    return "seen_share" not in row.metrics or row.metrics["seen_share"].mean == 1.0


def _series_axis(rows: Sequence[CaseRow]) -> str | None:
    """Return the axis whose values have a colour each, where another axis varies too.

    That is policies, else named cases, else, if there are more of these than colours, another axis.
    """
    texts: dict[str, set[str]] = {}
    for row in rows:
        for label in row.labels:
            texts.setdefault(label.axis, set()).add(label.text)
    varied = {axis: len(choices) for axis, choices in texts.items() if len(choices) > 1}
    if len(varied) < 2 or not {POLICY, CASE} & set(varied):
        return None
    return next((axis for axis in (POLICY, CASE, *varied) if varied.get(axis, math.inf) <= len(ROBOTS)), None)


def _text_on(row: CaseRow, axis: str | None) -> str:
    """Return the name of a case's value on an axis."""
    return next((label.text for label in row.labels if label.axis == axis), "")


def _same_n(counts: Collection[int]) -> str:
    """Return the words on an axis for the number of runs, where it is the same in all rows."""
    return f", n = {next(iter(counts))}" if len(counts) == 1 else ""


def _test_text(test: PairedTest, counts: Collection[int]) -> str:
    """Return the text beside a change: p, and n where it differs between rows."""
    text = "" if test.p_holm is None else p_text(test.p_holm)
    p = text and f"p {text}" if text.startswith("<") else text and f"p = {text}"
    return ", ".join(filter(None, ["" if counts == {test.pairs} else f"n = {test.pairs}", p]))


def _curve_words(row: CaseRow, over: str) -> list[str]:
    """Return the words of a case's name without the one that gives the setting under the curve."""
    if row.labels:
        return [label.word for label in row.labels if label.axis != over]
    ends = (over, over.rpartition(".")[2])
    value_text = quoted(row.settings[over])
    return [word for word in row.words if word not in {f"{end}={value_text}" for end in ends}]


def _number_setting(rows: Sequence[CaseRow]) -> str | None:
    """Return the setting that is a number in all cases and has the most values; None where all have too few."""
    fields = list(dict.fromkeys(field for row in rows for field in row.settings))
    values = {field: {_as_number(row.settings.get(field)) for row in rows} for field in fields}
    numbers = {field: len(column) for field, column in values.items() if not any(map(math.isnan, column))}
    best = max(numbers, key=lambda field: numbers[field], default=None)
    return best if best is not None and numbers[best] >= LEAST_POINTS else None


def _as_number(value: object) -> float:
    """Return a setting as a number, NaN where it is none."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
