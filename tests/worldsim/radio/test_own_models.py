"""Radio models of one's own: found and checked like policies, drawn for each link, and never run by a verdict."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.classes.static_check import check_without_running
from patrol.errors import BadInput
from patrol.scenario import Scenario, dump_scenario, load_scenario, scenario_hash
from patrol.scenario.load import keep_scenario
from patrol.scenario.radio_spec import PathLossOptions
from tests.worldsim.checks.judged import change, failures
from tests.worldsim.conftest import Lab
from worldsim.radio.models import Ideal, ModelSetup, model_class, model_named, model_of
from worldsim.verdict.judge import judge

EXAMPLE = Path(__file__).parents[3] / "examples" / "my_radio.py"
MODELS = """
import numpy as np

class Deaf:
    def __init__(self, setup): pass
    def lost(self, air): return np.ones(air.on_the_way.shape, dtype=bool)

class Unmade(Deaf):
    def __init__(self, setup): raise KeyError("no idea")

class Raising(Deaf):
    def lost(self, air): return 1 / 0

class Leaving(Deaf):
    def lost(self, air): raise SystemExit(0)

class Narrow(Deaf):
    def lost(self, air): return np.ones(3, dtype=bool)

class Shares(Deaf):
    def lost(self, air): return np.ones(air.on_the_way.shape)

class Nothing(Deaf):
    def lost(self, air): return None

class Silent: pass
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a scenario beside a file with models; the scenario's path."""

    def make(model: str, **radio: Any) -> Path:
        (tmp_path / "radio.py").write_text(MODELS, encoding="utf-8")
        path = tmp_path / "scenario.yaml"
        mapping = {"terrain": {"builtin": "open"}, "point": 2.0, "radio": {"model": model, **radio}}
        path.write_text(json.dumps(mapping), encoding="utf-8")
        return path

    return make


def test_a_model_of_ones_own_decides_and_is_not_run_by_the_verdict(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    radio = {"model": f"{EXAMPLE}:Halving", "options": {"reach": 6.0}}
    faults = [{"kind": "loss", "rate": 0.2}, {"kind": "delay", "delay": {"constant": 1.0}, "from": "r1"}]
    world, journal = lab.driven(radio=radio, faults=faults, ticks=60)
    lost = sum(why == "model" for record in journal.ticks for *_, why in record.dropped)
    assert lost > 100
    monkeypatch.setattr("worldsim.radio.models.load", lambda _: pytest.fail("a verdict loads no code"))
    said = {check.name: check.detail for check in judge(journal, {}, world.prepared).checks}
    assert failures((world, journal)) == {}
    assert said["radio"].endswith("but for what the radio model has lost, which is code of one's own")
    # All but its own choice is judged: what it says to have lost cannot have arrived too.
    record = next(record for record in journal.ticks if any(why == "model" for *_, why in record.dropped))
    drop = next(drop for drop in record.dropped if drop[3] == "model")
    change(journal, record.k, deliveries=tuple(sorted((*record.deliveries, drop[:3]))))
    assert "radio" in failures((world, journal))


def test_frames_are_lost_as_often_as_the_example_says(lab: Lab) -> None:
    _, journal = lab.driven(radio={"model": f"{EXAMPLE}:Halving", "options": {"reach": 1e-6}}, ticks=200)
    lost = sum(len(record.dropped) for record in journal.ticks)
    assert abs(lost / (200 * 12) - 0.5) < 4.5 * 0.5 / np.sqrt(200 * 12)


def test_the_ideal_model_loses_nothing_and_is_not_asked(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    world = lab.patrol(ticks=10)
    assert model_of(world.scenario, world.terrain) is None
    kind, options = model_class(world.scenario)
    assert kind is Ideal
    monkeypatch.setattr("worldsim.world.model_of", lambda _, terrain: kind(ModelSetup(options, 1, 0.5, terrain)))
    world = lab.patrol(ticks=10)
    assert failures((world, lab.run(world))) == {}


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("Raising", "raises ZeroDivisionError: division by zero; correct it"),
        ("Leaving", "raises SystemExit: 0; correct it"),
        ("Narrow", "lost(air) gave bool (3,) in tick 0; return bool (4, 4)"),
        ("Shares", "lost(air) gave float64 (4, 4) in tick 0; return bool (4, 4)"),
        ("Nothing", "lost(air) gave object () in tick 0; return bool (4, 4)"),
        ("Unmade", "raises KeyError: 'no idea'; correct it"),
    ],
)
def test_a_model_that_fails_is_bad_input_in_one_line(
    name: str, says: str, lab: Lab, write: Callable[..., Path]
) -> None:
    model = load_scenario(write(f"./radio.py:{name}")).radio.model
    with pytest.raises(BadInput) as bad:
        lab.run(lab.patrol(radio={"model": model}))
    assert str(bad.value) == f"radio.model = {model}: {says}"


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("path-los", "no such model; did you mean path-loss?, or give package.module:Class or ./file.py:Class"),
        ("./radio.py:Deaff", "has no Deaff; did you mean Deaf?"),
        ("./radio.py:Silent", "is not a class with a method lost(air); name one that has it"),
        ("./nowhere.py:Deaf", "cannot be read (No such file or directory); correct it"),
        ("nobody_has_this.module:Class", "No module named 'nobody_has_this'; install it, or give ./file.py:Class"),
    ],
)
def test_a_model_that_cannot_be_had_is_named_with_and_without_running_it(
    model: str, says: str, write: Callable[..., Path]
) -> None:
    scenario = load_scenario(write(model))
    for look in (lambda: model_class(scenario), lambda: check_without_running(model_named(scenario))):
        with pytest.raises(BadInput) as bad:
            look()
        assert str(bad.value).startswith("radio.model = ")
        assert says in str(bad.value)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"reach": -1}, "radio.options.reach = -1: "),
        ({"range": 3}, "radio.options.range = 3: unknown key"),
        ({"reach": "far"}, "radio.options.reach = 'far': "),
    ],
)
def test_options_are_the_models_own(options: dict[str, Any], says: str) -> None:
    mapping = {"terrain": {"builtin": "open"}, "radio": {"model": f"{EXAMPLE}:Halving", "options": options}}
    with pytest.raises(BadInput) as bad:
        model_class(load_scenario(mapping))
    assert str(bad.value).startswith(says)
    assert str(bad.value).endswith("has the options reach")


