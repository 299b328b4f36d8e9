"""Random scenarios: repeated by their seeds, each with half of everything, and settings as given."""

from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.maps.load import read_terrain
from patrol.random import Draws
from patrol.scenario import as_mapping
from patrol.starts import starting_part
from tests.chaos.swarm import FAULT_KINDS, draw_stored, random_fleet


def test_the_seed_decides_the_scenario(tmp_path: Path) -> None:
    first, again, other = (as_mapping(random_fleet(seed, tmp_path).scenario) for seed in (4, 4, 5))
    assert first == again
    assert first != other


def test_two_seeds_share_out_the_kinds_of_faults(tmp_path: Path) -> None:
    met = [{fault.kind for fault in random_fleet(seed, tmp_path).scenario.faults} for seed in range(60)]
    healing = {"restart", "join", "resume", "pause"}  # other kinds bring them along
    for even, odd in zip(met[::2], met[1::2], strict=True):
        assert not (even & odd) - healing
    assert set().union(*met) == set(FAULT_KINDS)


def test_settings_stay_as_given(tmp_path: Path) -> None:
    settings = {"sensor.range": 7.0, "robots.radius": 0.25, "radio.forget_after": 9.0, "zones": []}
    for seed in range(10):
        scenario = random_fleet(seed, tmp_path, settings).scenario
        assert scenario.sensor.range == 7.0
        assert {spec.radius for spec in scenario.roster} == {0.25}
        assert scenario.radio.forget_after == 9.0
        assert scenario.zones == ()


def test_settings_that_leave_no_room_are_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="radius"):
        random_fleet(1, tmp_path, {"robots.radius": 60.0})


@pytest.mark.parametrize("point", [0.25, 0.4])
@pytest.mark.parametrize("radius", [0.2, 0.3, 0.31, 0.4])
def test_there_are_stored_buildings_with_room_for_each_body(radius: float, point: float) -> None:
    dice = Draws(1)
    drawn = {draw_stored(dice, radius, point) for _ in range(30)}
    assert len(drawn) == 3
    for path in drawn:
        assert starting_part(read_terrain(path, point), radius).sum() * point**2 >= 25.0
