"""Radio models in fleets of processes: the same trace as in one process, and what they lose is counted and judged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.fogwatch.conftest import WITHOUT, Refused, Shell

HERE = Path(__file__).parent
EXAMPLE = HERE.parents[2] / "examples" / "my_radio.py"


def write_scenario(folder: Path, **radio: Any) -> Path:
    faults = [{"kind": "loss", "rate": 0.1, "at": 10, "for": 10}]
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40, "radio": radio, "faults": faults}
    path = folder / "scenario.yaml"
    path.write_text(json.dumps({**given, "robots": {"count": 4, "model": "holonomic"}}), encoding="utf-8")
    return path


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
    radio: dict[str, Any], cause: str, shell: Shell, tmp_path: Path
) -> None:
    path = write_scenario(tmp_path, **radio)
    summaries = []
    for way in (("--in-process", "--no-report"), ("--no-page",)):
        out = tmp_path / way[0].strip("-")
        assert shell("run", path, *way, "--no-picture", "--no-recording", "--out", out).code == 0
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
    # A stranger's folder: judging it again runs nothing that is in it.
    for file in (tmp_path / "no-page").glob("model/*.py"):
        file.write_text("raise SystemExit('ran')", encoding="utf-8")
    judged = shell("judge", tmp_path / "no-page")
    assert judged.code == 0
    assert "summary     agrees with the journal in every" in judged.out


@pytest.mark.processes
@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_model_that_fails_in_a_run_ends_it_with_what_it_raised(way: str, shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\n\nclass Late:\n    def __init__(self, setup):\n        pass\n\n"
        "    def lost(self, air):\n        return air.on_the_way & False if air.k < 20 else 1 / 0\n",
        encoding="utf-8",
    )
    path = write_scenario(tmp_path, model="./mine.py:Late")
    shown = shell("run", path, way, *WITHOUT[1:], "--out", tmp_path / "out")
    log = tmp_path / "out" / "logs" / "world.log"
    told = shown.err + (log.read_text(encoding="utf-8") if log.exists() else "")
    assert shown.code != 0
    assert "mine.py:Late: raises ZeroDivisionError: division by zero; correct it" in told
    assert "Traceback" not in told


@pytest.mark.parametrize(
    ("model", "says"),
    [("./nowhere.py:Model", "cannot be read"), (f"{EXAMPLE}:Missing", "has no Missing"), ("no-such", "no such model")],
)
def test_a_model_that_cannot_be_had_is_one_line_and_no_run(
    model: str, says: str, refused: Refused, tmp_path: Path
) -> None:
    for command in (("run", "yards", "--out", tmp_path / "out"), ("scenario", "check", "yards")):
        said = refused(*command, "--set", f"radio.model={model}")
        assert "radio.model" in said
        assert says in said
    assert not (tmp_path / "out").exists()


def test_a_check_names_a_model_that_it_does_not_run(shell: Shell) -> None:
    own = shell("scenario", "check", "yards", "--set", f"radio.model={EXAMPLE}:Halving")
    assert own.code == 0
    assert "my_radio.py:Halving, not run: a run checks its options" in own.out
    ours = shell("scenario", "check", "yards", "--set", "radio.model=path-loss")
    assert ours.code == 0
    assert "radio model" not in ours.out
