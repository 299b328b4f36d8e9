"""Plans from Python: what `fogwatch plan` gives, as tables and figures."""

import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

import fogwatch
from patrol.errors import BadInput

OVERRIDES = {"patrol.policy": "committed", "point": 2.0, "robots.model": "holonomic", "sensor.range": 20}


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> fogwatch.PlanResult:
    folder = tmp_path_factory.mktemp("plan") / "open"
    return fogwatch.plan("open", age=40, robots=[1, 2, 3], overrides=OVERRIDES, duration=120, out=folder)


def test_the_table_has_a_row_a_number_of_robots(planned: fogwatch.PlanResult) -> None:
    assert planned.folder is not None
    stated = json.loads((planned.folder / "plan.json").read_text(encoding="utf-8"))
    assert planned.facts == stated
    rows = planned.table.to_pylist()
    assert [row["robots"] for row in rows] == [1, 2, 3]
    for row, size in zip(rows, stated["sizes"], strict=True):
        assert all(row[name] == size[name] for name in ("bound_s", "tour_s", "own_tours_s"))
        simulated = size["simulated"]
        found = (row["mfow_mean_s"], row["mfow_max_s"], row["keeps"])
        assert found == (simulated["mean_s"], simulated["max_s"], simulated["keeps"])
    assert planned.robots == stated["robots"] is not None
    chosen = next(row for row in rows if row["robots"] == planned.robots)
    assert chosen["keeps"]
    assert chosen["one_dead_mfow_max_s"] is not None


def test_a_notebook_shows_table_answer_and_curve(planned: fogwatch.PlanResult) -> None:
    shown = planned._repr_html_()
    assert "keeps 40 s" in shown
    (answer,) = [line for line in planned.answer if line.startswith("answer: ")]
    assert answer in shown
    assert repr(planned) == f"<PlanResult open: {answer.removeprefix('answer: ')}>"
    figure = planned.figure()
    assert isinstance(figure, Figure)
    assert {line.get_label() for line in figure.axes[0].lines} >= {"one tour for all", "wanted"}


def test_a_plan_of_no_known_age_is_drawn_without_a_legend() -> None:
    cars = {**OVERRIDES, "robots.model": "car", "sensor.angle": 90, "sensor.range": 60}
    figure = fogwatch.plan("open", robots=1, overrides=cars, quick=True).figure()
    assert figure.axes[0].get_title(loc="left") == "open: the age that robots keep"
    assert not figure.legends


def test_a_quick_plan_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    told: list[tuple[str, float]] = []
    how: dict[str, Any] = {"quick": True, "progress": lambda *shown: told.append(shown)}
    result = fogwatch.plan("open", robots=2, overrides=OVERRIDES, **how)
    assert result.folder is None
    assert not list(tmp_path.iterdir())
    assert told == [("2 robots: tours", 0.0), ("2 robots: tours", 1.0)]
    (row,) = result.table.to_pylist()
    assert row["mfow_max_s"] is None
    assert row["tour_s"] > 0.0
    assert repr(result) == "<PlanResult open: robots [2]>"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "age, robots: one is needed"),
        ({"age": -1.0}, r"age = -1\.0: expected a finite number above 0, in s"),
        ({"age": "60"}, "age = '60': expected a finite number above 0, in s"),
        ({"robots": [2, 1]}, r"robots = \[2, 1\]: expected numbers from 1 to 24 that rise"),
        ({"robots": 99}, "robots = 99: expected numbers"),
        ({"robots": 2.5}, r"robots = 2\.5: expected numbers"),
        ({"robots": "12"}, "robots = '12': expected numbers"),
        ({"age": 10.0, "quick": True, "duration": 60.0}, "duration = 60: has no effect with quick"),
    ],
)
def test_bad_input_is_named(given: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=words):
        fogwatch.plan("open", **given)  # type: ignore[arg-type]
