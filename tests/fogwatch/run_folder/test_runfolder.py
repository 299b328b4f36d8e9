from datetime import UTC, datetime
from pathlib import Path

import pytest
from PIL import Image

import fogwatch
from fogwatch.run_folder import runfolder
from fogwatch.run_folder.runfolder import RunFolder, fill, make_folder
from patrol.errors import BadInput
from patrol.scenario import Scenario, load_scenario, scenario_hash

NOW = datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC)


def create(scenario: Scenario, out: Path | None, now: datetime) -> RunFolder:
    folder = make_folder(scenario, out, now)
    fill(folder, scenario, out)
    return folder


def test_the_default_folder_has_the_name_and_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario({"name": "five", "terrain": {"builtin": "open"}})
    first, second = create(scenario, None, NOW), create(scenario, None, NOW)
    assert first.path == tmp_path / "runs" / "five-20260304-050607"
    assert second.path == tmp_path / "runs" / "five-20260304-050607-2"
    assert scenario_hash(first.load()) == scenario_hash(scenario)


def test_a_map_is_copied_so_that_the_folder_can_be_moved(tmp_path: Path) -> None:
    source = tmp_path / "source"
    (source / "images").mkdir(parents=True)
    Image.new("L", (8, 6), 0).save(source / "images" / "plan.png")
    (source / "plan.yaml").write_text(
        "image: images/plan.png\nresolution: 0.05\norigin: [1e-5, -2.5, 0.0]\nnegate: 1\n"
        "occupied_thresh: 0.9\nfree_thresh: 0.1\nmode: scale\n",
        encoding="utf-8",
    )
    scenario = load_scenario({"terrain": {"map": str(source / "plan.yaml")}, "robots": {"count": 1}})
    create(scenario, tmp_path / "run", NOW)
    (tmp_path / "run").rename(tmp_path / "moved")
    (source / "images" / "plan.png").unlink()
    again = load_scenario(tmp_path / "moved" / "scenario.yaml")
    assert again.terrain.map is not None
    assert Path(again.terrain.map).parent == tmp_path / "moved" / "map"
    create(again, tmp_path / "third", NOW)
    assert scenario_hash(load_scenario(tmp_path / "third" / "scenario.yaml")) == scenario_hash(again)


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    scenario = load_scenario({"terrain": {"builtin": "open"}})
    for out, problem in (("", "is not empty"), ("file", "cannot be written"), ("file/below", "cannot be written")):
        with pytest.raises(BadInput, match=rf"--out {tmp_path / out}: {problem}"):
            create(scenario, tmp_path / out, NOW)


def test_runs_that_begin_at_once_have_folders_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario({"name": "five", "terrain": {"builtin": "open"}})
    real, others = runfolder.untaken, iter([True, True, False])

    def overtaken(first: Path) -> Path:
        path = real(first)
        if next(others):
            path.mkdir(parents=True)
        return path

    monkeypatch.setattr(runfolder, "untaken", overtaken)
    assert create(scenario, None, NOW).path.name == "five-20260304-050607-3"
    given = tmp_path / "given"
    given.mkdir()
    (given / "mine").touch()
    with pytest.raises(BadInput, match=r"--out .*given: is not empty"):
        fogwatch.run(scenario, out=given)
    assert [path.name for path in given.iterdir()] == ["mine"]


def test_where_runs_leads_nowhere_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario({"name": "five", "terrain": {"builtin": "open"}})
    (tmp_path / "runs").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BadInput, match="runs/five-20260304-050607: cannot be written"):
        make_folder(scenario, None, NOW)
    (tmp_path / "runs").unlink()
    (tmp_path / "runs").touch()
    with pytest.raises(BadInput, match="runs/five-20260304-050607: cannot be written"):
        make_folder(scenario, None, NOW)


def test_what_could_not_begin_leaves_nothing_of_ours(tmp_path: Path) -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}})
    given = tmp_path / "given"
    given.mkdir()
    create(scenario, given, NOW).discard()
    create(scenario, tmp_path / "new", NOW).discard()
    assert list(tmp_path.iterdir()) == [given]
    assert not list(given.iterdir())
