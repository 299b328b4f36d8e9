import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.measures.best_tour import best_tour, own_grounds
from patrol.prepare import Prepared, prepare
from patrol.scenario import Scenario, load_scenario, scenario_hash

BATTERY = {"capacity": 30.0, "drive": 30.0, "charge": 100.0}
CHARGED = {"count": 1, "model": "holonomic", "radius": 0.4, "starts": [[50.5, 50.5, 0.0]], "battery": BATTERY}


def mixed_fleet() -> Scenario:
    robots = [
        {"radius": 1.0},
        {"radius": 0.4, "model": "holonomic", "start": [10, 44, 1.0]},
        {"radius": 1.0, "name": "late"},
    ]
    terrain = {"builtin": "yards", "keep_out": [[[20, 40], [30, 40], [30, 48], [20, 48]]]}
    return load_scenario({"terrain": terrain, "point": 0.5, "robots": robots})


def test_bodies_of_one_radius_share_their_fields_each_time() -> None:
    prepared = prepare(mixed_fleet())
    assert list(prepared.fields) == [1, 2, 3]
    assert prepared.fields[1] is prepared.fields[3]
    assert prepared.fields[1].cspace.sum() < prepared.fields[2].cspace.sum()
    assert np.array_equal(prepared.patrolled, prepared.fields[1].patrolled | prepared.fields[2].patrolled)
    assert prepared.starts[1].heading == 1.0
    for spec, start in zip(prepared.scenario.roster, prepared.starts, strict=True):
        assert prepared.fields[spec.number].reach[prepared.terrain.point_at(start.x, start.y)]
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
    with pytest.raises(BadInput, match="not on open"):
        prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"starts": [[-5, 5]]}}))


@pytest.mark.parametrize(
    ("place", "problem"),
    [([-3, 4], "not on open, which spans x 0 to"), ([math.inf, 0], "expected"), ([1e8, 4], "not on")],
)
def test_an_intruder_must_be_on_the_terrain(place: list[float], problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "intruders": [{"place": place}]}))


ONE_IN_YARDS: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 0.5, "robots": {"count": 1}}


def in_a_building() -> list[float]:
    terrain = prepare(load_scenario(ONE_IN_YARDS)).terrain
    return list(terrain.centre(*map(int, np.argwhere(~terrain.passable)[0])))


def test_an_intruder_must_be_on_passable_ground() -> None:
    with pytest.raises(BadInput, match=r"intruders\.0\.place = .*: in an obstacle of yards; move it"):
        prepare(load_scenario({**ONE_IN_YARDS, "intruders": [{"place": in_a_building()}]}))


@pytest.mark.parametrize("area", [[[200, 200], [210, 200], [210, 210]], [[19.5, 1], [20.5, 1], [20, 9]]])
def test_a_critical_area_must_hold_free_ground(area: list[list[float]]) -> None:
    """One lies off the terrain, the other within a building."""
    around = [[40, 40], [60, 40], [60, 60]]
    patrol = {"options": {"separation": "semaphores", "critical_areas": [around, area]}}
    with pytest.raises(BadInput, match=r"patrol\.options\.critical_areas\.1: holds no free point of yards; correct"):
        prepare(load_scenario({**ONE_IN_YARDS, "patrol": patrol}))


GRAPH: dict[str, Any] = {"vertices": [[10, 44], [50, 44], [90, 44]], "edges": [[0, 1, 40], [1, 2, 40]]}
WATCHED: dict[str, Any] = {
    "terrain": {"builtin": "open", "graph": GRAPH, "patrolled": "vertices"},
    "point": 0.5,
    "sensor": {"range": 2},
    "robots": {"count": 2, "model": "holonomic"},
}


def test_nothing_but_the_vertices_is_patrolled_on_request(tmp_path: Path) -> None:
    scenario = load_scenario(WATCHED)
    prepared = prepare(scenario)
    at = {prepared.terrain.point_at(x, y) for x, y in GRAPH["vertices"]}
    assert set(map(tuple, np.argwhere(prepared.patrolled).tolist())) == at
    assert own_grounds(prepared)[1].patrolled.sum() == 3
    tour_m = best_tour(prepared).length_m
    assert tour_m is not None
    assert 2 * (80 - 2 * 2) <= tour_m < 2 * 80, "there and back, to where the outer ones are seen"
    prepared.save(tmp_path)
    assert np.array_equal(Prepared.load(scenario, tmp_path).patrolled, prepared.patrolled)


