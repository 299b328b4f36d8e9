"""Runs as notebooks see them: finished ones, killed ones, and what they show."""

import fcntl
import io
import json
import re
import shutil
import subprocess
import sys
import warnings
from html import escape
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image

import fogwatch
from agent.ports import Intent, Place, PolicySetup
from agent.view import View
from monitor.replay.run import open_run
from monitor.report.analysis import analyse
from monitor.report.document import drawings
from patrol.errors import BadInput
from patrol.journal import read_journal
from tests.fleets import COARSE
from tests.fogwatch.conftest import cut_off

SMALL = {**COARSE, "name": "small", "duration": 15, "robots": {"count": 2, "model": "holonomic"}}
SMALL["faults"] = [{"kind": "loss", "rate": 0.5, "at": 2, "for": 5}]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> fogwatch.Run:
    return fogwatch.run(SMALL, out=tmp_path_factory.mktemp("run") / "small")


def test_a_loaded_run_is_the_one_that_was_made(ran: fogwatch.Run) -> None:
    loaded = fogwatch.load(str(ran.folder))
    assert loaded.summary == ran.summary
    assert loaded.trace_hash == ran.trace_hash
    assert loaded.state == "completed"
    assert loaded.verdict.valid
    assert loaded.verdict.checks == ran.verdict.checks
    assert loaded.scenario.faults == ran.scenario.faults
    assert np.array_equal(loaded.mfow_s, ran.mfow_s)
    assert loaded.ticks.equals(ran.ticks)
    assert loaded.ticks.column("mfow_s").to_pylist() == loaded.mfow_s.tolist()
    assert repr(loaded) == repr(ran)
    assert {table.num_rows for table in (loaded.ticks, loaded.visits)} == {30, 0}
    assert loaded.robots.num_rows == 60
    assert loaded.events.num_rows > 0
    assert set(loaded.links.column("cause").to_pylist()) == {None, "loss:f1"}
    assert loaded.ground.num_rows * 1.0 == loaded.summary["patrolled_area_m2"]


def test_a_run_that_was_killed_gives_what_its_journal_has(ran: fogwatch.Run, tmp_path: Path) -> None:
    folder = cut_off(ran.folder, tmp_path / "cut")
    killed = fogwatch.load(folder)
    assert killed.state == "cut off"
    assert killed.verdict.outcome == "unknown"
    assert not killed.verdict.checks
    ticks = killed.ticks.num_rows
    assert 5 < ticks < 30
    assert killed.ticks.to_pylist() == ran.ticks.to_pylist()[:ticks]
    assert killed.robots.to_pylist() == ran.robots.to_pylist()[: 2 * ticks]
    assert killed.summary["ticks"] == ticks
    assert killed.summary["trace_hash"] is None
    assert re.fullmatch("[0-9a-f]{64}", killed.trace_hash)
    assert killed.trace_hash != ran.trace_hash
    assert killed.summary["mfow_mean_s"] == pytest.approx(killed.mfow_s.mean(), rel=1e-12)
    assert "verdict unknown" in repr(killed)
    assert "not judged" in killed._repr_html_()
    with (folder / "journal").open("rb") as journal:
        fcntl.flock(journal, fcntl.LOCK_EX)  # as its writer does
        assert fogwatch.load(folder).state == "still going"


@given(time_s=st.floats(0.0, 20.0))
@settings(max_examples=30, deadline=None)
def test_the_fog_is_that_of_the_last_tick_before(ran: fogwatch.Run, time_s: float) -> None:
    """Its greatest and its mean age are those of the ticks, whichever way the replay goes."""
    fog = ran.fog(time_s)
    times = ran.ticks.column("time_s").to_numpy()
    k = int(np.flatnonzero(times <= time_s + 1e-6)[-1])
    assert np.nanmax(fog) == ran.ticks.column("mfow_s")[k].as_py()
    assert np.nanmean(fog) == pytest.approx(ran.ticks.column("fog_mean_s")[k].as_py(), rel=1e-9)
    assert np.count_nonzero(~np.isnan(fog)) == ran.ground.num_rows


@pytest.mark.parametrize(
    ("time_s", "k"), [(0.0, 0), (0.49, 0), (0.5, 1), (14.5, 29), (14.6, 29), (15.0, 29), (1e9, 29)]
)
def test_the_fog_after_the_end_is_that_of_the_end(ran: fogwatch.Run, time_s: float, k: int) -> None:
    fog = ran.fog(time_s)
    assert np.nanmax(fog) == ran.mfow_s[k]
    assert np.array_equal(fog, ran.fog(0.5 * k + 0.1), equal_nan=True)
    assert np.array_equal(ran.fog(), ran.fog(14.5), equal_nan=True)


def test_the_fog_lies_where_the_ground_table_says(ran: fogwatch.Run) -> None:
    fog, ground = ran.fog(), ran.ground.to_pandas()
    assert np.array_equal(fog[ground.row, ground.col], ground.age_end_s)
    west, east, south, north = ran.extent
    assert fog.shape == (north - south, east - west)
    assert np.allclose(west + ground.col + 0.5, ground.x_m)
    assert np.allclose(south + ground.row + 0.5, ground.y_m)


