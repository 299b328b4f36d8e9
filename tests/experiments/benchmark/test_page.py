"""The figures of the benchmark show the means of their cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from experiments.benchmark.matrix import Matrix, read_policies, read_terrains
from experiments.benchmark.page import drawings
from experiments.benchmark.results import LATE, SEEN, TOUR, BenchmarkResults, CellResult
from experiments.sweeps.cases import CaseRow
from experiments.sweeps.run_metrics import GAINED, game_metric
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate
from monitor.figures.style import Drawing

MATRIX = Matrix(
    policies=read_policies("committed,cr"),
    terrains=read_terrains("open,yards"),
    teams=(2, 4),
    conditions=("none", "silence"),
    seeds=(1, 2),
    duration_s=30.0,
    settings={"point": 2.0, "robots.model": "holonomic"},
)


def figures() -> dict[str, Drawing]:
    """The figures of cells, the n-th of which has a late MFoW of 100 + n s, 60.5 % of attacks of 75 s, and so on."""
    cells = []
    for n, cell in enumerate(MATRIX.cells):
        found: dict[str, float] = {
            LATE: 100.0 + n,
            TOUR: 80.0 + n,
            SEEN: 1.0 if n else 0.5,
            GAINED: -1.0 - n,
            **{game_metric("worst", s): s - 15.0 + n for s in (25.0, 50.0, 75.0, 150.0)},
        }
        metrics = {name: Estimate(mean, mean - 2.0, mean + 2.0, 2) for name, mean in found.items()}
        cells.append(CellResult(cell, CaseRow(cell.name, {}, 2, 0, 0, metrics, {}, None, {}), "again"))
    outcome = SweepOutcome.__new__(SweepOutcome)
    return {drawing.name: drawing for drawing in drawings(MATRIX, BenchmarkResults(outcome, tuple(cells)))}


def places(team: int, condition: str, terrain: str) -> list[int]:
    """The numbers of the cells of a team under a condition on a terrain, by policy."""
    return [
        n
        for n, cell in enumerate(MATRIX.cells)
        if (cell.team, cell.condition, cell.terrain.name) == (team, condition, terrain)
    ]


def marks(axes: Any) -> list[list[float]]:
    """The places of single marks."""
    drawn = [np.asarray(line.get_xydata()) for line in axes.lines if line.get_marker() not in ("", "None", "|", None)]
    return [xy[0].tolist() for xy in drawn if len(xy) == 1]


def panels(drawing: Drawing) -> dict[str, Any]:
    return {axes.get_title(loc="left"): axes for axes in drawing.figure.axes if axes.get_visible()}


@pytest.mark.parametrize(
    ("name", "label", "up"),
    [
        ("plane", "attacks of 75 s that succeed, best intruder (%)", lambda n: 60.0 + n),
        ("plane-gain", "gain of watching (points)", lambda n: -1.0 - n),
    ],
)
def test_planes_show_the_late_mfow_against_an_intruder_of_the_first_team_and_condition(
    name: str, label: str, up: Any
) -> None:
    drawing = figures()[name]
    assert drawing.caption.endswith(" 2 robots, no fault.")
    for terrain, axes in panels(drawing).items():
        numbers = places(2, "none", terrain)
        assert marks(axes) == [[100.0 + n, up(n)] for n in numbers]
        assert [text.get_text() for text in axes.texts] == ["committed", "cr"]
        assert [line.get_markerfacecolor() == "none" for line in axes.lines if line.get_marker() == "o"] == [
            n == 0 for n in numbers
        ]
        (tour,) = [line for line in axes.lines if line.get_linestyle() == ":"]
        assert set(tour.get_xdata()) == {80.0 + numbers[0]}
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("MFoW, second half (s)", label)


def test_attacks_are_curves_over_their_durations() -> None:
    for terrain, axes in panels(figures()["attacks"]).items():
        lines = [np.asarray(line.get_xydata()).tolist() for line in axes.lines]
        expected: list[Sequence[list[float]]] = [
            [[s, s - 15.0 + n] for s in (25.0, 50.0, 75.0, 150.0)] for n in places(2, "none", terrain)
        ]
        assert lines == expected
        assert axes.get_legend_handles_labels()[1] == ["committed", "cr"]


def test_dots_have_a_row_a_policy_and_a_colour_a_condition() -> None:
    drawing = figures()[f"dots-{LATE}"]
    for terrain, axes in panels(drawing).items():
        expected = [
            [100.0 + places(2, condition, terrain)[row], row + 0.6 * ((number + 0.5) / 2.0 - 0.5)]
            for number, condition in enumerate(("none", "silence"))
            for row in (0, 1)
        ]
        assert sorted(marks(axes)) == [pytest.approx(mark) for mark in sorted(expected)]
        assert [label.get_text() for label in axes.get_yticklabels()] == ["committed", "cr"]


def test_teams_are_curves_over_their_sizes() -> None:
    for name, begin in ((LATE, 100.0), (game_metric("worst", 75.0), 60.0)):
        drawing = figures()[f"teams-{name}"]
        for terrain, axes in panels(drawing).items():
            lines = [np.asarray(line.get_xydata()).tolist() for line in axes.lines]
            by_team = [places(team, "none", terrain) for team in (2, 4)]
            assert lines == [[[2.0, begin + by_team[0][p]], [4.0, begin + by_team[1][p]]] for p in (0, 1)]
            assert axes.get_xlabel() == "robots"
