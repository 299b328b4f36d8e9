"""A few short patrols of random buildings. The long check is ``tests/accept/test_building_patrols.py``."""

from __future__ import annotations

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.building_patrols import patrol, random_scenario

SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("buildings", [2, pytest.param(10, marks=pytest.mark.accept)])
def test_no_robot_is_trapped_in_a_building(buildings: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    @given(SEEDS)
    @settings(max_examples=buildings, phases=(Phase.explicit, Phase.generate))
    def patrols(seed: int) -> None:
        findings = patrol(random_scenario(seed, tmp_path_factory.mktemp("building"), longest_s=300.0))
        assert not findings.stuck, findings
        assert findings.model == "car" or not findings.left_out, findings

    patrols()
