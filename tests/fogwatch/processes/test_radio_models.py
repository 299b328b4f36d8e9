"""Radio models in fleets of processes: the same trace as in one process, and what they lose is counted and judged."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fogwatch.conftest import WITHOUT

HERE = Path(__file__).parent
EXAMPLE = HERE.parents[2] / "examples" / "my_radio.py"


def scenario(**radio: Any) -> dict[str, Any]:
    return {
        "terrain": {"builtin": "yards"},
        "point": 1.0,
        "duration": 40,
        "robots": {"count": 4, "model": "holonomic"},
        "radio": radio,
        "faults": [{"kind": "loss", "rate": 0.1, "at": 10, "for": 10}],
    }


@pytest.mark.processes
@pytest.mark.parametrize(
    ("radio", "cause"),
    [
        ({"model": "path-loss", "options": {"redraw": 5, "airtime": 0.02}}, "path-loss"),
        ({"model": f"{EXAMPLE}:Halving", "options": {"reach": 20}}, "model"),
    ],
    ids=["path-loss", "own"],
)
def test_a_model_gives_the_same_trace_in_one_process_and_in_many(
    radio: dict[str, Any],
    cause: str,
    fogwatch: Callable[..., int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(json.dumps(scenario(**radio)), encoding="utf-8")
    summaries = []
    for way in (("--in-process", "--no-report"), ("--no-page",)):
        out = tmp_path / way[0].strip("-")
        assert fogwatch("run", str(path), *way, "--no-picture", "--no-recording", "--out", str(out)) == 0
        summaries.append(json.loads((out / "summary.json").read_text(encoding="utf-8")))
    assert f"<td>{cause}</td>" in (tmp_path / "no-page" / "report.html").read_text(encoding="utf-8")
    one, many = summaries
    assert one["trace_hash"] == many["trace_hash"]
    lost = many["messages"]["dropped_by_cause"][cause]
    assert lost > 100
    assert sum(link["dropped"].get(cause, 0) for to in many["links"].values() for link in to.values()) == lost
    assert many["messages"]["dropped_by_cause"] == one["messages"]["dropped_by_cause"]
    checks = {check["name"]: check["detail"] for check in many["verdict"]["checks"]}
    assert ("path loss" in checks) == (cause == "path-loss")
    capsys.readouterr()
    # A stranger's folder: judging it again runs nothing that is in it.
    for file in (tmp_path / "no-page").glob("model/*.py"):
        file.write_text("raise SystemExit('ran')", encoding="utf-8")
    assert fogwatch("judge", str(tmp_path / "no-page")) == 0
    assert "summary     agrees with the journal in every" in capsys.readouterr().out


@pytest.mark.processes
@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_model_that_fails_in_a_run_ends_it_with_what_it_raised(
    way: str, fogwatch: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\n\nclass Late:\n    def __init__(self, setup):\n        pass\n\n"
        "    def lost(self, air):\n        return air.on_the_way & False if air.k < 20 else 1 / 0\n",
        encoding="utf-8",
    )
    path = tmp_path / "scenario.yaml"
    path.write_text(json.dumps(scenario(model="./mine.py:Late")), encoding="utf-8")
    code = fogwatch("run", str(path), way, *WITHOUT[1:], "--out", str(tmp_path / "out"))
    said = capsys.readouterr().err
    log = tmp_path / "out" / "logs" / "world.log"
    told = said + (log.read_text(encoding="utf-8") if log.exists() else "")
    assert code != 0
    assert "mine.py:Late: raises ZeroDivisionError: division by zero; correct it" in told
    assert "Traceback" not in told


@pytest.mark.parametrize(
    ("model", "says"),
    [("./nowhere.py:Model", "cannot be read"), (f"{EXAMPLE}:Missing", "has no Missing"), ("no-such", "no such model")],
)
def test_a_model_that_cannot_be_had_is_one_line_and_no_run(
    model: str, says: str, fogwatch: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (("run", "yards", "--out", str(tmp_path / "out")), ("scenario", "check", "yards")):
        assert fogwatch(*command, "--set", f"radio.model={model}") == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1
        assert "radio.model" in lines[0]
        assert says in lines[0]
    assert not (tmp_path / "out").exists()


def test_a_check_names_a_model_that_it_does_not_run(
    fogwatch: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert fogwatch("scenario", "check", "yards", "--set", f"radio.model={EXAMPLE}:Halving") == 0
    assert "my_radio.py:Halving, not run: a run checks its options" in capsys.readouterr().out
    assert fogwatch("scenario", "check", "yards", "--set", "radio.model=path-loss") == 0
    assert "radio model" not in capsys.readouterr().out
