import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from agent.ports import State
from monitor.figures.style import ACCENT, ALERT
from monitor.observation.fault_bands import INTRUDER, Band
from monitor.replay.run import open_run
from monitor.report import charts
from patrol.journal.records import Status
from tests.monitor.conftest import QUIET, run_of
from tests.present import present


def test_a_chart_of_states_names_what_robots_did(tmp_path: Path) -> None:
    faults = [{"kind": "kill", "who": "r1", "at": 20}]
    intruders = [{"place": [50, 44], "at": 5, "for": 10}]
    options = {"separation": "claims", "random_move": 0.1}
    patrol = {"policy": "potential-field", "options": options}  # so that they come by in time
    scenario = {**QUIET, "faults": faults, "intruders": intruders, "patrol": patrol}
    run = open_run(run_of(tmp_path, scenario).folder)
    shown = {charts.STATES[code][0] for code in np.unique(charts.state_codes(run))}
    assert {"patrolling", "surrounding", "dead or lost"} <= shown
    assert "other" not in shown
    keys = {text.get_text() for text in charts.states_chart(run, ()).legends[0].get_texts()}
    assert keys == shown | {"cancelled move"}


def test_every_state_of_a_mind_has_a_name_in_the_chart() -> None:
    assert {state.value.replace("-", " ") for state in State} <= {name for name, _ in charts.STATES}


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
    lines = charts.decisions_chart(run).axes[0].lines
    assert [np.atleast_1d(line.get_xdata()).tolist() for line in lines] == [[2, 100], [26, 76], [51], [101]]


def made_up_run(ticks: int = 8, robots: int = 2, **more: Any) -> Any:
    """A run without faults whose arrays are told here."""
    header = SimpleNamespace(bound_s=more.pop("bound_s", 0.0))
    facts = {
        "names": tuple(f"r{n}" for n in range(1, robots + 1)),
        "ticks": ticks,
        "step": 0.5,
        "times": 0.5 * np.arange(ticks),
        "journal": SimpleNamespace(header=header),
        "bumped": np.zeros((ticks, robots), dtype=np.bool_),
    }
    return SimpleNamespace(**facts, **more)


def drawn_lines(axes: Any) -> dict[str, tuple[list[float], list[float]]]:
    return {
        line.get_label(): (np.atleast_1d(line.get_xdata()).tolist(), np.atleast_1d(line.get_ydata()).tolist())
        for line in axes.lines
    }


def test_mfow_and_mean_fog_are_drawn_in_seconds_beside_what_they_compare_with() -> None:
    mfow, mean = np.array([0, 1, 2, 7]), np.array([0.0, 0.5, 1.5, 2.5])
    run = made_up_run(4, mfow=mfow, fog_mean=mean, bound_s=1.25)
    lines = drawn_lines(charts.mfow_chart(run, (), 1.75).axes[0])
    assert lines["MFoW (age of the stalest point)"] == ([0.0, 0.5, 1.0, 1.5], [0.0, 0.5, 1.0, 3.5])
    assert lines["mean fog"] == ([0.0, 0.5, 1.0, 1.5], [0.0, 0.25, 0.75, 1.25])
    assert (lines["lower bound of MFoW"][1], lines["best tour found"][1]) == ([1.25, 1.25], [1.75, 1.75])
    without = drawn_lines(charts.mfow_chart(made_up_run(4, mfow=mfow, fog_mean=mean), ()).axes[0])
    assert without.keys() == {"MFoW (age of the stalest point)", "mean fog"}


def test_each_robots_error_is_drawn_under_its_name() -> None:
    errors: Any = SimpleNamespace(robots=(2, 0), ticks=np.array([0, 4]), mean=np.array([[1.0, 2.0], [3.0, 8.0]]))
    lines = drawn_lines(charts.belief_chart(made_up_run(8, 3), errors, ()).axes[0])
    assert lines == {"r3": ([0.0, 2.0], [0.5, 1.5]), "r1": ([0.0, 2.0], [1.0, 4.0])}


