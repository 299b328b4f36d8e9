"""The parts of a comparison, from values that are told here."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.report.compare import TRACE_DIGITS, cautions, contradictions, differences, drawings, names_of, rows_of


def run_with(scenario: dict[str, Any], name: str = "run") -> Any:
    header = SimpleNamespace(scenario=scenario)
    return SimpleNamespace(journal=SimpleNamespace(header=header), folder=Path("/somewhere") / name)


def texts_of(*values: Any) -> list[str]:
    """Return the values of a field as they are shown beside each other."""
    ((field, *texts),) = differences([run_with({"patrol": {"what": value}}) for value in values])
    assert field == "patrol.what"
    return texts


def test_runs_of_one_folder_name_are_numbered_from_the_second_on() -> None:
    runs = [run_with({}, name) for name in ("a", "b", "a", "a", "a (2)")]
    assert names_of(runs) == ["a", "b", "a (2)", "a (3)", "a (2) (2)"]


def test_only_fields_that_differ_are_listed_in_order_and_a_missing_one_is_a_dash() -> None:
    runs = [
        run_with({"name": "one", "b": 1, "a": {"y": 2.0, "x": [1, 2]}, "same": True}),
        run_with({"name": "two", "b": 1, "a": {"y": 2.5, "x": [1, 3]}, "same": True, "new": None}),
        run_with({"name": "two", "b": 1, "a": {"y": 2.0, "x": [1, 2]}, "same": True}),
    ]
    assert differences(runs) == [
        ("a.x", "[1, 2]", "[1, 3]", "[1, 2]"),
        ("a.y", "2.0", "2.5", "2.0"),
        ("new", "-", "null", "-"),
    ]
    assert differences(runs[::2]) == []
    assert differences(runs[:1] * 3) == []


@pytest.mark.parametrize(("length", "shown"), [(60, "{}"), (61, "{cut}...")])
def test_texts_of_more_than_60_characters_are_cut(length: int, shown: str) -> None:
    one, two = "a" * length, "b" * length
    assert texts_of(one, two) == [shown.format(text, cut=text[:57]) for text in (one, two)]


def test_of_long_texts_the_part_that_differs_is_shown() -> None:
    """They differ at the 101st of 200 characters; 20 characters before it are shown, and 37 from it on."""
    one, two = ("x" * 100 + end * 100 for end in "ab")
    first, second = texts_of(one, two)
    assert (first, second) == ("..." + "x" * 20 + "a" * 34 + "...", "..." + "x" * 20 + "b" * 34 + "...")
    # Where they differ at their ends, the ends are shown.
    assert texts_of("x" * 99 + "a", "x" * 99 + "b") == ["..." + "x" * 56 + end for end in "ab"]
    # At the 41st character they are cut from their beginnings.
    assert [text[:3] for text in texts_of("x" * 40 + "a" * 60, "x" * 40 + "b" * 60)] == ["xxx", "xxx"]
    assert [text[:3] for text in texts_of("x" * 41 + "a" * 60, "x" * 41 + "b" * 60)] == ["...", "..."]


def test_a_fault_shows_whom_it_hits() -> None:
    fault = {"kind": "silence", "id": "f1", "at": 120.0, "for": 300.0, "who": "r2", "direction": "both"}
    assert "who: r2" in texts_of([], [fault])[1]


def test_a_key_is_never_shown_and_classes_of_ones_own_are_told_apart_by_their_content() -> None:
    keys = [
        run_with({"radio": {"key": f"/secret/{n}", "model": "m.py:A", "model_sha256": f"{n}" * 64}}) for n in (1, 2)
    ]
    assert differences(keys) == [("radio.model", "A (sha256 111111111111)", "A (sha256 222222222222)")]
    (row,) = differences([run_with({"radio": {"key": "/secret/1"}}), run_with({"radio": {"key": None}})])
    assert row == ("radio.key", "given", "null")
    sensors = [{"sensor": {"kind": f"{folder}/s.py:S", "kind_sha256": "3" * 64}} for folder in ("here", "there")]
    assert differences([run_with(sensor) for sensor in sensors]) == []


def test_each_setting_that_makes_runs_hard_to_compare_is_cautioned_about_once() -> None:
    rows = [("point", "0.5", "1.0", "0.5"), ("sensor.range", "10.0", "12.0", "10.0"), ("seed", "1", "2", "3")]
    found = cautions(rows)
    assert [line.partition(":")[0] for line in found] == ["point is 0.5, 1.0", "sensor.range is 10.0, 12.0"]
    assert contradictions([("patrol.options.a", "1", "-", "1"), ("patrol.options.b", "1", "2", "-")]) == [
        ("patrol.options.b", "1", "2", "-")
    ]
    assert contradictions(rows) == rows


def analysis_of(ticks: int, mfow: list[int], mean: list[float], fog: float, gaps: list[int]) -> Any:
    visits = SimpleNamespace(mean=np.full((2, 3), fog), never=np.zeros((2, 3), dtype=np.bool_), gaps=np.array(gaps))
    run = SimpleNamespace(
        folder=Path("/somewhere/run"),
        step=0.5,
        ticks=ticks,
        times=0.5 * np.arange(ticks),
        mfow=np.array(mfow),
        fog_mean=np.array(mean),
    )
    return SimpleNamespace(run=run, visits=visits)


def test_lines_are_of_each_run_in_seconds_and_a_run_without_gaps_has_none() -> None:
    analyses = [
        analysis_of(3, [0, 1, 4], [0.0, 0.5, 1.0], 2.0, [0, 0, 0]),
        analysis_of(2, [0, 3], [0.0, 2.5], 6.0, [0, 3, 0, 1]),
    ]
    made = {drawing.name: drawing for drawing in drawings(analyses)}
    assert list(made) == ["mfow", "fog", "gaps", "fog-mean-1", "fog-mean-2"]
    assert [made[name].heading for name in ("fog-mean-1", "fog-mean-2")] == ["run", "run (2)"]

    def lines(name: str) -> list[tuple[Any, list[float], list[float]]]:
        shown = made[name].figure.axes[0].lines
        return [
            (line.get_label(), np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist())
            for line in shown
        ]

    assert lines("mfow") == [("run", [0.0, 0.5, 1.0], [0.0, 0.5, 2.0]), ("run (2)", [0.0, 0.5], [0.0, 1.5])]
    assert lines("fog") == [("run", [0.0, 0.5, 1.0], [0.0, 0.25, 0.5]), ("run (2)", [0.0, 0.5], [0.0, 1.25])]
    assert lines("gaps") == [("run (2)", [0.0, 0.5, 1.0, 1.5], [100.0, 100.0, 25.0, 25.0])]


def test_maps_have_the_largest_fog_of_all_runs_as_their_scale(monkeypatch: pytest.MonkeyPatch) -> None:
    scales: list[float] = []

    def chart(_: Any, fog_s: Any, never: Any, label: str, most: float, has_site: bool) -> Any:
        assert (label, has_site, fog_s.shape == never.shape) == ("mean fog (s)", False, True)
        scales.append(most)
        shown.append(float(fog_s.max()))

    shown: list[float] = []
    monkeypatch.setattr("monitor.report.compare.fog_chart", chart)
    analyses = [analysis_of(3, [0, 1, 4], [0.0, 0.5, 1.0], fog, [0, 1]) for fog in (2.0, 7.0, 3.0)]
    for drawing in drawings(analyses)[3:]:
        drawing.make()
    assert (scales, shown) == ([3.5] * 3, [1.0, 3.5, 1.5])


def test_the_rows_of_a_comparison_are_those_of_the_runs(quiet: Any, muted: Any) -> None:
    runs = [quiet.open(), muted.open()]
    rows = {name: values for name, *values in rows_of(runs)}
    assert list(rows)[:5] == ["scenario", "robots", "verdict", "ended", "simulated"]
    assert list(rows)[-1] == "trace hash"
    assert rows["trace hash"] == [run.trace[:16] for run in runs]
    assert TRACE_DIGITS == 16
    assert (rows["robots"], rows["simulated"], rows["ended"]) == (["3", "3"], ["40 s", "40 s"], ["completed"] * 2)
    stated = [json.loads((run.folder / "summary.json").read_text(encoding="utf-8")) for run in runs]
    assert rows["mean fog"] == [f"{summary['fog_mean_s']:.1f} s" for summary in stated]
