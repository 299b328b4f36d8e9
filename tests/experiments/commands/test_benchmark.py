"""``fogwatch benchmark`` as a command: what it writes, that its commands repeat its runs, and what it refuses."""

from __future__ import annotations

import csv
import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from experiments.benchmark.matrix import read_policies
from fogwatch.cli.app import app
from patrol.scenario import load_scenario

PLAN = "image: plan.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
GRAPH = "2 40 40 0.5 0 0\n0 10 10 1\n1 E 20\n1 30 10 1\n0 W 20\n"
QUIET = ("--no-picture", "--no-recording", "--no-report", "--quiet")


def plan_files(folder: Path) -> None:
    """Write an empty room of 20 m with a graph of two vertices."""
    rows = [bytes(0 if {row, col} & {0, 39} else 254 for col in range(40)) for row in range(40)]
    (folder / "plan.pgm").write_bytes(b"P5 40 40 255\n" + b"".join(rows))
    (folder / "plan.yaml").write_text(PLAN)
    (folder / "plan.graph").write_text(GRAPH)


@pytest.mark.processes
def test_it_writes_a_page_and_each_command_repeats_its_run(
    fogwatch: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan_files(tmp_path)
    words = (
        *("benchmark", "--policies", "committed:separation=none,sebs:g2=50", "--terrains", "open,plan.graph+plan.yaml"),
        *("--conditions", "spoof+loss-50", "--teams", "2,3", "--seeds", "1", "--point", "2", "--duration", "100"),
        *("--workers", "1", "--out", "bench"),
    )
    assert fogwatch(*words) == 0
    out = capsys.readouterr().out
    assert "8 runs made in " in out
    assert "MFoW of the second half (s), 3 robots, spoof+loss-50" in out
    with (tmp_path / "bench/runs.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    assert len(runs) == 8
    chosen = [run for run in runs if run["team"] == "2"]
    assert {run["terrain"] for run in chosen} == {"open", "plan"}
    for number, run in enumerate(chosen):
        assert (run["nodes_worst_s"] != "") == (run["terrain"] == "plan")
        assert fogwatch(*shlex.split(run["command"])[1:], *QUIET, "--out", f"again-{number}") == 0
        summary = json.loads((tmp_path / f"again-{number}/summary.json").read_text(encoding="utf-8"))
        assert summary["trace_hash"] == run["trace_hash"]
        assert summary["mfow_late_mean_s"] == float(run["mfow_late_mean_s"])
    page = (tmp_path / "bench/benchmark.html").read_text(encoding="utf-8")
    assert "http" not in page.replace("http://www.w3.org/", "").replace("http-equiv", ""), "it loads nothing"
    for name in ("plane", "attacks", "dots-mfow_late_mean_s", "teams-mfow_late_mean_s"):
        assert f'<section id="{name}">' in page
        assert (tmp_path / f"bench/figures/{name}.png").stat().st_size > 1000
        assert (tmp_path / f"bench/figures/{name}.svg").stat().st_size > 1000
    assert chosen[0]["command"].replace("'", "&#x27;").replace('"', "&quot;") in page
    with (tmp_path / "bench/cells.csv").open(encoding="utf-8") as file:
        assert [cell["command"] for cell in csv.DictReader(file)] == [run["command"] for run in runs]


def test_the_policies_of_the_examples_can_be_run() -> None:
    command: Any = get_command(app)
    examples = [shlex.split(line) for line in command.commands["benchmark"].epilog.splitlines()]
    lists = [words[words.index("--policies") + 1] for words in examples if "--policies" in words]
    policies = [policy for text in lists for policy in read_policies(text) if not policy.name.startswith("./")]
    assert any(len(policy.settings) > 1 for policy in policies), "one has an option"
    for policy in policies:
        load_scenario({"terrain": {"builtin": "open"}}, policy.settings)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--policies", "even-tours"), "patrol.policy = even-tours: no such policy; did you mean even-tour"),
        (
            ("--policies", "sebs:g3=1"),
            "patrol.options.g3 = 1: unknown key; sebs has the options tolerance, g2, edge_min",
        ),
        (("--policies", "committed:separation=some"), "patrol.options.separation ="),
        (
            ("--terrains", "yard"),
            "--terrains yard: no such built-in terrain, and no map's YAML file; did you mean yards",
        ),
        (("--terrains", "gone.yaml"), "gone.yaml: no such file"),
        (("--terrains", "gone.graph+open"), "gone.graph"),
        (("--teams", "0"), "--teams 0: 0: expected a number of robots from 1 to"),
        (("--teams", "2", "--conditions", "deaths"), "--teams 2: deaths needs 3 robots or more"),
        (("--conditions", "loss"), "--conditions loss: loss: no such condition"),
        (("--seeds", "0"), "seeds = 0"),
        (("--duration", "-5"), "duration"),
        (("--point", "0"), "point"),
        (("--model", "boat"), "model"),
        (("--set", "robots.count=3"), "--set robots.count: the benchmark sets this field; use --teams"),
        (("--set", "patrol.policy=cr"), "--set patrol.policy: the benchmark sets this field; use --policies"),
        (("--set", "terrain={}"), "--set terrain: the benchmark sets this field; use --terrains"),
        (("--set", "nonsense=1"), "nonsense"),
        (("--preset", "magic"), "--preset magic: no such preset; did you mean magec"),
        (("--preset", "magec"), "--preset magec: needs --map cumberland.yaml and --graph cumberland.graph; get both"),
        (("--preset", "magec", "--teams", "3"), "--teams: --preset magec says what is run; leave it out"),
        (("--map", "plan.yaml"), "--map plan.yaml: goes with --preset; give --terrains FILE.graph+MAP.yaml instead"),
        (("--workers", "0"), "workers = 0"),
        (("--workers", "1", "--cluster", "tcp://127.0.0.1:9"), "--workers and --cluster"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    fogwatch: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    assert fogwatch("benchmark", *words, "--out", "bench") == 2
    err = capsys.readouterr().err
    assert says in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "bench").exists()
