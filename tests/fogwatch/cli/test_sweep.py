"""``fogwatch sweep`` as a command: killed, interrupted, started again; its output and exit codes."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from rich.console import Console

from experiments.sweeps.plan import Run, read_plan
from experiments.sweeps.results import RunResult
from fogwatch.cli.app import guarded, main
from fogwatch.progress import SweepProgress, duration
from patrol.errors import BadInput

TWENTY_FOUR: dict[str, Any] = {
    "base": {
        "terrain": {"builtin": "yards"},
        "point": 1,
        "duration": 60,
        "robots": {"count": 2, "model": "holonomic"},
    },
    "grid": {"patrol.direction": ["mode", "vector"], "robots.count": [1, 2, 3], "patrol.dilatation": [0, 3]},
    "seeds": 2,
}


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
        if line.startswith(f"{done}/"):
            return lines
    assert process.stderr is not None
    raise AssertionError(f"ended early: {lines} {process.stderr.read()}")


def results(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]


def numbers(found: list[dict[str, Any]]) -> dict[str, Any]:
    return {one["key"]: (one["case"], one["seed"], one["outcome"], one["metrics"], one["trace_hash"]) for one in found}


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """A command in this process: exit code, output, errors."""
    sys.argv = ["fogwatch", *words]
    code = main()
    said = capsys.readouterr()
    return code, said.out, said.err


@pytest.fixture(autouse=True)
def own_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("COLUMNS", "200")


@pytest.mark.processes
def test_a_sweep_killed_half_way_makes_only_the_runs_that_are_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write(tmp_path, TWENTY_FOUR)
    with started(file, tmp_path / "killed") as process:
        read_until(process, 12)
        os.kill(process.pid, signal.SIGKILL)
    before = results(tmp_path / "killed")
    assert 12 <= len(before) < 24
    code, said, _ = run(capsys, "sweep", str(file), "--out", str(tmp_path / "killed"), "--workers", "1")
    assert code == 0
    assert f"{24 - len(before)} runs to make, {len(before)} done already" in said
    after = results(tmp_path / "killed")
    assert after[: len(before)] == before
    assert set(Counter(one["key"] for one in after).values()) == {1}
    assert len(after) == 24
    code, _, _ = run(capsys, "sweep", str(file), "--out", str(tmp_path / "whole"), "--workers", "2")
    assert code == 0
    assert numbers(after) == numbers(results(tmp_path / "whole"))
    for name in ("summary.csv", "summary.json"):
        assert (tmp_path / "killed" / name).read_text() == (tmp_path / "whole" / name).read_text()
    assert len((tmp_path / "whole" / "summary.csv").read_text().splitlines()) == 13


@pytest.mark.processes
def test_ctrl_c_ends_the_workers_and_leaves_a_folder_to_go_on_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
    code, again, _ = run(capsys, "sweep", str(file), "--out", str(tmp_path / "out"))
    assert code == 0
    assert "1 runs, 0 made now" in again


@pytest.mark.processes
def test_failed_runs_are_reported_and_the_others_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cases = [{"name": "good"}, {"name": "crash", "set": {"robots.starts": [[10, 10], [10.5, 10]]}}]
    base = {**TWENTY_FOUR["base"], "terrain": {"builtin": "open"}, "duration": 10}
    file = write(tmp_path, {"base": base, "cases": cases, "seeds": 2})
    code, said, _ = run(capsys, "sweep", str(file), "--out", str(tmp_path / "out"), "--workers", "1")
    assert code == 1
    assert "failed runs" in said
    assert [(one["case"], one["outcome"]) for one in results(tmp_path / "out")] == [
        ("good", "ok"),
        ("good", "ok"),
        ("crash", "failed"),
        ("crash", "failed"),
    ]


@pytest.mark.parametrize(
    ("says", "words", "problem"),
    [
        ({"grid": {"patrol.dilation": [1]}}, [], "override patrol.dilation: unknown key; did you mean dilatation?"),
        ({}, ["--workers", "0"], "--workers = 0: expected 1 or more"),
        ({}, ["--workers", "1", "--cluster", "tcp://127.0.0.1:9"], "--workers and --cluster"),
        ({}, ["--cluster", "nowhere"], "--cluster = nowhere: cannot be reached"),
        ({}, ["--seeds", "0"], "--seeds = 0"),
        ({}, ["--seeds", "many"], "valid integer"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], says: dict[str, Any], words: list[str], problem: str
) -> None:
    file = write(tmp_path, {**TWENTY_FOUR, **says})
    code, said, complained = run(capsys, "sweep", str(file), "--out", str(tmp_path / "out"), *words)
    assert (code, said) == (2, "")
    assert problem in complained
    assert complained.count("\n") == 1
    out = tmp_path / "out" / "results.jsonl"
    assert not out.exists() or out.read_text() == ""


def test_a_damaged_result_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "results.jsonl").write_text("{}\n")
    file = write(tmp_path, TWENTY_FOUR)
    code, _, complained = run(capsys, "sweep", str(file), "--out", str(tmp_path / "out"))
    assert code == 2
    assert "results.jsonl line 1: is damaged (it reads {})" in complained


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
        "1/3 one seed 1: mean MFoW 85.2 s, 9.0 s; 20 s left",
        "two seed 2 failed: too bad",
    ]
    assert (progress.done, progress.total) == (2, 3)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.4, "0 s"), (89.0, "89 s"), (95.0, "2 min"), (5300.0, "88 min"), (7500.0, "2 h 05 min")]
)
def test_durations_are_for_people(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_an_interruption_is_130_and_bad_input_2(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    def bad() -> None:
        raise BadInput("no")

    assert guarded(interrupted) == 130
    assert guarded(bad) == 2
    assert capsys.readouterr().err == "fogwatch: interrupted\nfogwatch: no\n"