def test_delivered_shares_are_those_of_intervals_and_drawn_in_their_middles() -> None:
    """720 ticks in intervals of three: 3 of 4 frames arrive, then none is sent, then 1 of 2."""
    delivered, dropped = np.zeros(720, dtype=np.int64), np.zeros(720, dtype=np.int64)
    delivered[[0, 2, 6]], dropped[[1, 8]] = (1, 2, 1), (1, 1)
    links = SimpleNamespace(delivered_in=delivered, dropped_in=dropped)
    (line,) = charts.radio_chart(made_up_run(720, links=links), ()).axes[0].lines
    times, shares = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert times[:3].tolist() == [0.75, 2.25, 3.75]
    assert len(times) == 240
    assert np.flatnonzero(~np.isnan(shares)).tolist() == [0, 2]
    assert (shares[0], shares[2]) == (75.0, 50.0)


@pytest.mark.parametrize(
    ("status", "state", "shown"),
    [
        *(
            (Status.ALIVE, state, state)
            for state in ("patrolling", "free", "surrounding", "holding", "docking", "charging")
        ),
        (Status.ALIVE, "dead-end", "dead end"),
        (Status.ALIVE, "dancing", "other"),
        (Status.ALIVE, "", "no decision"),
        (Status.PAUSED, "patrolling", "paused"),
        (Status.DEAD, "patrolling", "dead or lost"),
        (Status.LOST, "patrolling", "dead or lost"),
        (Status.ABSENT, "patrolling", "absent"),
        (Status.LEFT, "patrolling", "absent"),
    ],
)
def test_each_state_is_drawn_in_its_colour(status: Status, state: str, shown: str) -> None:
    labels = ("", state) if state else ("",)
    states = np.full((8, 2), len(labels) - 1, dtype=np.int16)
    run = made_up_run(status=np.full((8, 2), status, dtype=np.uint8), states=states, labels=labels)
    run.bumped[3, 1] = True
    assert [charts.STATES[code][0] for code in np.unique(charts.state_codes(run))] == [shown]
    axes = charts.states_chart(run, ()).axes[0]
    (image,) = axes.images
    assert list(image.get_extent()) == [0.0, 4.0, 1.5, -0.5]
    assert present(image.get_array()).shape == (2, 8)
    assert list(drawn_lines(axes).values()) == [([1.5], [1.0])]


def test_the_link_from_each_robot_to_each_other_is_written_where_it_belongs() -> None:
    share = np.array([[np.nan, 0.999, 0.25], [1.0, np.nan, 0.5], [0.0, 0.989, np.nan]])
    run = made_up_run(robots=3, links=SimpleNamespace(share=lambda: share))
    axes = charts.links_chart(run).axes[0]
    texts = {(text.get_position()[1], text.get_position()[0]): text.get_text() for text in axes.texts}
    assert texts == {(0, 1): "99.9", (0, 2): "25", (1, 0): "100", (1, 2): "50", (2, 0): "0", (2, 1): "99"}
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("to", "from")


@pytest.mark.parametrize(
    ("gaps", "median", "most"),
    [([0, 0, 1, 1, 0, 1], "1.5", "2.5"), ([0, 0, 19, 0, 1], "1", "1"), ([0, 0, 18, 0, 2], "1", "2")],
)
def test_waits_are_marked_at_their_median_and_at_95_percent(gaps: list[int], median: str, most: str) -> None:
    texts = [text.get_text() for text in charts.gaps_chart(np.array(gaps), 0.5).axes[0].texts]
    assert texts == [f"median {median} s", f"95 % {most} s"]


