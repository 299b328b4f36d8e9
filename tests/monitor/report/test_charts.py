from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from agent.ports import State
from monitor.replay.run import open_run
from monitor.report.charts import STATES, decisions_chart, state_codes, states_chart
from tests.monitor.conftest import QUIET, run_of


def test_a_chart_of_states_names_what_robots_did(tmp_path: Path) -> None:
    faults = [{"kind": "kill", "who": "r1", "at": 20}]
    intruders = [{"place": [50, 44], "at": 5, "for": 10}]
    patrol = {"commitment": "none", "random_move": 0.1}  # so that they come by in time
    scenario = {**QUIET, "faults": faults, "intruders": intruders, "patrol": patrol}
    run = open_run(run_of(tmp_path, scenario).folder)
    shown = {STATES[code][0] for code in np.unique(state_codes(run))}
    assert {"patrolling", "surrounding", "dead or lost"} <= shown
    assert "other" not in shown
    keys = {text.get_text() for text in states_chart(run, ()).legends[0].get_texts()}
    assert keys == shown | {"cancelled move"}


def test_every_state_of_a_mind_has_a_name_in_the_chart() -> None:
    assert {state.value.replace("-", " ") for state in State} <= {name for name, _ in STATES}


def test_a_backend_that_does_not_exist_is_one_line() -> None:
    program = "from patrol.extras import check_matplotlib; check_matplotlib('monitor')"
    environment = {**os.environ, "MPLBACKEND": "nonsense"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    says = "BadInput: MPLBACKEND=nonsense: no backend of matplotlib; unset it, as figures need none\n"
    assert done.stderr.endswith(says)


def test_settings_of_matplotlib_in_the_working_folder_do_not_count(tmp_path: Path) -> None:
    """They come with a folder that was received, and can start TeX; the user's own, named by the user, stay."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nsavefig.format: pgf\n", encoding="utf-8")
    program = (
        "from patrol.extras import check_matplotlib as c; c('sim'); import matplotlib as m; "
        "print(m.rcParams['text.usetex'], m.rcParams['savefig.format'])"
    )
    command = [sys.executable, "-P", "-c", program]
    for folder, environment, settings in (
        (tmp_path, {}, "False png\n"),
        (tmp_path.parent, {"MATPLOTLIBRC": str(tmp_path)}, "True pgf\n"),
    ):
        env = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3]), **environment}
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=True)
        assert done.stdout == settings


def test_decision_times_are_drawn_at_their_percentiles() -> None:
    """1 to 101 ms, so that the p-th percentile is p + 1; the second robot has none."""
    times = np.full((101, 2), np.nan)
    times[:, 0] = np.roll(np.arange(1.0, 102.0), 40)
    run: Any = SimpleNamespace(names=("r1", "r2"), decision_ms=times)
    lines = decisions_chart(run).axes[0].lines
    assert [np.atleast_1d(line.get_xdata()).tolist() for line in lines] == [[2, 100], [26, 76], [51], [101]]
