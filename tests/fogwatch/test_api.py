import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fogwatch
from bench.grounds import write_map
from fogwatch.run_folder import runfolder
from patrol.errors import BadInput
from patrol.journal import read_journal
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.load import keep_scenario
from runtime.messages.telemetry import Metrics
from tests.fleets import COARSE, python

ROBOTS = {"count": 2, "model": "holonomic"}
SMALL = {**COARSE, "name": "small", "point": 0.5, "duration": 20, "robots": ROBOTS}


def test_a_result_says_what_came_of_it_and_progress_is_told(tmp_path: Path) -> None:
    told: list[Metrics] = []
    result = fogwatch.run(SMALL, out=tmp_path / "run", progress=told.append)
    assert result.folder == tmp_path / "run"
    assert (result.folder / "fog.png").exists()
    assert result.mfow_s.shape == (40,)
    assert result.mfow_s.mean() == pytest.approx(result.summary["mfow_mean_s"])
    assert result.verdict.valid
    assert not result.interrupted
    assert result.trace_hash == result.summary["trace_hash"]
    for words in ("small", "MFoW mean", "20 s simulated", "verdict valid", str(result.folder)):
        assert words in repr(result)
    assert told[-1].k == told[-1].ticks == 40
    assert np.all(np.diff([metrics.k for metrics in told]) > 0)


def test_every_way_of_naming_a_scenario_is_the_same_and_the_seed_makes_the_difference(tmp_path: Path) -> None:
    def trace(way: Any, **overrides: Any) -> str:
        out = tmp_path / f"run-{len(list(tmp_path.iterdir()))}"
        run = fogwatch.run(way, out=out, overrides=overrides, picture=False)
        assert not (out / "fog.png").exists()
        return run.trace_hash

    file = tmp_path / "small.yaml"
    file.write_text(str(SMALL), encoding="utf-8")  # YAML reads what Python prints
    traces = {trace(way) for way in (SMALL, load_scenario(SMALL), file, str(file))}
    assert traces == {trace("open", point=0.5, duration=20, robots=ROBOTS)} != {trace(SMALL, seed=2)}


def test_a_run_says_what_it_assumed_and_its_folder_has_the_step_that_was_chosen(tmp_path: Path) -> None:
    passable = np.zeros((9, 60), dtype=np.bool_)
    passable[1:-1, 1:-1] = True
    ground = str(write_map(passable, 0.2, tmp_path / "passage.yaml"))
    body = {"robots.radius": 0.3, "robots.speed": 0.8, "robots.count": 2, "robots.model": "holonomic", "duration": 20}
    chosen = {"point": 0.2, "sensor.range": 2.0}

    def trace(folder: str, **overrides: object) -> str:
        run = fogwatch.run(ground, out=tmp_path / folder, picture=False, overrides={**body, **chosen, **overrides})
        step = overrides.get("step", "auto")
        assumed = [] if step == 0.25 else ["assumed: steps of 0.25 s (auto)"]
        sensor = "sensor of 2 m (all round, stopped by walls)"
        given = f"given: holonomic, radius 0.3 m, speed 0.8 m/s, {sensor}, points of 0.2 m"
        assert run.announced[0] == given + ("" if assumed else ", steps of 0.25 s")
        assert list(run.announced[1 : 1 + len(assumed)]) == assumed
        assert all(line in run._repr_html_() for line in run.announced[:2])
        assert run.scenario.step == 0.25
        assert run.summary["ticks"] == 80
        return run.trace_hash

    assert len({trace("auto"), trace("said", step="auto"), trace("number", step=0.25)}) == 1
    again = fogwatch.run(tmp_path / "auto" / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == fogwatch.load(tmp_path / "auto").trace_hash
    assert again.announced[0].endswith("steps of 0.25 s")


def test_recovery_is_judged_where_that_is_wanted(tmp_path: Path) -> None:
    silence = [{"kind": "silence", "who": "all", "at": 2, "for": 5}]
    mapping = {**SMALL, "faults": silence, "sensor": {"range": 200, "line_of_sight": False}}
    for recovery in (True, False):
        result = fogwatch.run(mapping, out=tmp_path / f"{recovery}", recovery=recovery, picture=False)
        (check,) = [check for check in result.verdict.checks if check.name == "recovery"]
        assert check.judged is recovery
        assert result.verdict.valid


def test_bad_input_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="do not fit"):
        fogwatch.run(SMALL, out=tmp_path / "run", overrides={"robots.radius": 30.0, "robots.count": 9}, picture=False)
    assert not list(tmp_path.iterdir())


def test_what_has_run_is_never_thrown_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def damaged(_: Path) -> None:
        raise BadInput("journal: tick 7 is damaged")

    monkeypatch.setattr("fogwatch.inprocess.read_journal", damaged)
    with pytest.raises(BadInput, match="tick 7"):
        fogwatch.run(SMALL, out=tmp_path / "run", picture=False)
    assert sum(1 for _ in read_journal(tmp_path / "run" / "journal").ticks) == 40


def test_the_public_names_are_listed_before_they_are_loaded() -> None:
    assert {*fogwatch.__all__} <= {*dir(fogwatch)}


def test_the_package_loads_nothing_until_a_run_is_wanted() -> None:
    program = "import sys, fogwatch\nassert 'numpy' not in sys.modules\nfogwatch.run\nassert 'numpy' in sys.modules"
    python("-c", program, check=True)
    with pytest.raises(AttributeError):
        _ = fogwatch.walk


INTERRUPTED = """
import sys
import fogwatch
from fogwatch.launch.launcher import Launch

def watch(launch):
    launch.interrupted = True

Launch.start, Launch.watch, Launch.finish = lambda launch: None, watch, lambda launch: {}
try:
    fogwatch.run("open", overrides={"point": 1.0, "duration": 10}, out=sys.argv[1], in_process=False, picture=False)
except KeyboardInterrupt:
    print({"worldsim.output.summary", "worldsim.verdict.judge"} & sys.modules.keys())
"""


def test_a_run_that_is_interrupted_before_its_first_tick_loads_no_judge(tmp_path: Path) -> None:
    assert python("-c", INTERRUPTED, tmp_path / "run", check=True).stdout == "set()\n"


def test_a_run_that_is_interrupted_while_its_folder_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(scenario: Scenario, folder: Path) -> None:
        keep_scenario(scenario, folder)
        raise KeyboardInterrupt

    monkeypatch.setattr(runfolder, "keep_scenario", interrupted)
    given = tmp_path / "given"
    given.mkdir()
    for out in (given, tmp_path / "new"):
        with pytest.raises(KeyboardInterrupt):
            fogwatch.run(SMALL, out=out)
    assert list(tmp_path.iterdir()) == [given]
    assert not list(given.iterdir())


@pytest.mark.parametrize("in_process", [True, pytest.param(False, marks=pytest.mark.processes)])
def test_a_scenario_file_that_is_rewritten_during_the_run_fails_its_verdict(in_process: bool, tmp_path: Path) -> None:
    folder = tmp_path / "run"

    def rewrite(_: object) -> None:
        file = folder / "scenario.yaml"
        file.write_text(file.read_text(encoding="utf-8").replace("seed: 0", "seed: 9"), encoding="utf-8")

    scenario = {**SMALL, "seed": 0}
    run = fogwatch.run(scenario, out=folder, in_process=in_process, picture=False, progress=rewrite)
    assert "seed: 9" in (folder / "scenario.yaml").read_text(encoding="utf-8")
    assert [check.name for check in run.verdict.failed] == ["scenario"]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["verdict"]["outcome"] == "invalid"
    assert run.verdict.exit_code == 1
