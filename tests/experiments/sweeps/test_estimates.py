"""Means in figures: where each dot, curve and label lies."""

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from experiments.sweeps.estimates import Curve, Dot, draw_curves, draw_dots, look, scale
from experiments.sweeps.stats import Estimate
from patrol.palette import ROBOTS


@pytest.fixture
def axes() -> Any:
    return Figure().subplots()


def bars(axes: Any) -> list[Any]:
    """The ends of the bars of each call."""
    return [[np.asarray(path).round(9).tolist() for path in lines.get_segments()] for lines in axes.collections]


def test_dots_of_series_lie_side_by_side_in_their_rows_from_the_top(axes: Any) -> None:
    """Three series share 0.6 of a row's height: their dots are 0.2 apart."""
    one, two = Estimate(10.0, 8.0, 12.0, 5), Estimate(20.0, 19.0, 21.0, 5)
    dots = [
        Dot("first", one, "a", values=[9.0, 11.0]),
        Dot("second", two, "a", hollow=True),
        Dot("first", two, "c", note="p = 0.01"),
    ]
    draw_dots(axes, ["first", "second"], dots, ["a", "b", "c"], "MFoW (s)")
    drawn = [line for line in axes.lines if line.get_marker() in ("o", "s", "D")]
    spots = [pytest.approx(spot) for spot in ([10.0, -0.2], [20.0, 0.8], [20.0, 0.2])]
    assert [line.get_xydata()[0].tolist() for line in drawn] == spots
    (small,) = [line for line in axes.lines if line.get_marker() == "|" and len(line.get_xdata())]
    assert np.asarray(small.get_xydata()).round(9).tolist() == [[9.0, -0.2], [11.0, -0.2]]
    assert bars(axes) == [[[[8.0, -0.2], [12.0, -0.2]]], [[[19.0, 0.8], [21.0, 0.8]]], [[[19.0, 0.2], [21.0, 0.2]]]]
    assert [line.get_marker() for line in drawn] == ["o", "o", "D"]
    assert [to_hex(line.get_color()) for line in drawn] == [ROBOTS[0], ROBOTS[0], ROBOTS[2]]
    assert [line.get_markerfacecolor() == "none" for line in drawn] == [False, True, False]
    assert axes.get_legend_handles_labels()[1] == ["a", "c"], "each once"
    (note,) = axes.texts
    assert (note.get_text(), note.xy) == ("p = 0.01", (1.0, pytest.approx(0.2)))
    assert [label.get_text() for label in axes.get_yticklabels()] == ["first", "second"]
    low, high = axes.get_ylim()
    assert (low, high) == (1.6, -0.6), "the first row is at the top"
    assert axes.get_xlabel() == "MFoW (s)"


def test_curves_go_through_their_means_and_the_axis_begins_at_zero(axes: Any) -> None:
    curves = [
        Curve("a", [(2.0, Estimate(30.0, 25.0, 35.0, 3)), (4.0, Estimate(20.0, None, None, 1))], 1),
        Curve("b", [(8.0, Estimate(10.0, 9.0, 11.0, 3))], 0),
    ]
    draw_curves(axes, curves, "robots", "MFoW (s)")
    lines = [np.asarray(line.get_xydata()).tolist() for line in axes.lines]
    assert lines == [[[2.0, 30.0], [4.0, 20.0]], [[8.0, 10.0]]]
    assert bars(axes) == [[[[2.0, 25.0], [2.0, 35.0]], [[4.0, 20.0], [4.0, 20.0]]], [[[8.0, 9.0], [8.0, 11.0]]]]
    assert [to_hex(line.get_color()) for line in axes.lines] == [ROBOTS[1], ROBOTS[0]]
    assert axes.get_legend_handles_labels()[1] == ["a", "b"]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["2", "4", "8"]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_ylim()[0]) == ("robots", "MFoW (s)", 0.0)


@pytest.mark.parametrize(("count", "is_labelled"), [(12, True), (13, False)])
def test_up_to_twelve_numbers_stand_beneath_curves(count: int, is_labelled: bool, axes: Any) -> None:
    numbers = [1.0 + 7.0 * number for number in range(count)]
    draw_curves(axes, [Curve("a", [(x, Estimate(1.0, None, None, 1)) for x in numbers], 0)], "x", "y")
    assert (axes.get_xticks().tolist() == numbers) is is_labelled


def test_marker_and_line_change_once_the_colours_are_used_up() -> None:
    count = len(ROBOTS)
    assert [look(place)[1:] for place in (0, count - 1, count, 3 * count, 8 * count)] == [
        ("o", "-"),
        ("o", "-"),
        ("s", "--"),
        ("^", "-"),
        ("o", ":"),
    ]
    assert look(1)[0] == look(count + 1)[0] != look(0)[0]


@pytest.mark.parametrize(
    ("means", "kind"),
    [([None, 10.0, 11.0], "linear"), ([0.0, 1e6], "linear"), ([], "linear"), ([1.0, None, 1e4], "log")],
)
def test_means_that_differ_much_have_a_logarithmic_scale(means: list[float | None], kind: str, axes: Any) -> None:
    axes.set_xlim(0.5, 100.0)
    scale(axes, means)
    assert axes.get_xscale() == kind
    assert kind == "log" or axes.get_xlim()[0] == 0.0
