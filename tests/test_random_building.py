"""Random buildings, and a few short patrols of them; the long check is ``tests/accept/test_building_patrols.py``."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from patrol.ground.cspace import cspace_of
from patrol.maps.load import load_terrain, read_terrain
from patrol.scenario import load_scenario
from patrol.starts import starting_part
from tests.building_patrols import patrol, random_scenario
from tests.random_building import STORED, random_building

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


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_stored_buildings_are_drawn_in_the_same_way_in_every_version(path: Path) -> None:
    _, _, point = STORED[path]
    assert np.array_equal(read_terrain(path, point).passable, random_building(*STORED[path]).free)


@pytest.mark.parametrize("buildings", [2, pytest.param(10, marks=pytest.mark.accept)])
def test_no_robot_is_trapped_in_a_building(buildings: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    @given(SEEDS)
    @settings(max_examples=buildings, phases=(Phase.explicit, Phase.generate))
    def patrols(seed: int) -> None:
        findings = patrol(random_scenario(seed, tmp_path_factory.mktemp("building"), longest_s=300.0))
        assert not findings.stuck, findings
        assert findings.model == "car" or not findings.left_out, findings

    patrols()
