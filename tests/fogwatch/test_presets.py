from pathlib import Path

import pytest

import fogwatch
from experiments.paper.printed import paper
from fogwatch.run_options import PRESETS, Body, preset_settings
from patrol.errors import BadInput
from patrol.scenario import open_scenario, scenario_hash
from patrol.scenario.policies import TO_THE_LETTER
from tests.fogwatch.conftest import Refused, Shell


def test_without_a_preset_nothing_is_set() -> None:
    assert preset_settings(None) == {}


def test_the_presets_are_what_the_papers_tables_run() -> None:
    """A cell of Table 4 is the preset and what the table says of terrain, team and forces."""
    table = paper().table(4)
    own = {**table.settings, **table.rows["wave+mode"], table.field: 3}
    for name, more in (("paper", {}), ("letter", TO_THE_LETTER)):
        ours = open_scenario("yards", {**preset_settings(name), **own})
        theirs = open_scenario("yards", {**paper().settings, **own, **more})
        assert scenario_hash(ours) == scenario_hash(theirs)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("terrain", ["open", "yards", "clutter", "site"])
def test_a_preset_suits_every_terrain(name: str, terrain: str) -> None:
    scenario = open_scenario(terrain, preset_settings(name))
    assert scenario.patrol.policy == "potential-field"
    assert (scenario.point, scenario.sensor.range) == (0.5, 12.0)


def test_python_code_gives_a_preset_by_name_too(tmp_path: Path) -> None:
    settings = {"duration": 1, "robots.count": 1, "robots.model": "holonomic", "sensor.range": 9}
    run = fogwatch.run("yards", out=tmp_path / "run", preset="letter", overrides=settings, picture=False)
    ours = open_scenario("yards", {**preset_settings("letter"), **settings})
    assert scenario_hash(run.scenario) == scenario_hash(ours)
    assert run.scenario.sensor.range == 9
    with pytest.raises(BadInput, match=r"^preset papre: no such preset; choose from paper, letter"):
        fogwatch.run("yards", preset="papre")


def test_other_options_hold_over_the_preset(shell: Shell, refused: Refused) -> None:
    shown = shell("scenario", "show", "yards", "--preset", "letter", "--set", "sensor.range=9")
    assert shown.code == 0
    assert "  range: 9.0 " in shown.out
    assert "    letter: true " in shown.out
    assert "preset papre: no such preset" in refused("run", "yards", "--preset", "papre", "--in-process")


@pytest.mark.parametrize(("robots", "is_refused"), [("holonomic", True), ("differential", True), ("car", False)])
def test_a_turning_radius_without_cars_is_refused(robots: str, is_refused: bool) -> None:
    scenario = open_scenario("open", {"robots.model": robots, "robots.turning_radius": 3.0})
    Body().check(scenario)
    if is_refused:
        with pytest.raises(BadInput, match="--turning-radius 3: has an effect only on cars"):
            Body(turning_radius=3.0).check(scenario)
    else:
        Body(turning_radius=3.0).check(scenario)
