"""``fogwatch sweep`` as a command: killed, interrupted, started again; its output and exit codes."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

from bench.grounds import write_map
from experiments.commands.sweep import print_cases
from experiments.sweeps.cases import SHOWN, CaseRow, told_apart
from experiments.sweeps.plan import Run, read_plan
from experiments.sweeps.progress import SweepProgress
from experiments.sweeps.results import RunResult
from experiments.sweeps.stats import Estimate
from fogwatch.cli.ending import guarded
from patrol.errors import BadInput
from tests.command_line import Command, output, refuses

ROBOTS, PATROL = {"count": 2, "model": "holonomic"}, {"policy": "potential-field"}
BASE = {"terrain": {"builtin": "yards"}, "point": 1, "duration": 20, "robots": ROBOTS, "patrol": PATROL}
OPTIONS = {"robots.count": [1, 2, 3], "patrol.options.dilatation": [0, 3]}
TWENTY_FOUR = {"base": BASE, "grid": {"patrol.options.direction": ["mode", "vector"], **OPTIONS}, "seeds": 2}


def write(folder: Path, says: dict[str, Any]) -> Path:
    file = folder / "trial.yaml"
    file.write_text(yaml.safe_dump(says, sort_keys=False))
    return file


@contextmanager
def started(file: Path, out: Path, workers: int = 2) -> Iterator[subprocess.Popen[str]]:
    """A sweep as a process whose lines can be read as they come."""
    command = [sys.executable, "-P", "-m", "fogwatch", "sweep", str(file), "--out", str(out), "--workers", str(workers)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, process_group=0) as process:
        try:
            yield process
        finally:
            process.kill()


def read_until(process: subprocess.Popen[str], done: int) -> list[str]:
    """The lines up to the one that reports so many runs."""
    assert process.stdout is not None
    lines = []
    for line in process.stdout:
        lines.append(line)
        if line.startswith(f"run {done} of "):
            return lines
    assert process.stderr is not None
    raise AssertionError(f"ended early: {lines} {process.stderr.read()}")


def results(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]


def numbers(found: list[dict[str, Any]]) -> dict[str, Any]:
    return {one["key"]: (one["case"], one["seed"], one["outcome"], one["metrics"], one["trace_hash"]) for one in found}


@pytest.mark.processes
def test_a_sweep_killed_on_its_way_makes_only_the_runs_that_are_missing(tmp_path: Path, run: Command) -> None:
    def lasting(*durations: int) -> dict[str, Any]:
        grid = {"patrol.options.direction": ["mode", "vector"], "duration": list(durations), **OPTIONS}
        return {**TWENTY_FOUR, "grid": grid}

    file = write(tmp_path, lasting(20, 1_000_000))  # after twelve runs come some that last until the signal is there
    with started(file, tmp_path / "killed") as process:
        read_until(process, 4)
        os.kill(process.pid, signal.SIGKILL)
    file = write(tmp_path, lasting(20))
    before = results(tmp_path / "killed")
    assert 4 <= len(before) <= 12
    said = output(run("sweep", file, "--out", tmp_path / "killed", "--workers", "1"))
    assert f"{24 - len(before)} runs to make, {len(before)} done already" in said
    after = results(tmp_path / "killed")
    assert after[: len(before)] == before
    assert set(Counter(one["key"] for one in after).values()) == {1}
    assert len(after) == 24
    grid = lasting(20)["grid"]
    cases = [json.dumps(dict(zip(grid, values, strict=True))) for values in product(*grid.values())]
    assert Counter(json.dumps(one["settings"]) for one in after) == dict.fromkeys(cases, 2)
    output(run("sweep", file, "--out", tmp_path / "whole", "--workers", "2"))
    assert numbers(after) == numbers(results(tmp_path / "whole"))
    assert (tmp_path / "killed" / "summary.csv").read_text() == (tmp_path / "whole" / "summary.csv").read_text()
    assert len((tmp_path / "whole" / "summary.csv").read_text().splitlines()) == 13
    with (tmp_path / "whole" / "runs.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert sorted(one["trace_hash"] for one in rows) == sorted(one["trace_hash"] for one in after)
    assert {one["robots.count"] for one in rows} == {"1", "2", "3"}
    figures = {figure.name for figure in (tmp_path / "whole" / "figures").iterdir()}
    assert {"cases-mfow_mean_s.png", "cases-mfow_mean_s.svg", "curves-mfow_mean_s.png"} <= figures


@pytest.mark.processes
def test_ctrl_c_ends_the_workers_and_leaves_a_folder_to_go_on_with(tmp_path: Path, run: Command) -> None:
    endless = {**TWENTY_FOUR, "grid": {"duration": [20, 1_000_000]}, "seeds": 1}
    file = write(tmp_path, endless)
    with started(file, tmp_path / "out") as process:
        read_until(process, 1)
        process.send_signal(signal.SIGINT)
        said, complained = process.communicate(timeout=300)
    assert process.returncode == 130
    assert "1 of 2 runs are done; start again to continue in" in said
    assert "Traceback" not in complained
    assert len(results(tmp_path / "out")) == 1
    # Nobody holds the folder any more, and what was done is done.
    file = write(tmp_path, {**endless, "grid": {"duration": [20]}})
    again = output(run("sweep", file, "--out", tmp_path / "out"))
    assert "1 runs, 0 made now" in again


@pytest.mark.processes
def test_failed_runs_are_reported_and_the_others_kept(tmp_path: Path, run: Command) -> None:
    cases = [{"name": "good"}, {"name": "crash", "set": {"robots.starts": [[10, 10], [10.5, 10]]}}]
    base = {**BASE, "terrain": {"builtin": "open"}, "duration": 10}
    file = write(tmp_path, {"base": base, "cases": cases, "seeds": 2})
    code, said, _ = run("sweep", file, "--out", tmp_path / "out", "--workers", "1")
    assert code == 1
    assert "failed runs" in said
    page = (tmp_path / "out" / "sweep.md").read_text(encoding="utf-8")
    assert "**2 runs failed or were not valid; they are left out.**" in page
    assert "\n| good | 2 | " in page
    assert "![Mean MFoW (s)](figures/cases-mfow_mean_s.png)" in page
    outcomes = [(one["case"], one["outcome"]) for one in results(tmp_path / "out")]
    assert outcomes == [("good", "ok")] * 2 + [("crash", "failed")] * 2


@pytest.mark.parametrize(
    ("says", "words", "problem"),
    [
        ({"grid": {"patrol.dilation": [1]}}, [], "override patrol.dilation: unknown key; did you mean"),
        ({}, ["--workers", "1", "--cluster", "tcp://127.0.0.1:9"], "--workers and --cluster"),
        ({}, ["--cluster", "nowhere"], "cluster = nowhere: cannot be reached"),
        ({}, ["--seeds", "many"], "--seeds many: expected a whole number"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    tmp_path: Path, run: Command, says: dict[str, Any], words: list[str], problem: str
) -> None:
    said = run("sweep", write(tmp_path, {**TWENTY_FOUR, **says}), "--out", "out", *words)
    refuses(said, problem)
    assert said.out == ""
    out = tmp_path / "out" / "results.jsonl"
    assert not out.exists() or out.read_text() == ""


def test_a_damaged_result_file_is_refused(tmp_path: Path, run: Command) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.jsonl").write_text("{}\n")
    refuses(
        run("sweep", write(tmp_path, TWENTY_FOUR), "--out", "out"), "results.jsonl line 1: is damaged (it reads {})"
    )


def test_an_interruption_is_130_and_bad_input_2(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    def bad() -> None:
        raise BadInput("no")

    assert guarded(interrupted) == 130
    assert guarded(bad) == 2
    assert capsys.readouterr().err == "fogwatch: interrupted\nfogwatch: no\n"


def test_the_progress_tells_what_is_left(tmp_path: Path) -> None:
    runs: list[Run] = list(read_plan(write(tmp_path, TWENTY_FOUR)).runs)
    times = iter([0.0, 10.0, 30.0])
    console = Console(record=True, width=200, force_terminal=False, file=io.StringIO())
    with SweepProgress(console, clock=lambda: next(times)) as progress:
        progress.begin(runs[:3], [], 2)
        progress.result(RunResult("k", "one", 1, "ok", None, {"mfow_mean_s": 85.25}, None, 9.0, "1"))
        progress.result(RunResult("l", "two", 2, "failed", "too bad", {}, None, 9.0, "1"))
    assert console.export_text().splitlines() == [
        "3 runs to make; 2 at a time",
        "run 1 of 3: one, seed 1: mean MFoW 85.2 s, made in 9.0 s; 20 s left",
        "two seed 2 failed: too bad",
    ]
    assert (progress.done, progress.total) == (2, 3)


# --- the table of the cases ------------------------------------------------------------------------------------------


def table_of(names: list[str], width: int, against: str | None = None) -> list[str]:
    """The lines of a table of cases with large numbers."""
    metrics = {name: Estimate(1234.5, 1114.2, 1354.8, 3) for name in SHOWN}
    metrics["collisions"] = Estimate(12345.0, 11145.0, 13545.0, 3)
    change = {"mfow_mean_s": Estimate(-12.3, -15.7, -8.9, 3)}
    rows = [CaseRow(name, {}, 3, 0, 0, metrics, {}, None if name == against else against, change) for name in names]
    text = io.StringIO()
    print_cases(Console(file=text, width=width), rows)
    return text.getvalue().splitlines()


COMMON = "point=0.5 goal_distance=1.6 refine_side=0.6"
LONG = [f"{COMMON} separation={one} dilatation={two}" for one in "xy" for two in "12"]


@pytest.mark.parametrize("against", [None, LONG[0]])
@pytest.mark.parametrize("width", [60, 80, 100, 120, 200])
def test_at_any_width_cases_can_be_told_apart_and_no_number_is_cut(width: int, against: str | None) -> None:
    lines = table_of(LONG, width, against)
    assert lines[0] == f"all cases: {COMMON}"
    text = "\n".join(lines)
    assert "…" not in text
    words = re.findall(r"separation=\w|dilatation=\w", text)
    assert words == [word for name in LONG for word in name.split()[3:]]
    assert text.count("12345.0") == text.count("±1200.0") == 4
    assert width < 80 or max(map(len, lines)) <= width


@pytest.mark.parametrize("width", [80, 100, 140])
def test_short_names_stay_and_are_wrapped(width: int) -> None:
    lines = [line.rstrip() for line in table_of(["tour half lost", "paper none"], width, "tour half lost")]
    assert [line.split()[0] for line in lines if line.startswith(("tour", "paper"))] == ["tour", "paper"]
    assert sum(line.count("1234.5") for line in lines) == 8
    assert max(map(len, lines)) <= width


def test_only_words_that_all_names_share_are_left_out() -> None:
    assert told_apart({"open 3": ["open", "3"], "open 5": ["open", "5"]}) == ({"open 3": "3", "open 5": "5"}, "open")
    assert told_apart({"base": ["base"]}) == ({"base": "base"}, "")
    assert told_apart({"open": ["open"], "open 5": ["open", "5"]}) == ({"open": "open", "open 5": "open 5"}, "")
    assert told_apart({"a b": ["a", "b"], "b a": ["b", "a"]}) == ({"a b": "a b", "b a": "b a"}, "")


@pytest.mark.processes
def test_it_says_what_its_runs_hold_for_before_them_and_where_none_is_left(tmp_path: Path, run: Command) -> None:
    passable = np.zeros((14, 60), dtype=np.bool_)
    passable[1:-1, 1:-1] = True  # a corridor of 1.2 m
    ground = {"map": str(write_map(passable, 0.1, tmp_path / "corridor.yaml"))}
    base = {"terrain": ground, "point": 0.1, "duration": 5, "robots": {"count": 1, "radius": 0.3}}
    file = write(tmp_path, {"base": base, "grid": {"robots.speed": [0.2, 1.0]}, "seeds": 1})
    steps = "automatic steps differ: 0.1, 0.5 s; for one step in all cases, set step: 0.1 in base"
    for beginning in ("2 runs to make; 1 at a time", None):
        said = output(run("sweep", file, "--out", tmp_path / "out", "--workers", "1")).splitlines()
        assert said[0].endswith("given: radius 0.3 m, speed 0.2 m/s, points of 0.1 m")
        assert "assumed: " in said[1]
        assert said[2] == steps
        assert beginning is None or said[3] == beginning
    stated = write(tmp_path, {"base": {**BASE, "duration": 5}, "grid": {"step": [0.5, 0.25]}, "seeds": 1})
    assert "steps differ" not in output(run("sweep", stated, "--out", tmp_path / "stated", "--workers", "1"))
