"""The figures that only the benchmark has show the means of their cells."""

from typing import Any

import numpy as np
import pytest

from experiments.benchmark.matrix import Matrix, places_of, read_policies, read_terrains
from experiments.benchmark.plane import plane_drawings
from experiments.benchmark.results import INTRUDED, LATE, SEEN, TOUR
from experiments.sweeps.cases import CaseRow
from experiments.sweeps.run_metrics import GAINED
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
    """The figures of cells, the n-th of which has a late MFoW of 100 + n s, 60 + n % of attacks, and so on."""
    rows = []
    for n, case in enumerate(MATRIX.plan().cases):
        found = {LATE: 100.0 + n, TOUR: 80.0 + n, SEEN: 1.0 if n else 0.5, GAINED: -1.0 - n, INTRUDED: 60.0 + n}
        metrics = {name: Estimate(mean, mean - 2.0, mean + 2.0, 2) for name, mean in found.items()}
        rows.append(CaseRow(case.name, {}, 2, 0, 0, metrics, {}, None, {}, case.labels))
    return {drawing.name: drawing for drawing in plane_drawings(rows)}


def numbers_of(terrain: str) -> list[int]:
    """The numbers of the cells of two robots without faults on a terrain, by policy."""
    wanted = {"terrain": terrain, "team": "2", "condition": "none"}
    return [n for n, case in enumerate(MATRIX.plan().cases) if wanted.items() <= places_of(case).items()]


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
    for terrain, axes in {axes.get_title(loc="left"): axes for axes in drawing.figure.axes}.items():
        numbers = numbers_of(terrain)
        assert len(numbers) == 2
        drawn = [np.asarray(line.get_xydata()) for line in axes.lines if line.get_marker() in ("o", "s")]
        assert [xy[0].tolist() for xy in drawn] == [[100.0 + n, up(n)] for n in numbers]
        assert [text.get_text() for text in axes.texts] == ["committed", "cr"]
        assert [line.get_markerfacecolor() == "none" for line in axes.lines if line.get_marker() == "o"] == [
            n == 0 for n in numbers
        ]
        (tour,) = [line for line in axes.lines if line.get_linestyle() == ":"]
        assert set(np.asarray(tour.get_xdata()).tolist()) == {80.0 + numbers[0]}
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("MFoW, second half (s)", label)
