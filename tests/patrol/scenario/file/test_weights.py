from pathlib import Path
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.scenario import Scenario, dump_scenario, load_scenario, same_but_for_files, scenario_hash
from patrol.scenario.load import keep_scenario
from patrol.scenario.policies import LearnedOptions


def with_network(folder: Path, content: bytes = b"network", name: str = "trained.npz", **options: Any) -> Scenario:
    folder.mkdir(exist_ok=True)
    (folder / name).write_bytes(content)
    patrol = {"policy": "learned", "options": {"weights": name, **options}}
    return load_scenario({"terrain": {"builtin": "open"}, "patrol": patrol}, base=folder)


def options_of(scenario: Scenario) -> LearnedOptions:
    assert isinstance(scenario.patrol.options, LearnedOptions)
    return scenario.patrol.options


def test_the_hash_covers_what_the_file_holds_and_not_where_it_lies(tmp_path: Path) -> None:
    one = with_network(tmp_path / "one")
    assert options_of(one).weights == str(tmp_path / "one" / "trained.npz")
    assert scenario_hash(one) == scenario_hash(with_network(tmp_path / "two", name="other.npz"))
    others = [
        with_network(tmp_path / "three", b"another"),
        with_network(tmp_path / "four", name="trained.onnx"),
        with_network(tmp_path / "five", window=11),
    ]
    assert len({scenario_hash(scenario) for scenario in (one, *others)}) == 4


def test_a_run_folder_has_a_copy_which_the_scenario_there_names(tmp_path: Path) -> None:
    scenario = with_network(tmp_path / "here")
    folder = tmp_path / "run"
    folder.mkdir()
    kept = load_scenario(keep_scenario(scenario, folder))
    assert options_of(kept).weights == str(folder / "policy" / "trained.npz")
    assert options_of(kept).read_weights() == b"network"
    assert scenario_hash(kept) == scenario_hash(scenario)
    assert same_but_for_files(kept, scenario)
    assert not same_but_for_files(kept, load_scenario(scenario.model_dump(), {"patrol.options.heard": 5}))


def test_a_file_that_has_changed_since_is_refused(tmp_path: Path) -> None:
    scenario = with_network(tmp_path / "here")
    (tmp_path / "here" / "trained.npz").write_bytes(b"changed")
    with pytest.raises(BadInput, match="is not the file that this scenario was resolved with"):
        options_of(scenario).read_weights()
    folder = tmp_path / "run"
    folder.mkdir()
    with pytest.raises(BadInput, match=r"restore it, or drop patrol\.options\.weights_sha256"):
        keep_scenario(scenario, folder)


def test_another_file_by_an_override_has_its_own_hash(tmp_path: Path) -> None:
    scenario = with_network(tmp_path / "here")
    (tmp_path / "here" / "other.npz").write_bytes(b"other")
    path = tmp_path / "scenario.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    other = load_scenario(path, {"patrol.options.weights": "here/other.npz"})
    assert options_of(other).read_weights() == b"other"


def test_a_stranger_s_file_is_not_opened_for_a_look(tmp_path: Path) -> None:
    patrol = {"policy": "learned", "options": {"weights": "trained.npz"}}
    (tmp_path / "trained.npz").write_bytes(b"network")
    raw = {"terrain": {"builtin": "open"}, "patrol": patrol}
    assert options_of(load_scenario(raw, base=tmp_path, opens_classes=False)).weights_sha256 is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": "trained.txt"}, "weights: is no .npz or .onnx file"),
        ({"weights_sha256": "0" * 64}, "there are no weights; drop it"),
        ({"window": 8}, "window = 8: is even"),
        ({"window": 1}, "window"),
        ({"inputs": []}, "inputs"),
        ({"inputs": ["pose", "pose"]}, "names one of them twice"),
        ({"decide": "arrival"}, "decide: is arrival, and a bearing leads to no place"),
        ({"size": 3}, "size"),
    ],
)
def test_settings_that_do_not_fit_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        load_scenario({"terrain": {"builtin": "open"}, "patrol": {"policy": "learned", "options": options}})


def test_without_a_file_there_is_nothing_to_run() -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "patrol": {"policy": "learned"}})
    with pytest.raises(BadInput, match=r"patrol\.options\.weights: is missing; train a network with fogwatch\.learn"):
        options_of(scenario).read_weights()
