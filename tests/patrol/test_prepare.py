from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.prepare import Prepared, prepare
from patrol.scenario import Scenario, load_scenario


def mixed_fleet() -> Scenario:
    return load_scenario(
        {
            "terrain": {"builtin": "yards", "keep_out": [[[20, 40], [30, 40], [30, 48], [20, 48]]]},
            "point": 0.5,
            "robots": [
                {"radius": 1.0},
                {"radius": 0.4, "model": "holonomic", "start": [10, 44, 1.0]},
                {"radius": 1.0, "name": "late"},
            ],
        }
    )


def test_bodies_of_one_radius_share_their_fields() -> None:
    prepared = prepare(mixed_fleet())
    assert list(prepared.fields) == [1, 2, 3]
    assert prepared.fields[1] is prepared.fields[3]
    assert prepared.fields[1].cspace.sum() < prepared.fields[2].cspace.sum()
    assert np.array_equal(prepared.patrolled, prepared.fields[1].patrolled | prepared.fields[2].patrolled)
    assert prepared.starts[1].heading == 1.0
    for spec, start in zip(prepared.scenario.roster, prepared.starts, strict=True):
        assert prepared.fields[spec.number].reach[prepared.terrain.point_at(start.x, start.y)]


def test_preparing_twice_gives_the_same() -> None:
    first, second = prepare(mixed_fleet()), prepare(mixed_fleet())
    assert first.starts == second.starts
    assert np.array_equal(first.fields[1].proxy, second.fields[1].proxy)


def test_what_is_saved_is_loaded_memory_mapped(tmp_path: Path) -> None:
    scenario = mixed_fleet()
    prepared = prepare(scenario)
    prepared.save(tmp_path / "static")
    loaded = Prepared.load(scenario, tmp_path / "static")
    assert loaded.starts == prepared.starts
    assert loaded.fields[1] is loaded.fields[3]
    assert (loaded.terrain.name, loaded.terrain.point, loaded.terrain.origin) == ("yards", 0.5, (0.0, 0.0))
    assert np.array_equal(loaded.terrain.free, prepared.terrain.free)
    assert np.array_equal(loaded.patrolled, prepared.patrolled)
    for number, fields in prepared.fields.items():
        assert np.array_equal(loaded.fields[number].proxy, fields.proxy)
    assert not loaded.terrain.passable.flags.writeable


def test_a_start_off_the_terrain_is_refused() -> None:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"starts": [[-5, 5]]}})
    with pytest.raises(BadInput, match="not on open"):
        prepare(scenario)


@pytest.mark.parametrize(
    ("place", "problem"),
    [([-3, 4], "not on open, which spans x 0 to"), ([math.inf, 0], "expected"), ([1e8, 4], "not on")],
)
def test_an_intruder_must_be_on_the_terrain(place: list[float], problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "intruders": [{"place": place}]}))


def test_an_intruder_must_be_on_passable_ground() -> None:
    mapping = {"terrain": {"builtin": "yards"}, "point": 0.5, "robots": {"count": 1}}
    terrain = prepare(load_scenario(mapping)).terrain
    row, col = map(int, np.argwhere(~terrain.passable)[0])
    place = list(terrain.centre(row, col))
    with pytest.raises(BadInput, match=r"intruders\.0\.place = .*: in an obstacle of yards; move it"):
        prepare(load_scenario({**mapping, "intruders": [{"place": place}]}))


@pytest.mark.parametrize("area", [[[200, 200], [210, 200], [210, 210]], [[19.5, 1], [20.5, 1], [20, 9]]])
def test_a_critical_area_must_hold_free_ground(area: list[list[float]]) -> None:
    """One lies off the terrain, the other within a building."""
    around = [[40, 40], [60, 40], [60, 60]]
    patrol = {"options": {"separation": "semaphores", "critical_areas": [around, area]}}
    mapping = {"terrain": {"builtin": "yards"}, "point": 0.5, "robots": {"count": 1}, "patrol": patrol}
    with pytest.raises(BadInput, match=r"patrol\.options\.critical_areas\.1: holds no free point of yards; correct"):
        prepare(load_scenario(mapping))
