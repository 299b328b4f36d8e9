"""``fogwatch benchmark`` as a command: what it writes, that its commands repeat its runs, and what it refuses."""

from __future__ import annotations

import csv
import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

from experiments.benchmark.matrix import read_policies
from experiments.benchmark.presets import preset_named
from experiments.commands.benchmark import Comparison
from fogwatch.cli.app import app
from patrol.scenario import BUILTINS, load_scenario
from tests.cells import write_cells
from tests.command_line import Command, output, refuses

GRAPH = "2 40 40 0.5 0 0\n0 10 10 1\n1 E 20\n1 30 10 1\n0 W 20\n"
QUIET = ("--no-picture", "--no-recording", "--no-report", "--quiet")


@pytest.mark.processes
def test_it_writes_a_page_and_each_command_repeats_its_run(run: Command, tmp_path: Path) -> None:
    occupied = np.zeros((40, 40), dtype=np.bool_)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    write_cells(tmp_path, "plan", occupied)
    (tmp_path / "plan.graph").write_text(GRAPH)
    words = (
        *("benchmark", "--policies", "committed:separation=none,sebs:g2=50", "--terrains", "open,plan.graph+plan.yaml"),
        *("--conditions", "spoof+loss-50", "--teams", "2,3", "--seeds", "1", "--point", "2", "--duration", "100"),
        *("--workers", "1", "--out", "bench"),
    )
    out = output(run(*words))
    assert "8 runs made in " in out
    assert "## 3 robots, spoof+loss-50" in out
    with (tmp_path / "bench/runs.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    assert len(runs) == 8
    chosen = [row for row in runs if row["team"] == "2"]
    assert {row["terrain"] for row in chosen} == {"open", "plan"}
    for number, row in enumerate(chosen):
        assert (row["nodes_worst_s"] != "") == (row["terrain"] == "plan")
        output(run(*shlex.split(row["command"])[1:], *QUIET, "--out", f"again-{number}"))
        summary = json.loads((tmp_path / f"again-{number}/summary.json").read_text(encoding="utf-8"))
        assert summary["trace_hash"] == row["trace_hash"]
        assert summary["mfow_late_mean_s"] == float(row["mfow_late_mean_s"])
    page = (tmp_path / "bench/benchmark.md").read_text(encoding="utf-8")
    for name in ("plane", "cases-mfow_late_mean_s"):
        assert f"](figures/{name}.png)" in page
        assert (tmp_path / f"bench/figures/{name}.png").stat().st_size > 1000
        assert (tmp_path / f"bench/figures/{name}.svg").stat().st_size > 1000
    with (tmp_path / "bench/cells.csv").open(encoding="utf-8") as file:
        assert [cell["command"] for cell in csv.DictReader(file)] == [row["command"] for row in runs]


def test_the_policies_of_the_examples_can_be_run() -> None:
    command: Any = get_command(app)
    examples = [shlex.split(line) for line in command.commands["benchmark"].epilog.splitlines()]
    lists = [words[words.index("--policies") + 1] for words in examples if "--policies" in words]
    policies = [policy for text in lists for policy in read_policies(text) if not policy.name.startswith("./")]
    assert any(len(policy.settings) > 1 for policy in policies), "one has an option"
    for policy in policies:
        load_scenario({"terrain": {"builtin": "open"}}, policy.settings)


@pytest.mark.parametrize(
    ("given", "seeds", "duration_s", "point_m"),
    [
        ({}, 5, 1200.0, 0.5),
        ({"quick": True}, 2, 300.0, 1.0),
        ({"quick": True, "seeds": 7, "duration": 40.0, "point": 0.25}, 7, 40.0, 0.25),
    ],
)
def test_what_is_not_given_is_as_its_help_says(
    given: dict[str, Any], seeds: int, duration_s: float, point_m: float
) -> None:
    matrix = Comparison(policies="cr", **given).matrix(None)
    assert (matrix.seeds, matrix.duration_s) == (tuple(range(1, seeds + 1)), duration_s)
    assert matrix.settings == {"point": point_m, "robots.model": "holonomic"}
    assert (matrix.teams, matrix.conditions) == ((4,), ("none",))
    assert [terrain.name for terrain in matrix.terrains] == list(BUILTINS)


def test_a_preset_without_published_numbers_may_be_restricted() -> None:
    preset = preset_named("conditions")
    matrix = Comparison(preset="conditions", conditions="none,bursts", duration=90.0, seeds=1).matrix(preset)
    assert [policy.name for policy in matrix.policies] == ["stochastic", "committed", "potential-field"]
    assert [terrain.name for terrain in matrix.terrains] == ["yards", "site"]
    assert (matrix.conditions, matrix.duration_s, matrix.seeds) == (("none", "bursts"), 90.0, (1,))
    matrix = Comparison(preset="conditions", policies="cr", terrains="clutter").matrix(preset)
    assert ([policy.name for policy in matrix.policies], matrix.terrains[0].name) == (["cr"], "clutter")
    assert (matrix.teams, matrix.duration_s, len(matrix.conditions)) == ((4,), 1200.0, 25)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--policies", "even-tours"), "patrol.policy = even-tours: no such policy; did you mean even-tour"),
        (("--policies", "sebs:g3=1"), "options.g3 = 1: unknown key; sebs has the options tolerance, g2, edge_min"),
        (("--policies", "committed:separation=some"), "patrol.options.separation ="),
        (("--terrains", "gone.graph+open"), "gone.graph"),
        (("--seeds", "0"), "seeds = 0"),
        (("--duration", "-5"), "duration"),
        (("--point", "0"), "point"),
        (("--model", "boat"), "model"),
        (("--set", "robots.count=3"), "--set robots.count: the benchmark sets this field; use --teams"),
        (("--set", "patrol.policy=cr"), "--set patrol.policy: the benchmark sets this field; use --policies"),
        (("--set", "terrain={}"), "--set terrain: the benchmark sets this field; use --terrains"),
        (("--set", "nonsense=1"), "nonsense"),
        (("--preset", "magic"), "--preset magic: no such preset; did you mean magec"),
        (("--preset", "magec"), "--preset: needs --terrains cumberland.graph+cumberland.yaml; get the files from"),
        (("--preset", "magec", "--teams", "3"), "--teams: --preset magec says what is run; leave it out"),
        (("--preset", "magec", "--conditions", "none"), "--conditions: --preset magec says what is run; leave it out"),
        (("--preset", "conditions", "--teams", "3"), "--teams: --preset conditions says what is run; leave it out"),
        (("--preset", "conditions", "--conditions", "speed"), "speed: no such condition; did you mean speeds"),
        (("--preset", "conditions", "--terrains", "gone.yaml"), "gone.yaml: no such file"),
        (("--preset", "magec", "--point", "1"), "--point: --preset magec says what is run; leave it out"),
        (
            ("--conditions", "none,speeds", "--set", "robots.starts=[[5,5]]"),
            "--set robots.starts: speeds, slower-P and bodies list the robots one by one; leave out these",
        ),
        (("--conditions", "slower-5", "--set", "robots.spare=1"), "--set robots.spare: speeds, slower-P and bodies"),
        (("--preset", "conditions", "--set", "robots.spare=1"), "--set robots.spare: speeds, slower-P and bodies"),
        (("--conditions", "bodies+loss-5", "--set", "robots.starts=[]"), "--set robots.starts: speeds, slower-P and"),
        (("--workers", "0"), "workers = 0"),
        (("--workers", "1", "--cluster", "tcp://127.0.0.1:9"), "--workers and --cluster"),
    ],
)
def test_nonsense_is_refused_in_one_line(run: Command, tmp_path: Path, words: tuple[str, ...], says: str) -> None:
    refuses(run("benchmark", *words, "--out", "bench"), says)
    assert not (tmp_path / "bench").exists()
