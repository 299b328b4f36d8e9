"""Sweeps from Python: what `fogwatch sweep` gives, as tables."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml

import fogwatch
from agent.ports import Intent
from agent.view import View
from patrol.errors import BadInput

BASE = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 15, "robots": {"count": 2, "model": "holonomic"}}
GRID = {"robots.count": range(1, 3), "radio.trail": [0, 4]}
pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> fogwatch.SweepResult:
    folder = tmp_path_factory.mktemp("sweep")
    return fogwatch.sweep(BASE, grid=GRID, seeds=2, against={"radio.trail": 0}, out=folder, workers=1)


def test_the_table_has_a_row_a_run(swept: fogwatch.SweepResult) -> None:
    table = swept.table.to_pandas()
    assert table.seed.tolist() == [1, 2] * 4
    assert table["robots.count"].tolist() == [1] * 4 + [2] * 4
    assert table["radio.trail"].tolist() == [0, 0, 4, 4] * 2
    assert set(table.outcome) == {"ok"}
    for row in table.itertuples():
        settings = {"seed": row.seed, "robots.count": row[2], "radio.trail": row[3]}
        run = fogwatch.run(BASE, overrides=settings, out=swept.folder / f"run-{row.Index}", picture=False)
        assert row.trace_hash == run.trace_hash
        assert row.mfow_mean_s == run.summary["mfow_mean_s"]
        assert row.messages_sent == run.summary["messages"]["sent"]


def test_the_cases_are_those_of_summary_csv(swept: fogwatch.SweepResult) -> None:
    written = pd.read_csv(swept.folder / "summary.csv")
    pd.testing.assert_frame_equal(swept.cases.to_pandas(), written, check_dtype=False, check_exact=True)
    by_hand = swept.table.to_pandas().groupby("case", sort=False).mfow_mean_s.mean()
    assert swept.cases.to_pandas().mfow_mean_s.tolist() == pytest.approx(by_hand.tolist(), rel=1e-12)
    shown = swept._repr_html_()
    assert "mean MFoW (s)" in shown
    assert "changes are against" in shown
    assert repr(swept).startswith("<SweepResult sweep-open: 4 cases, 8 runs, in ")


def test_comparisons_and_figures_are_those_of_the_command(swept: fogwatch.SweepResult) -> None:
    tests = swept.comparisons.to_pandas()
    assert set(tests.against) == {"count=1 trail=0", "count=2 trail=0"}
    assert set(tests.pairs) == {2}
    written = pd.read_csv(swept.folder / "comparisons.csv")
    assert written.difference.tolist() == tests.difference.tolist()
    assert {"cases-mfow_mean_s", "change-mfow_mean_s"} <= set(swept.figures)


def test_a_second_call_repeats_nothing(swept: fogwatch.SweepResult) -> None:
    told: list[tuple[int, int]] = []
    how: dict[str, Any] = {"out": swept.folder, "progress": lambda *shown: told.append(shown)}
    again = fogwatch.sweep(BASE, grid=GRID, seeds=[1, 2], workers=1, **how)
    assert again.outcome.made == 0
    assert again.table.column("trace_hash").equals(swept.table.column("trace_hash"))
    more = fogwatch.sweep(BASE, seeds=[1, 3], **how)
    assert more.outcome.made == 1  # the base with seed 1 is one of the cases above
    assert told == [(1, 2), (2, 2)]
    assert more.table.column("case").to_pylist() == ["base", "base"]


def test_a_file_gives_the_commands_tables(
    tmp_path: Path, command: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    content = {"base": BASE, "cases": [{"name": "two", "set": {"radio.trail": 2}}], "seeds": 1}
    (tmp_path / "trails.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = fogwatch.sweep("trails.yaml", workers=1)
    assert result.folder == Path("runs/trails")
    assert command("sweep", "trails.yaml", "--out", "by-command", "--workers", "1") == 0
    for name in ("summary.csv", "table.tex"):
        assert (result.folder / name).read_bytes() == (Path("by-command") / name).read_bytes()
    with pytest.raises(BadInput, match=r"grid: trails\.yaml is a sweep, which says so itself"):
        fogwatch.sweep("trails.yaml", grid={"point": [1, 2]})


def test_scenarios_are_named_in_every_way(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(json.dumps(BASE), encoding="utf-8")
    results = [
        fogwatch.sweep(base, out=tmp_path / "results", workers=1)
        for base in (BASE, tmp_path / "small.yaml", str(tmp_path / "small.yaml"))
    ]
    assert len({result.table.column("trace_hash")[0].as_py() for result in results}) == 1
    assert [result.outcome.made for result in results] == [1, 0, 0]
    assert [result.outcome.plan.name for result in results] == ["sweep-open", "sweep-small", "sweep-small"]


class Mine:
    def decide(self, view: View) -> Intent:
        raise NotImplementedError


def test_bad_input_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "list.yaml").write_text("[1, 2]", encoding="utf-8")
    monkeypatch.setattr(Mine, "__module__", "__main__")
    monkeypatch.setattr("__main__.Mine", Mine, raising=False)
    mine = {"mine": {"patrol.policy": Mine}}
    wrong: list[tuple[str | Path, dict[str, Any], str]] = [
        ("nowhere", {}, "nowhere: no such sweep, scenario or map file, and no built-in terrain"),
        (tmp_path / "list.yaml", {}, r"list\.yaml: expected keys and values"),
        ("open", {"grid": {"point": 1}}, r"grid\.point = 1: expected a list of values"),
        ("open", {"workers": 2, "cluster": "tcp://here:1"}, "give only one of the two"),
        ("open", {"seeds": 1.5}, r"seeds = 1\.5: expected a count such as 3"),
        ("open", {"workers": "a"}, r'^workers = "a": expected 1 or more'),
        ("open", {"cases": mine}, "policy = Mine: was defined here, where other processes cannot import it"),
    ]
    for base, how, says in wrong:
        with pytest.raises(BadInput, match=says):
            fogwatch.sweep(base, out=tmp_path / "out", **how)