@pytest.mark.parametrize(
    ("gaps", "lefts", "width", "shares"),
    [
        ([0, 1, 0, 3], [-0.25, 0.25, 0.75, 1.25], 0.5, [0, 25, 0, 75]),
        ([1, *[0] * (charts.MOST_BINS - 2), 1], [0.5 * k - 0.25 for k in range(charts.MOST_BINS)], 0.5, None),
        ([1, *[0] * (charts.MOST_BINS - 1), 3], [1.0 * k - 0.25 for k in range(charts.MOST_BINS // 2 + 1)], 1.0, None),
    ],
)
def test_bars_show_the_share_of_waits_by_their_length(
    gaps: list[int], lefts: list[float], width: float, shares: list[float] | None
) -> None:
    axes = charts.gaps_chart(np.array(gaps), 0.5).axes[0]
    bars = [bar for bar in axes.patches if isinstance(bar, Rectangle)]
    assert [bar.get_x() for bar in bars] == pytest.approx(lefts)
    assert [bar.get_width() for bar in bars] == pytest.approx([width] * len(lefts))
    expected = shares or [100 * gaps[0] / sum(gaps), *[0] * (len(lefts) - 2), 100 * gaps[-1] / sum(gaps)]
    assert [bar.get_height() for bar in bars] == pytest.approx(expected)
    assert axes.get_xlim()[0] == 0.0
    notes: Any = axes.texts
    lines: Any = axes.lines
    assert [tuple(line.get_xdata()) for line in lines] == [(text.xy[0],) * 2 for text in notes]
    assert [text.xy[1] for text in notes] == [1.0, 1.0]
    assert [text.get_position() for text in notes] == [(4, -9), (4, -21)]


def test_long_lines_keep_the_largest_value_of_each_interval_at_its_time() -> None:
    values = np.zeros(2 * charts.MOST_POINTS)
    values[[1, 2, 5]] = 3.0, 4.0, 5.0
    times = np.arange(len(values), dtype=np.float64) / 2.0
    at, kept = charts.thinned(times, values)
    assert len(at) == charts.MOST_POINTS
    assert (at[:3].tolist(), kept[:3].tolist()) == ([0.5, 1.0, 2.5], [3.0, 4.0, 5.0])
    assert len(charts.thinned(times[: charts.MOST_POINTS], values[: charts.MOST_POINTS])[0]) == charts.MOST_POINTS
    assert (
        len(charts.thinned(times[: charts.MOST_POINTS + 1], values[: charts.MOST_POINTS + 1])[0])
        == charts.MOST_POINTS // 2 + 1
    )


def test_faults_are_drawn_from_their_beginning_to_their_end() -> None:
    bands = [Band("f1", "loss", 1.0, 3.0), Band("f2", "kill", 2.5, 2.5), Band("i1", INTRUDER, 0.5, 4.0, "at (1, 2)")]
    run = made_up_run(mfow=np.zeros(8), fog_mean=np.zeros(8))
    top, below = charts.mfow_chart(run, bands).axes
    spans = [(patch.get_x(), patch.get_width()) for patch in top.patches if isinstance(patch, Rectangle)]
    assert spans == [(1.0, 2.0), (0.5, 3.5)]
    assert [line.get_xdata() for line in top.lines] == [[2.5]]
    assert [label.get_text() for label in top.get_yticklabels()] == ["f1 loss", "f2 kill", "i1"]
    colours = [to_hex(patch.get_facecolor()) for patch in top.patches]
    assert colours == [ALERT, ACCENT]
    shaded = [(patch.get_x(), patch.get_width()) for patch in below.patches if isinstance(patch, Rectangle)]
    assert shaded == [(1.0, 2.0), (0.5, 3.5)]
    assert below.get_xlim() == (0.0, 4.0)


def test_troubles_are_each_robots_own() -> None:
    figures = [SimpleNamespace(dead_end_share=0.25), SimpleNamespace(dead_end_share=0.75)]
    run = made_up_run(robot_figures=figures)
    run.bumped[[0, 1, 5], 1] = run.bumped[2, 0] = True
    left, right = charts.troubles_chart(run).axes
    rows = [[(bar.get_y() + 0.31, bar.get_width()) for bar in axes.patches] for axes in (left, right)]  # type: ignore[attr-defined]
    assert rows == [[(0.0, 25.0), (1.0, 75.0)], [(0.0, 1), (1.0, 3)]]
    assert [label.get_text() for label in left.get_yticklabels()] == ["r1", "r2"]
