"""A run folder with everything in it, and the command."""

import shutil
from pathlib import Path

import pytest

from monitor.recording.run_recorder import Recorder
from monitor.replay.replay import play
from monitor.replay.run import open_run
from tests.hostile.files.looks import write_map
from tests.monitor.conftest import FAULTS, QUIET, run_of


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run with faults, an intruder, a recording and a map of its own; nobody writes into it."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "map").mkdir()
    write_map(folder / "map" / "hall.yaml")
    facts = {"name": "hall", "duration": 14, "faults": FAULTS[:3], "intruders": [{"place": [10.5, 10.5], "at": 2}]}
    run_of(folder, {**QUIET, **facts, "terrain": {"map": str(folder / "map" / "hall.yaml")}})
    scenario = (folder / "scenario.yaml").read_text(encoding="utf-8")
    (folder / "scenario.yaml").write_text(scenario.replace(f"{folder}/", ""), encoding="utf-8")
    recorder = Recorder(run := open_run(folder), folder / "recording.mcap")
    play(run, [recorder])
    recorder.close()
    return folder


@pytest.fixture
def strange(run_folder: Path, tmp_path: Path) -> Path:
    """A copy of the run folder, to change."""
    return Path(shutil.copytree(run_folder, tmp_path / "run"))
