"""Random buildings, and a few short patrols of them; the long check is ``tests/accept/test_building_patrols.py``."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from experiments.random_building import random_building
from fogwatch.cli.app import app
from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of
from patrol.maps.load import load_terrain, read_terrain
from patrol.scenario import load_scenario
from patrol.starts import starting_part
from tests.building_patrols import patrol, random_scenario

# Not the product's own, so that a wrong one there is noticed.
LEAST_AREA = 25.0
LEAST_PART = 0.5

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.sampled_from([0.15, 0.3, 0.5]), st.sampled_from([0.1, 0.25, 0.3]))
@settings(max_examples=20)
def test_most_of_a_building_is_connected(seed: int, radius: float, point: float) -> None:
    building = random_building(seed, radius, point)
    assert np.array_equal(building.free, random_building(seed, radius, point).free)
    part, fits = starting_part(building.terrain, radius), cspace_of(building.terrain, radius)
    assert np.count_nonzero(part) >= LEAST_PART * np.count_nonzero(fits)
    assert np.count_nonzero(part) * point**2 >= LEAST_AREA


def test_a_building_is_a_map(tmp_path: Path) -> None:
    building = random_building(5, 0.3, 0.15)
    scenario = load_scenario({"terrain": {"map": str(building.write(tmp_path))}, "point": 0.15})
    assert np.array_equal(load_terrain(scenario.terrain, scenario.point, scenario.base).passable, building.free)


@pytest.mark.parametrize(
    ("seed", "point", "digest"),
    [(101, 0.1, "4fa054f86169a412"), (102, 0.1, "0dc45889c1b07f17"), (13, 0.25, "0cd771dfe615eaa5")],
)
def test_buildings_that_results_name_stay_the_same(seed: int, point: float, digest: str) -> None:
    free = np.packbits(random_building(seed, 0.3, point).free)
    assert hashlib.sha256(free.tobytes()).hexdigest()[:16] == digest


def test_the_command_writes_the_maps_of_consecutive_seeds(tmp_path: Path) -> None:
    arguments = ["map", "random", str(tmp_path / "maps"), "--seed", "7", "--count", "2", "--point", "0.2"]
    written = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert written.exit_code == 0
    for seed, line in zip((7, 8), written.output.splitlines(), strict=True):
        file = tmp_path / "maps" / f"random{seed}.yaml"
        assert line.startswith(f"{file}: ")
        assert np.array_equal(read_terrain(file, 0.2).passable, random_building(seed, 0.3, 0.2).free)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        (["--count", "0"], "--count 0: expected a number of buildings"),
        (["--seed", "-1"], "--seed -1: expected an integer from 0"),
        (["--radius", "9"], "--radius 9: expected m from 0.1 to 0.8"),
        (["--point", "nan"], "--point nan: expected m from 0.05 to 0.5"),
    ],
)
def test_bad_input_names_the_option(given: list[str], problem: str, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=problem):
        CliRunner().invoke(app, ["map", "random", str(tmp_path / "maps"), *given], catch_exceptions=False)
    assert not (tmp_path / "maps").exists()


def test_a_map_of_another_building_is_not_overwritten(tmp_path: Path) -> None:
    words = ["map", "random", str(tmp_path), "--seed", "13", "--point", "0.25"]
    for _ in range(2):
        assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(BadInput, match=r"random13\.pgm: exists already, with other content; choose another folder"):
        CliRunner().invoke(app, [*words, "--radius", "0.2"], catch_exceptions=False)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("buildings", [2, pytest.param(10, marks=pytest.mark.accept)])
def test_no_robot_is_trapped_in_a_building(buildings: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    @given(SEEDS)
    @settings(max_examples=buildings, phases=(Phase.explicit, Phase.generate))
    def patrols(seed: int) -> None:
        findings = patrol(random_scenario(seed, tmp_path_factory.mktemp("building"), longest_s=300.0))
        assert not findings.stuck, findings
        assert findings.model == "car" or not findings.left_out, findings

    patrols()