def test_a_vertex_on_which_no_body_fits_is_patrolled_where_it_is_seen() -> None:
    graph = {"vertices": [[50, 44], [0.25, 44]]}
    prepared = prepare(load_scenario({**WATCHED, "terrain": {**WATCHED["terrain"], "graph": graph}}))
    fields, at_wall = prepared.fields[1], prepared.terrain.point_at(0.25, 44)
    assert not fields.reach[at_wall]
    assert fields.patrolled[at_wall]
    assert np.argwhere(fields.proxy >= 0).tolist() == [list(at_wall)], "no other point has a post"


def test_a_vertex_that_no_robot_sees_and_robots_that_see_none_are_refused() -> None:
    keep_out = [[[20, 0], [21, 0], [21, 88], [20, 88]]]
    terrain = {"builtin": "open", "graph": {"vertices": [[50, 44]]}, "patrolled": "vertices", "keep_out": keep_out}
    robots = [{"radius": 1.0, "start": [50, 40]}, {"radius": 0.5, "start": [10, 44]}]
    with pytest.raises(BadInput, match=r"terrain\.patrolled: robots of radius 0\.5 m see no vertex"):
        prepare(load_scenario({**WATCHED, "terrain": terrain, "robots": robots}))
    graph = {"vertices": [[10, 44], in_a_building()]}
    given = {**WATCHED, "terrain": {"builtin": "yards", "graph": graph, "patrolled": "vertices"}}
    with pytest.raises(BadInput, match=r"terrain\.graph: vertex 1 near \[.*: no robot sees it from .*; correct"):
        prepare(load_scenario(given))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"docks": [{"place": [5.5, 5.5]}, {"place": [6.5, 5.5]}]}, r"docks\.1\.place = .*: 1 m from docks\.0, so one"),
        (
            {"robots": CHARGED | {"battery": BATTERY | {"capacity": 1e-4}}},
            r"capacity = 0\.0001: r1 starts with 0\.0001 Wh",
        ),
        ({"docks": [{"place": [5.5, 5.5], "radius": 6.0}]}, r"docks\.0\.radius = 6: .*give at most 5"),
    ],
)
def test_docks_and_batteries_that_cannot_serve_are_refused(change: dict[str, Any], message: str) -> None:
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": CHARGED, "docks": [{"place": [5.5, 5.5]}]}
    assert prepare(load_scenario(given)).scenario.docks
    with pytest.raises(BadInput, match=message):
        prepare(load_scenario(given | change))


def box(x0: float, x1: float) -> list[list[float]]:
    return [[x0, -1], [x1, -1], [x1, 101], [x0, 101]]


@pytest.mark.parametrize(
    ("boxes", "count", "message"),
    [
        (
            [box(10, 11), box(-1, 101)],
            2,
            r"^closures\.1\.polygon: c1 leaves no room on open for the starts of 2 robots",
        ),
        ([box(-1, 51), box(49, 101)], 1, r"^closures: together they leave no room on open for the starts of 1 robot, "),
        ([box(10, 11)], 2000, r"^robots: 2000 robots do not fit on open"),
    ],
)
def test_closures_that_leave_no_room_are_named(boxes: list[list[list[float]]], count: int, message: str) -> None:
    closures = [{"name": f"c{n}", "polygon": corners, "closed": [[10, 20]]} for n, corners in enumerate(boxes)]
    robots = {"count": count, "model": "holonomic", "radius": 0.4 if count < 10 else 4.0}
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": robots, "closures": closures}
    with pytest.raises(BadInput, match=message):
        prepare(load_scenario(given))


def test_vertices_without_a_graph_are_refused() -> None:
    with pytest.raises(BadInput, match=r"terrain\.patrolled: vertices: there is no graph; set terrain\.graph"):
        load_scenario({"terrain": {"builtin": "open", "patrolled": "vertices"}})


def test_patrolling_the_ground_keeps_the_scenario_hash() -> None:
    ground = load_scenario({"terrain": {"builtin": "open", "patrolled": "ground"}})
    assert scenario_hash(ground) == scenario_hash(load_scenario({"terrain": {"builtin": "open"}}))
    unwatched = load_scenario({**WATCHED, "terrain": {"builtin": "open", "graph": GRAPH}})
    assert scenario_hash(load_scenario(WATCHED)) != scenario_hash(unwatched)