@pytest.mark.parametrize("time_s", [-1.0, float("nan")])
def test_a_time_before_the_run_is_refused(ran: fogwatch.Run, time_s: float) -> None:
    with pytest.raises(BadInput, match=r"time_s = .*expected a time from 0 on, in s"):
        ran.fog(time_s)


def test_figures_are_those_of_the_report(ran: fogwatch.Run) -> None:
    assert ran.figure_names == [drawing.name for drawing in drawings(analyse(open_run(ran.folder)))]
    figure = ran.figure("mfow")
    assert isinstance(figure, Figure)
    assert {line.get_label() for line in figure.axes[-1].lines} >= {"mean fog"}
    assert ran.figure("mfow") is not figure  # changing one changes no other
    as_notebooks_do = getattr(figure, "_repr_png_")  # noqa: B009 - a name that only IPython calls
    with Image.open(io.BytesIO(as_notebooks_do())) as shown:
        assert shown.width > 500
    with pytest.raises(BadInput, match="figure mfov: this run has no such figure; did you mean mfow"):
        ran.figure("mfov")


def test_a_notebook_shows_figures_verdict_and_fog(ran: fogwatch.Run, tmp_path: Path) -> None:
    shown = ran._repr_html_()
    for text in ("small", "verdict valid", "mean MFoW", "r1 alive", 'src="data:image/png;base64,'):
        assert text in shown
    assert len(shown) < 300_000
    folder = Path(shutil.copytree(ran.folder, tmp_path / "<i>"))
    summary = {**ran.summary, "name": "<script>", "robots": {"<u>&": ran.summary["robots"]["r1"]}}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    (folder / "fog.png").write_bytes(b"\x89PNG\r\nbroken")
    shown = fogwatch.load(folder)._repr_html_()
    for text in ("<script>", "<u>&", "<i>"):
        assert text not in shown
        assert escape(text) in shown
    assert "<img" not in shown


def test_what_is_no_run_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="holds no file journal"):
        fogwatch.load(tmp_path)
    with pytest.raises(BadInput, match="no such folder"):
        fogwatch.load(tmp_path / "nothing")


def test_the_old_name_of_the_class_goes_with_a_warning() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert fogwatch.Result is fogwatch.Run
    (one,) = told
    assert str(one.message) == "fogwatch.Result is now fogwatch.Run; the old name goes with fogwatch 2"


class Eastwards:
    def __init__(self, setup: PolicySetup) -> None:
        self._east = setup.ground.terrain.width * setup.ground.terrain.point

    def decide(self, view: View) -> Intent:
        return Place(self._east - 2.0, view.pose.y)


def test_a_policy_class_is_handed_over(tmp_path: Path) -> None:
    run = fogwatch.run(SMALL, out=tmp_path / "run", policy=Eastwards, picture=False)
    assert run.verdict.valid
    ends = run.robots.to_pandas().groupby("robot").x_m.last()
    starts = run.robots.to_pandas().groupby("robot").x_m.first()
    assert (ends > starts + 5.0).all()
    assert run.scenario.patrol.policy == f"{Eastwards.__module__}:Eastwards"


NOTEBOOK = """
import sys
import fogwatch
from agent.ports import Stay
from patrol.errors import BadInput

class Still:
    def __init__(self, setup): pass
    def decide(self, view): return Stay()

given = {"overrides": {"point": 1.0, "duration": 5, "robots.count": 2}, "policy": Still, "picture": False}
run = fogwatch.run("open", out=sys.argv[1], **given)
print(run.verdict.outcome, run.summary["robots"]["r1"]["distance_m"], run.scenario.patrol.policy)
try:
    fogwatch.run("open", out=sys.argv[1] + "-2", in_process=False, **given)
except BadInput as error:
    print(error)
"""


@pytest.mark.processes
def test_a_policy_of_the_main_program_runs_in_its_process_only(tmp_path: Path) -> None:
    command = [sys.executable, "-c", NOTEBOOK, str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    first, second = done.stdout.splitlines()
    assert first == "valid 0.0 __main__:Still"
    assert second.startswith("policy = Still: was defined here, where other processes cannot import it; run with")
    assert not (tmp_path / "run-2").exists()
    # What only reads the run does not import its policy.
    loaded = fogwatch.load(tmp_path / "run")
    assert loaded.ticks.num_rows == len(list(read_journal(tmp_path / "run" / "journal").ticks)) == 10


def test_classes_that_cannot_be_used_are_refused() -> None:
    class Local:
        def decide(self, view: View) -> Intent:
            raise NotImplementedError

    for policy, words in (
        (Local, "is not at the top level of its module"),
        (int, r"has no method decide\(view\)"),
        ("cr", "expected a class; give a name as overrides="),
    ):
        with pytest.raises(BadInput, match=words):
            fogwatch.run(SMALL, policy=policy)  # type: ignore[arg-type]