def test_a_model_without_options_takes_none(write: Callable[..., Path]) -> None:
    with pytest.raises(BadInput, match=r"radio\.options = \{'reach': 3\}: .* takes no options; leave them out"):
        model_class(load_scenario(write("./radio.py:Deaf", options={"reach": 3})))


# --- what a scenario with a model means ------------------------------------------------------------------------------


PAPERS = {"policy": "potential-field"}


def digest(**radio: Any) -> str:
    return scenario_hash(load_scenario({"terrain": {"builtin": "open"}, "radio": radio, "patrol": PAPERS}))


def test_the_hash_covers_model_and_options_and_is_the_old_one_for_the_ideal_one() -> None:
    ideal = digest(trail=2)
    assert ideal == "26cbad123eaba9a7ae681ca851a3c95ac7ac1b5969724efb843dc463cdb02e5c"
    assert digest(trail=2, model="ideal") == ideal
    others = [digest(model="path-loss"), digest(model="path-loss", options={"wall": 7}), digest(model="a.b:C")]
    assert len({ideal, *others}) == 4
    assert digest(model="path-loss", options={"wall": 6.0}) == others[0]


def test_a_run_folder_has_the_models_file_with_it(write: Callable[..., Path], tmp_path: Path) -> None:
    scenario = load_scenario(write("./radio.py:Deaf"))
    assert scenario.radio.model_sha256 is not None
    (tmp_path / "kept").mkdir()
    keep_scenario(scenario, tmp_path / "kept")
    (tmp_path / "radio.py").unlink()
    again = load_scenario(tmp_path / "kept" / "scenario.yaml")
    assert again.radio.model == f"{tmp_path / 'kept' / 'model' / 'radio.py'}:Deaf"
    assert scenario_hash(again) == scenario_hash(scenario)
    assert model_class(again)[0].__name__ == "Deaf"
    (tmp_path / "kept" / "model" / "radio.py").write_text("import os", encoding="utf-8")
    with pytest.raises(BadInput, match="is not the file that this scenario was resolved with"):
        model_class(again)


def test_another_model_has_other_options() -> None:
    mapping = {"terrain": {"builtin": "open"}, "radio": {"model": "path-loss", "options": {"wall": 3}}}
    same, other = (load_scenario(mapping, {"radio.model": model}) for model in ("path-loss", f"{EXAMPLE}:Halving"))
    assert isinstance(same.radio.options, PathLossOptions)
    assert same.radio.options.wall == 3.0
    assert other.radio.options is None
    loaded: Scenario = load_scenario(mapping, {"radio.options.wall": "4"})
    assert isinstance(loaded.radio.options, PathLossOptions)
    assert (loaded.radio.options.wall, loaded.radio.options.exponent) == (4.0, 2.5)
    assert "wall: 4.0" in dump_scenario(loaded)


def loss_with(**options: object) -> dict[str, Any]:
    return {"model": "path-loss", "options": options}


@pytest.mark.parametrize(
    ("radio", "says"),
    [
        ({"options": {"wall": 3}}, 'radio.options = {"wall": 3}: expected none: the model ideal has no settings'),
        (loss_with(wal=3), "radio.options.wal: unknown key; did you mean wall?"),
        (loss_with(wall=-1), "radio.options.wall = -1: expected a number from 0 to 200"),
        (loss_with(exponent=0), "expected a number from 1 to 10"),
        (loss_with(sensitivity=True), "expected a number from -200 to 100"),
        (loss_with(airtime=0.7), "radio.options.airtime = 0.7: longer than one step of 0.5"),
        (loss_with(redraw=1e-308), "radio.options.redraw = 1e-308: shorter than one step of 0.5 s"),
        ({"model": "path-loss", "model_sha256": "0" * 64}, "model_sha256: only a model that is a file has a hash"),
        ({"model": ["path-loss"]}, 'radio.model = ["path-loss"]: expected ideal, path-loss, package.module:Class'),
        ({"wall": 3}, "radio.wall: unknown key; did you mean radio.options.wall?"),
    ],
)
def test_what_a_section_may_not_say(radio: dict[str, Any], says: str) -> None:
    with pytest.raises(BadInput) as bad:
        load_scenario({"terrain": {"builtin": "open"}, "radio": radio})
    assert says in str(bad.value)


def test_the_module_of_1_0_has_the_same_names() -> None:
    port = import_module("worldsim.radio.models.port")
    assert port.ModelSetup is ModelSetup
